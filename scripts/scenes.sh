#!/usr/bin/env bash
# The names of the scenes of a folder, one a line: scripts/scenes.sh DIR
# Parts of an .inst file (NAME_parts.obj) are no scenes of their own.
set -euo pipefail
for scene in "$1"/*; do
  case $scene in
    *_parts.obj | *_parts.obj.zst) ;;
    *.obj | *.tri | *.anim | *.inst | *.ply | *.gltf | *.glb) basename "$scene" ;;
    *.obj.zst | *.tri.zst | *.anim.zst | *.inst.zst | *.ply.zst | *.gltf.zst | *.glb.zst) basename "$scene" ;;
  esac
done
