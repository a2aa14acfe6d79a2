#!/usr/bin/env bash
# cargo, with shaderc's library and what it compiled kept between clones: scripts/cargo.sh ARGUMENTS…
#
# shaderc is built from its sources (minutes), for the systems' own are often broken or absent. The library that comes
# out is kept in ${HEDGEROW_CACHE:-~/.cache/hedgerow}, one for each version of shaderc-sys and host, and found there next
# time, and beside it the SPIR-V that it made (build/kept.rs). An empty folder makes shaderc-sys build from source, so that
# a system's copy is never taken unasked; whoever wants another sets SHADERC_LIB_DIR.
set -euo pipefail
[ -z "${SHADERC_LIB_DIR:-}" ] || exec cargo "$@"

root=$(cd "$(dirname "$0")/.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
version=$(awk '/^name = "shaderc-sys"$/ { found = 1 } found && /^version/ { gsub(/"/, "", $3); print $3; exit }' "$root/Cargo.lock")
host=$(rustc -vV | awk '/^host:/ { print $2 }')
SHADERC_LIB_DIR=${HEDGEROW_CACHE:-$HOME/.cache/hedgerow}/shaderc-$version-$host
export SHADERC_LIB_DIR HEDGEROW_SPIRV=$SHADERC_LIB_DIR/spirv
library=libshaderc_combined.a
if ! mkdir -p "$SHADERC_LIB_DIR" 2>/dev/null; then
  echo "cargo.sh: $SHADERC_LIB_DIR cannot be made, shaderc is not kept; set HEDGEROW_CACHE to a folder you may write" >&2
  exec env -u SHADERC_LIB_DIR -u HEDGEROW_SPIRV cargo "$@"
fi

built() { ls -t "$target"/*/build/shaderc-sys-*/out/lib/$library 2>/dev/null | head -n 1; }
if [ ! -e "$SHADERC_LIB_DIR/$library" ] && [ -z "$(built)" ] && [ -d "$target" ]; then
  # A target folder that outlived the cache still points to the library there.
  for profile in release ci; do cargo clean --quiet --profile "$profile" -p shaderc-sys 2>/dev/null || true; done
fi
status=0
cargo "$@" || status=$?
if [ ! -e "$SHADERC_LIB_DIR/$library" ] && [ -n "$(built)" ]; then
  cp "$(built)" "$SHADERC_LIB_DIR/.$$" && mv "$SHADERC_LIB_DIR/.$$" "$SHADERC_LIB_DIR/$library"
fi
exit $status
