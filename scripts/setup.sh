#!/usr/bin/env bash
# Installs what `make bench` and `make test` need beside Rust, from the distribution's own packages.
#
#   scripts/setup.sh              compiler, cmake, git, python3, Vulkan loader and headers, validation layers, lavapipe
#   scripts/setup.sh --peers      also Embree 3 (for the builders embree-*)
#   scripts/setup.sh --browser    also Chromium (for the test that opens the report in a browser)
#
# HEDGEROW_DEBIAN_MIRROR names a mirror of Debian, where the sources of apt name none.
# Does nothing, and asks no network, when all is there. Installs with apt where it is root or may use sudo; otherwise,
# and on other systems, it says what to install by hand and exits with 1.
#
# Debian 12's own lavapipe (Mesa 22.3) breaks long loops in silence, so Mesa 25 is taken from bookworm-backports. That
# suite is read for this one installation through a sources file of its own: the machine's apt sources, preferences and
# package lists stay as they are, and later upgrades bring nothing else from there.
set -euo pipefail
PATH=$PATH:/usr/sbin:/sbin
mesa_at_least=25

peers=no browser=no
for argument in "$@"; do
  case $argument in
    --peers) peers=yes ;;
    --browser) browser=yes ;;
    *) echo "usage: scripts/setup.sh [--peers] [--browser]" >&2; exit 2 ;;
  esac
done

has() { command -v "$1" >/dev/null 2>&1; }
has_library() {
  if has ldconfig; then ldconfig -p | grep -F "$1" >/dev/null; else ls /usr/lib*/"$1"* /usr/lib/*/"$1"* >/dev/null 2>&1; fi
}
# Where the Vulkan loader looks for its json files: of layers, or of drivers.
vulkan_json() {
  local folder
  for folder in ${XDG_DATA_HOME:-$HOME/.local/share} /usr/local/etc /usr/local/share /etc /usr/share \
    ${VULKAN_SDK:+"$VULKAN_SDK/etc" "$VULKAN_SDK/share"} /opt/homebrew/share /opt/homebrew/etc; do
    ls "$folder/vulkan/$1/"$2 2>/dev/null || true
  done
}
# What the tests of the C ABI compile against: asked of the compiler, as they do (capi/tests/c_program.rs).
has_headers() {
  echo '#include <vulkan/vulkan.h>' |
    ${CC:-cc} ${VULKAN_SDK:+-I"$VULKAN_SDK/include"} -I/opt/homebrew/include -E -x c - >/dev/null 2>&1
}
mesa_version() { dpkg-query -W -f '${Version}' mesa-vulkan-drivers 2>/dev/null || true; }
has_driver() {
  [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && return 0
  [ "$(uname -s)" = Darwin ] && { [ -n "$(vulkan_json icd.d '*.json')" ]; return; }
  [ -n "$(vulkan_json icd.d 'lvp_icd*.json')" ] || return 1
  ! has dpkg-query || [ -z "$(mesa_version)" ] || dpkg --compare-versions "$(mesa_version)" ge $mesa_at_least
}

missing=()
miss() { missing+=("$1"); }
has c++ || has g++ || has clang++ || miss compiler
has cmake || miss cmake
has git || miss git
has python3 || has python || miss python3
if [ "$(uname -s)" = Darwin ]; then
  ls {/usr/local,/opt/homebrew,${VULKAN_SDK:-/usr/local}}/lib/libvulkan*.dylib >/dev/null 2>&1 || miss loader
else
  has_library libvulkan.so.1 || miss loader
fi
[ -n "${VK_LAYER_PATH:-}$(vulkan_json explicit_layer.d 'VkLayer_khronos_validation.json')" ] || miss layers
has_headers || miss headers
has_driver || miss driver
[ $peers = no ] || has_library libembree3.so || miss embree
[ $browser = no ] || has chromium || has chromium-browser || has google-chrome || miss browser

if ! has cargo; then
  echo "setup: Rust is missing; install it from https://rustup.rs" >&2
  exit 1
fi
[ ${#missing[@]} -gt 0 ] || exit 0

by_hand() {
  echo "setup: $1" >&2
  echo "setup: missing: ${missing[*]}. Install by hand:" >&2
  cat >&2 <<'TEXT'
  Debian 12      apt install g++ cmake git python3 libvulkan-dev vulkan-validationlayers
                 add the suite bookworm-backports, component main, to the sources of apt (man sources.list)
                 apt update && apt install -t bookworm-backports mesa-vulkan-drivers
  Debian 13, Ubuntu 24.04 and later
                 apt install g++ cmake git python3 libvulkan-dev vulkan-validationlayers mesa-vulkan-drivers
  Fedora         dnf install gcc-c++ cmake git python3 vulkan-loader-devel vulkan-validation-layers mesa-vulkan-drivers
  Arch           pacman -S gcc cmake git python vulkan-headers vulkan-icd-loader vulkan-validation-layers vulkan-swrast
  openSUSE       zypper install gcc-c++ cmake git python3 vulkan-devel vulkan-validationlayers libvulkan_lvp
  macOS          xcode-select --install
                 brew install cmake python vulkan-headers vulkan-loader vulkan-validationlayers molten-vk
  Windows        Visual Studio Build Tools (C++), CMake, Ninja, git, Python; the GPU maker's driver; the Vulkan SDK
  A driver other than lavapipe does as well (set VK_DRIVER_FILES to its json). For the builders embree-*: libembree-dev
  or embree3; for the browser test: chromium. To go on without: make SETUP=true bench
TEXT
  exit 1
}

has apt-get || by_hand "this system has no apt-get"
as_root=()
if [ "$(id -u)" != 0 ]; then
  has sudo || by_hand "not root, and there is no sudo"
  if ! sudo -n true 2>/dev/null; then [ -t 0 ] || by_hand "not root, and sudo asks for a password"; fi
  as_root=(sudo)
fi
export DEBIAN_FRONTEND=noninteractive
apt() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o Dpkg::Use-Pty=0 "$@"; }
install() { apt install -y --no-install-recommends "$@"; }

packages=() driver=no
for what in "${missing[@]}"; do
  case $what in
    compiler) packages+=(g++) ;;
    cmake | git | python3) packages+=("$what") ;;
    loader) packages+=(libvulkan1) ;;
    headers) packages+=(libvulkan-dev) ;;
    layers) packages+=(vulkan-validationlayers) ;;
    driver) driver=yes ;;
    embree) packages+=(libembree-dev) ;;
    browser) packages+=(chromium) ;;
  esac
done
echo "setup: installing what is missing: ${missing[*]}" >&2
apt update || by_hand "apt-get update failed"

# The newest version of lavapipe that the machine's own sources offer, from whichever suite.
offered() { apt-cache madison mesa-vulkan-drivers | awk -F' *[|] *' '{ print $2 }' | sort -V | tail -n 1; }
backports() {
  local work mirror
  mirror=${HEDGEROW_DEBIAN_MIRROR:-}
  [ -n "$mirror" ] || mirror=$(apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
    awk '$2 == "bookworm" && $3 == "main" { print $1; exit }')
  [ -n "$mirror" ] || { echo "setup: no source of apt has bookworm; set HEDGEROW_DEBIAN_MIRROR to a mirror's address" >&2; return 1; }
  work=$(mktemp -d)
  mkdir -p "$work/lists/partial"
  chmod 755 "$work" "$work/lists"
  printf 'deb %s %s main\n' "$mirror" bookworm "$mirror" bookworm-backports >"$work/sources.list"
  local only=(-o "Dir::Etc::sourcelist=$work/sources.list" -o Dir::Etc::sourceparts=- -o "Dir::State::lists=$work/lists"
    -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache=)
  local done=0
  apt "${only[@]}" update && install "${only[@]}" -t bookworm-backports mesa-vulkan-drivers || done=$?
  "${as_root[@]}" rm -rf "$work"
  return $done
}

[ ${#packages[@]} -eq 0 ] || install "${packages[@]}" || by_hand "apt-get could not install ${packages[*]}"
if [ $driver = yes ]; then
  newest=$(offered)
  if [ -n "$newest" ] && dpkg --compare-versions "$newest" ge $mesa_at_least; then
    install "mesa-vulkan-drivers=$newest" || by_hand "apt-get could not install mesa-vulkan-drivers $newest"
  elif (. /etc/os-release && [ "${VERSION_CODENAME:-}" = bookworm ]); then
    backports || by_hand "apt-get could not install mesa-vulkan-drivers from bookworm-backports"
  else
    by_hand "this distribution offers lavapipe ${newest:-not at all}, $mesa_at_least or later is needed"
  fi
fi
