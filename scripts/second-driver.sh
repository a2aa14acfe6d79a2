#!/usr/bin/env bash
# Unpacks SwiftShader into a folder, without touching the system: scripts/second-driver.sh DIR
#
# SwiftShader is a second Vulkan driver on the CPU (1.3, subgroups of 4, no ray tracing), of another compiler than
# lavapipe's: what runs on both does not run by luck. Debian ships its library and ICD file with Chromium (chromium-common,
# 30 MB). Programs run on it with VK_DRIVER_FILES=DIR/swiftshader.json (and VK_ICD_FILENAMES, for older loaders); nothing
# beside it is needed. Does nothing when the folder holds it already. Needs apt-get and dpkg, x86-64 or arm64, no root.
set -euo pipefail
[ $# = 1 ] || { echo "usage: scripts/second-driver.sh DIR" >&2; exit 2; }
mkdir -p "$1"
dir=$(cd "$1" && pwd)
[ ! -e "$dir/swiftshader.json" ] || exit 0
say() { echo "second-driver: $1" >&2; exit 1; }
command -v apt-get >/dev/null && command -v dpkg >/dev/null ||
  say "needs apt-get and dpkg; on another system name any second driver's json in HEDGEROW_SECOND_DRIVER"

# The machine's own sources, with lists of our own: an old list names packages that the mirror has replaced since.
work=$dir/.apt
rm -rf "$work"
mkdir -p "$work/lists/partial"
apt() {
  apt-get -q -o Dir::State::lists="$work/lists" -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= \
    -o Acquire::Languages=none -o APT::Sandbox::User="$(id -un)" "$@" >&2
}
apt update || say "apt-get update failed"
(cd "$work" && apt download chromium-common) ||
  say "cannot download chromium-common: the sources of apt have no such package (Ubuntu's Chromium is a snap), or the mirror is out of reach"
mkdir "$work/tree"
dpkg -x "$work"/chromium-common_*.deb "$work/tree"
found() { find "$work/tree" -name "$1" -print -quit; }
library=$(found libvk_swiftshader.so)
manifest=$(found vk_swiftshader_icd.json)
[ -n "$library" ] && [ -n "$manifest" ] || say "chromium-common holds no libvk_swiftshader.so, or no ICD file of it"
mv "$library" "$dir/libvk_swiftshader.so"
# Written last: it says that the folder is complete.
sed "s#\"library_path\": *\"[^\"]*\"#\"library_path\": \"$dir/libvk_swiftshader.so\"#" "$manifest" >"$dir/.swiftshader.json"
rm -rf "$work"
mv "$dir/.swiftshader.json" "$dir/swiftshader.json"
