#!/usr/bin/env bash
# The crate that engines depend on: sources and compiled shaders. Packs it in a staging folder, unpacks it, and builds it with and
# without the shader compiler. The package stays at target/package/hedgerow-VERSION.crate. scripts/package.sh [PROFILE]: that which
# the repository is compiled by, so that nothing is compiled twice.
set -euo pipefail
cd "$(dirname "$0")/.."
MOST_BYTES=5000000
profile=${1:-release}

target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cargo=$(pwd)/scripts/cargo.sh
stage=$target/package/stage
rm -rf "$stage"
mkdir -p "$stage/spirv"
git ls-files -z | xargs -0 cp --parents -t "$stage"
# Where build.rs has put the shaders of these sources.
out=$("$cargo" build --profile "$profile" -p hedgerow --features compile-shaders --message-format json |
  grep -oE '"out_dir":"[^"]*/build/hedgerow-[0-9a-f]+/out"' | tail -n 1 | cut -d '"' -f 4)
# Those of the table: OUT_DIR has that of the example, too.
grep -oE 'include_bytes!\("[^"]+"\)' "$out/shaders.rs" | cut -d '"' -f 2 | xargs cp -t "$stage/spirv"
cp "$out/arguments.rs" "$stage/spirv"

(cd "$stage" && "$cargo" package --quiet --offline -p hedgerow --no-verify --target-dir "$target/package/build")
package=$(ls -t "$target"/package/build/package/hedgerow-*.crate | head -n 1)
cp "$package" "$target/package/"
bytes=$(wc -c < "$package")
printf 'package: %s, %s bytes\n' "$(basename "$package")" "$bytes"
if [ "$bytes" -gt "$MOST_BYTES" ]; then
  echo "package: more than $MOST_BYTES bytes; look at 'include' in Cargo.toml" >&2
  exit 1
fi

unpacked=$target/package/unpacked
rm -rf "$unpacked" "$target/package/built"
mkdir -p "$unpacked"
tar -xzf "$package" -C "$unpacked" --strip-components 1
# Nobody debugs these builds.
export CARGO_PROFILE_DEV_DEBUG=false
# Without the compiler first, while nothing that the compiler needs is there.
build() { (cd "$unpacked" && "$cargo" build --offline --target-dir "$target/package/built" "$@"); }
SECONDS=0
build
printf 'package: built without the compiler in %s s\n' "$SECONDS"
SECONDS=0
build --features compile-shaders
printf 'package: built with the compiler in %s s\n' "$SECONDS"
