#!/bin/sh
# A folder that runs on a machine with a Vulkan driver and nothing else: make portable OUT=DIR.
#
# One program with the compiled shaders inside, scenes, run.sh and a page on reading what that writes. Scenes of the folder
# HEDGEROW_SCENES come with it, smallest first, as long as there is room.
set -eu

usage() { echo "usage: scripts/portable.sh DIR" >&2; exit 2; }
fail() { echo "portable: $1" >&2; exit 1; }
[ $# = 1 ] || usage
out=$1
root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"

MOST_KIB=$((45 * 1000 * 1000 / 1024))
NEWEST_GLIBC=2.35

for tool in objdump readelf strip; do
    command -v "$tool" > /dev/null || fail "$tool is missing; install binutils"
done
mkdir -p "$out"
out=$(cd "$out" && pwd)
if [ -n "$(ls -A "$out")" ] && [ ! -f "$out/COMMIT" ]; then
    fail "$out holds other files; name a new folder, or an older portable one"
fi

# Rust asks for the shared libgcc_s. A linker script of that name, found first, gives the static libraries instead.
release=${CARGO_TARGET_DIR:-target}/release
mkdir -p "$release/portable"
echo 'INPUT(-l:libgcc_eh.a -l:libgcc.a)' > "$release/portable/libgcc_s.so"
scripts/cargo.sh rustc --release -p hedgerow-lab --bin hedgerow --features peer-obvhs -- -L "native=$(cd "$release/portable" && pwd)"
rm -rf "$out/scenes"
mkdir -p "$out/scenes"
strip -o "$out/hedgerow" "$release/hedgerow"

# What the program needs of the machine: the C library alone, and none newer than that of Ubuntu 22.04.
readelf -d "$out/hedgerow" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | while read -r library; do
    case $library in
        libc.so.6 | libm.so.6 | libdl.so.2 | libpthread.so.0 | librt.so.1 | ld-linux-*) ;;
        *) fail "the program needs $library, which the other machine may lack" ;;
    esac
done
newest=$(objdump -T "$out/hedgerow" | grep -oE 'GLIBC_[0-9.]+' | sed 's/GLIBC_//' | sort -uV | tail -1)
if [ "$(printf '%s\n%s\n' "$newest" "$NEWEST_GLIBC" | sort -V | tail -1)" != "$NEWEST_GLIBC" ]; then
    objdump -T "$out/hedgerow" | grep "GLIBC_$newest" >&2
    fail "the program needs glibc $newest, newer than $NEWEST_GLIBC; build on an older system"
fi

commit=$(git rev-parse --short=10 HEAD 2> /dev/null || echo unknown)
git diff --quiet HEAD 2> /dev/null || commit=$commit+
echo "$commit" > "$out/COMMIT"
cp scripts/portable/run.sh "$out/run.sh"
cp docs/portable.md "$out/README.md"
cp LICENSE-APACHE LICENSE-MIT "$out"
chmod 755 "$out/run.sh" "$out/hedgerow"
for file in scenes/*; do
    case $file in
        *.py) ;;
        *) cp -r "$file" "$out/scenes/" ;;
    esac
done

used() { du -sk --apparent-size "$out" | cut -f1; }
left_out=
if [ -n "${HEDGEROW_SCENES:-}" ]; then
    [ -d "$HEDGEROW_SCENES" ] || fail "HEDGEROW_SCENES names $HEDGEROW_SCENES, which is no folder"
    # Files that need no other beside them, and animations last: bench measures their first frames alone.
    for file in $(ls -Sr "$HEDGEROW_SCENES"); do
        case $file in
            *_parts.*) continue ;;
            *.obj | *.ply | *.glb | *.tri | *.obj.zst | *.ply.zst | *.glb.zst | *.tri.zst) ;;
            *) continue ;;
        esac
        kib=$(($(wc -c < "$HEDGEROW_SCENES/$file") / 1024 + 1))
        if [ $(($(used) + kib)) -le $MOST_KIB ]; then
            cp "$HEDGEROW_SCENES/$file" "$out/scenes/"
        else
            left_out="$left_out $file"
        fi
    done
    [ ! -f "$HEDGEROW_SCENES/README.md" ] || cp "$HEDGEROW_SCENES/README.md" "$out/scenes/README.more.md"
fi
chmod -R u+w "$out/scenes"
[ "$(used)" -le $MOST_KIB ] || fail "$out takes $(used) KiB, more than $MOST_KIB"
echo "$out: $(used) KiB, glibc $newest, commit $commit"
[ -z "$left_out" ] || echo "no room for:$left_out"
