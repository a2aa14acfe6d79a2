#!/usr/bin/env bash
# Runs a command on the lavapipe that scripts/peer-lavapipe.sh unpacked: scripts/with-lavapipe.sh DIR COMMAND…
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: scripts/with-lavapipe.sh DIR COMMAND…" >&2; exit 2; }
dir=$(cd "$1" && pwd)
shift
[ -e "$dir/lvp.json" ] || { echo "with-lavapipe: $dir holds no lavapipe; run scripts/peer-lavapipe.sh $dir" >&2; exit 1; }
export VK_DRIVER_FILES=$dir/lvp.json VK_ICD_FILENAMES=$dir/lvp.json
command=$(command -v "$1") || { echo "with-lavapipe: $1: not found" >&2; exit 1; }
shift
# It was built for a newer C library than the system may have: start the command by that library's own loader.
library=$dir/usr/lib/x86_64-linux-gnu
exec "$library/ld-linux-x86-64.so.2" --library-path "$library" "$command" "$@"
