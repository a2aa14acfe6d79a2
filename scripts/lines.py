#!/usr/bin/env python3
"""Counts lines of Rust that are neither blank nor comment, outside of `#[cfg(test)]`: scripts/lines.py [COMMIT …]

Prints the library, the rest (CPU builders, laboratory, library for C), both, and the longest files, of the working tree and of each
commit that is named. Tests, benches, examples and build scripts are not counted.
"""

import re
import subprocess
import sys

LIBRARY = re.compile(r"src/(accel|bvh|geometry|gpu|kdtree|trace)/.*\.rs|src/(lib|error|layouts)\.rs")
# `src/` held everything before the crates were parted.
REST = re.compile(r"(host|lab|capi)/src/.*\.rs|src/.*\.rs")


def git(*arguments):
    return subprocess.run(["git", *arguments], check=True, capture_output=True, text=True).stdout


def code_lines(text):
    """Lines of code outside of `#[cfg(test)]` items."""
    count, depth, skipping, awaiting = 0, 0, None, False
    in_comment = False
    for line in text.split("\n"):
        stripped = line.strip()
        if in_comment:
            in_comment = "*/" not in stripped
            continue
        if stripped.startswith("/*"):
            in_comment = "*/" not in stripped
            continue
        if not stripped or stripped.startswith("//"):
            continue
        if skipping is None and re.match(r"#\[cfg\((all\()?test\b", stripped):
            awaiting = True
            continue
        plain = re.sub(r'"(\\.|[^"\\])*"|\'(\\.|[^\'\\])\'', "", stripped)
        braces = plain.count("{") - plain.count("}")
        if awaiting:
            if stripped.startswith("#["):
                continue
            awaiting = False
            if braces > 0:
                skipping = depth
            elif "{" not in plain and not plain.endswith(";"):
                skipping = depth
            depth += braces
            continue
        depth += braces
        if skipping is not None:
            if depth <= skipping:
                skipping = None
            continue
        count += 1
    return count


def files_of(commit):
    if commit is None:
        names = git("ls-files", "--cached", "--others", "--exclude-standard", "*.rs").split("\n")
        for name in names:
            try:
                with open(name, encoding="utf-8") as file:
                    yield name, file.read()
            except FileNotFoundError:
                pass
    else:
        for name in git("ls-tree", "-r", "--name-only", commit).split("\n"):
            if name.endswith(".rs"):
                yield name, git("show", f"{commit}:{name}")


def report(commit):
    library = rest = 0
    sizes = []
    for name, text in files_of(commit):
        # The module that `#[cfg(test)] mod tests;` names.
        if name.endswith("/tests.rs"):
            continue
        lines = code_lines(text)
        if LIBRARY.fullmatch(name):
            library += lines
        elif REST.fullmatch(name):
            rest += lines
        else:
            continue
        sizes.append((lines, name))
    longest = ", ".join(f"{name} {lines}" for lines, name in sorted(sizes, reverse=True)[:3])
    print(f"{commit or 'working tree':14} library {library:6}  rest {rest:6}  both {library + rest:6}  longest: {longest}")


if __name__ == "__main__":
    for commit in sys.argv[1:]:
        report(commit)
    report(None)
