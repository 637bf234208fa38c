#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Builds targets of this tree with Debian 13's compiler and libraries, in a tree of Debian packages that is
# made once and kept in the rig's cache. Programs land in build/trixie/ of this source tree.
#
#   build-trixie.sh [-j jobs] [-t regex] [target...]      default: capture_probe
#       -t  runs the tests of that name there, too: build-trixie.sh -t '_test$' all
#           (those that need real processes are named system_*, and need more than is installed there)
#   build-trixie.sh -l                         prints the tree's directory, without building it
#
# Needs root (debootstrap, chroot) and debootstrap. First run: some minutes, 2 GB of disk.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
source_dir=$(readlink -f "$here/../..")
export VMRIG_SUITE=trixie
# shellcheck source=config.sh
. "$here/config.sh"
jobs=2 only_print='' tests=''
while getopts j:t:l o; do
    case "$o" in j) jobs=$OPTARG ;; t) tests=$OPTARG ;; l) only_print=1 ;; *) exit 2 ;; esac
done
shift $((OPTIND - 1))
[ $# -gt 0 ] || set -- capture_probe

# What building and testing needs, but for the tools that only the repository's own checks use.
packages=$("$source_dir/scripts/deps" --print |
    grep -vxE 'clang|clang-.*|ffmpeg|man-db|aravis-tools|gstreamer1.0-(tools|plugins-ugly|libav)|curl|qemu-.*|debootstrap|e2fsprogs|cpio')
root=$VMRIG_CACHE/chroot-trixie
if [ -n "$only_print" ]; then echo "$root"; exit 0; fi
[ "$(id -u)" = 0 ] || { echo "build-trixie: needs root" >&2; exit 1; }
log() { echo "build-trixie: $*" >&2; }

debs=$VMRIG_CACHE/debs-trixie
mkdir -p "$debs"
exec 9>"$root.lock"; flock 9
run() { "$@" >>"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; exit 1; }; }
if [ ! -e "$root/made" ]; then
    log "installing Debian 13 into $root"
    rm -rf --one-file-system "$root"
    mkdir -p "$root"
    run debootstrap --variant=minbase --cache-dir="$debs" trixie "$root" "$VMRIG_MIRROR"
    touch "$root/made"
fi
if [ "$(cat "$root/packages" 2>/dev/null)" != "$packages" ]; then
    log "installing what scripts/deps names"
    archives=$root/var/cache/apt/archives
    find "$debs" -name '*.deb' -exec cp -ln -t "$archives" {} + 2>/dev/null || true
    # shellcheck disable=SC2086
    # shellcheck disable=SC2016
    run unshare -m env DEBIAN_FRONTEND=noninteractive bash -c 'mount -t proc proc "$0/proc" && chroot "$0" apt-get -q update &&
        chroot "$0" apt-get install -y --no-install-recommends "$@"' "$root" $packages
    find "$archives" -name '*.deb' -exec cp -ln -t "$debs" {} + 2>/dev/null || true
    rm -f "$archives"/*.deb
    echo "$packages" >"$root/packages"
fi
flock -u 9

mkdir -p "$root$source_dir" "$source_dir/build/trixie"
ulimit -c 0
# The same path inside, so that messages and debugging information name the files as they are here.
exec unshare -m bash -c '
    root=$1 source_dir=$2 jobs=$3 tests=$4; shift 4
    mount -t proc proc "$root/proc"
    mount --bind "$source_dir" "$root$source_dir"
    exec chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 \
        /bin/bash -c "cd \"\$1\" && shift && jobs=\$1 && tests=\$2 && shift 2 &&
            cmake -S . -B build/trixie -G Ninja -DCMAKE_BUILD_TYPE=Release >build/trixie.log 2>&1 ||
                { tail -n 30 build/trixie.log >&2; exit 1; }
            cmake --build build/trixie -j \"\$jobs\" --target \"\$@\" || exit
            [ -z \"\$tests\" ] || exec ctest --test-dir build/trixie -j \"\$jobs\" --output-on-failure -R \"\$tests\"" \
                bash "$source_dir" "$jobs" "$tests" "$@"
' bash "$root" "$source_dir" "$jobs" "$tests" "$@"
