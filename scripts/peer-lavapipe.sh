#!/usr/bin/env bash
# Unpacks lavapipe of Mesa 26 into a folder, without touching the system: scripts/peer-lavapipe.sh DIR
#
# Mesa 26 is the first whose acceleration structures on the CPU are sorted, and so the first that is a peer. It comes from
# Debian's trixie-backports with the C library it was built for (60 MB); scripts/with-lavapipe.sh starts programs on it.
# The mirror is that of the machine's own sources, or the one that HEDGEROW_DEBIAN_MIRROR names.
# Does nothing when the folder holds it already. Needs apt-get and dpkg, x86-64, no root.
set -euo pipefail
[ $# = 1 ] || { echo "usage: scripts/peer-lavapipe.sh DIR" >&2; exit 2; }
mkdir -p "$1"
dir=$(cd "$1" && pwd)
[ ! -e "$dir/lvp.json" ] || exit 0
say() { echo "peer-lavapipe: $1" >&2; exit 1; }
command -v apt-get >/dev/null && command -v dpkg >/dev/null || say "needs apt-get and dpkg; on another system run under any driver with VK_KHR_ray_query"
[ "$(uname -m)" = x86_64 ] || say "only x86-64; on another machine run under any driver with VK_KHR_ray_query"
key=/usr/share/keyrings/debian-archive-keyring.gpg
[ -e $key ] || say "$key is missing: install debian-archive-keyring"

# An apt of its own: own sources, own lists, an empty package database (so that every dependency comes along).
work=$dir/.apt
rm -rf "$work"
mkdir -p "$work"/{state/lists/partial,cache/archives/partial,etc/preferences.d,etc/trusted.gpg.d,etc/sources.list.d,etc/apt.conf.d}
: >"$work/empty.conf"
: >"$work/state/status"
mirror=${HEDGEROW_DEBIAN_MIRROR:-}
[ -n "$mirror" ] || mirror=$(
  . /etc/os-release
  [ "${ID:-}" = debian ] && apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
    awk -v release="$VERSION_CODENAME" '$2 == release && $3 == "main" { print $1; exit }'
) || true
[ -n "$mirror" ] || say "this machine's sources name no mirror of Debian: set HEDGEROW_DEBIAN_MIRROR to the address of one"
printf "deb [signed-by=$key] %s %s main\n" "$mirror" trixie "$mirror" trixie-backports >"$work/etc/sources.list"
export APT_CONFIG=$work/empty.conf
apt() {
  apt-get -q -o Dir::State="$work/state" -o Dir::Cache="$work/cache" -o Dir::Etc="$work/etc" \
    -o Dir::Etc::main="$work/empty.conf" -o Dir::State::status="$work/state/status" -o APT::Architecture=amd64 \
    -o APT::Install-Recommends=false -o Acquire::Languages=none -o APT::Sandbox::User="$(id -un)" "$@" >&2
}
apt update || say "cannot read trixie-backports from $mirror"
apt -y --download-only -t trixie-backports install base-files mesa-vulkan-drivers libvulkan1 || say "cannot download Mesa"
# base-files first: it carries the /lib -> usr/lib links.
for package in "$work"/cache/archives/base-files_*.deb "$work"/cache/archives/*.deb; do dpkg -x "$package" "$dir"; done
rm -rf "$work"
# Written last: it says that the folder is complete.
library=$dir/usr/lib/x86_64-linux-gnu/libvulkan_lvp.so
sed "s#\"library_path\": \".*\"#\"library_path\": \"$library\"#" "$dir"/usr/share/vulkan/icd.d/lvp_icd*.json >"$dir/.lvp.json"
mv "$dir/.lvp.json" "$dir/lvp.json"
