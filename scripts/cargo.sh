#!/usr/bin/env bash
# cargo, with shaderc's library and what it compiled kept between clones: scripts/cargo.sh ARGUMENTS…
#
# shaderc is built from its sources (minutes), for the systems' own are often broken or absent. The library is kept in
# ${HEDGEROW_CACHE:-~/.cache/hedgerow}, one for each version of shaderc-sys and host, and beside it the SPIR-V that it made
# (build/kept.rs). shaderc-sys takes the library from there; where it could not be built, the folder is empty, and shaderc-sys
# tries itself. So a system's copy is never taken unasked; whoever wants another sets SHADERC_LIB_DIR.
set -euo pipefail
[ -z "${SHADERC_LIB_DIR:-}" ] || exec cargo "$@"

scripts=$(cd "$(dirname "$0")" && pwd)
version=$(awk '/^name = "shaderc-sys"$/ { found = 1 } found && /^version/ { gsub(/"/, "", $3); print $3; exit }' "$scripts/../Cargo.lock")
host=$(rustc -vV | awk '/^host:/ { print $2 }')
SHADERC_LIB_DIR=${HEDGEROW_CACHE:-$HOME/.cache/hedgerow}/shaderc-$version-$host
if ! mkdir -p "$SHADERC_LIB_DIR" 2>/dev/null; then
  echo "cargo.sh: $SHADERC_LIB_DIR cannot be made, shaderc is not kept; set HEDGEROW_CACHE to a folder you may write" >&2
  exec env -u SHADERC_LIB_DIR cargo "$@"
fi
if [ ! -e "$SHADERC_LIB_DIR/libshaderc_combined.a" ] && ! "$scripts/shaderc.sh" "$SHADERC_LIB_DIR" "$version"; then
  echo "cargo.sh: shaderc could not be built (above); its crate tries, and what comes out is not kept" >&2
fi
export SHADERC_LIB_DIR HEDGEROW_SPIRV=$SHADERC_LIB_DIR/spirv
exec cargo "$@"
