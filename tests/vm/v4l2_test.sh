#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The V4L2 source against the kernel's own drivers, in a guest: vivid (every format, injected errors,
# disconnect) and uvcvideo with an emulated webcam (damage, stall, silence, unplug).
#   v4l2_test.sh CAPTURE_PROBE
# Exit status 77: skipped, with the reason.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
probe=$1
skip() { echo "skipped: $*"; exit 77; }

[[ ${SIGHTLINE_VM_TESTS:-} == 1 ]] || skip "takes minutes; SIGHTLINE_VM_TESTS=1 runs it"
for tool in qemu-system-x86_64 qemu-img cc ffmpeg; do
  command -v "$tool" >/dev/null || skip "$tool is not installed (Debian: qemu-system-x86 qemu-utils)"
done
# shellcheck source=config.sh
. "$here/config.sh"
if [[ ! -e $(vmrig_image_dir)/complete ]]; then
  ((EUID == 0)) || skip "the guest's image is not there, and building it needs root"
  for tool in debootstrap mke2fs cpio curl; do
    command -v "$tool" >/dev/null || skip "building the guest's image needs $tool"
  done
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/in/lib" "$work/out" "$work/jpg"
cc -std=gnu11 -O2 -o "$work/fake-uvc" "$here/fakecams/fake-uvc.c"
ffmpeg -loglevel error -f lavfi -i testsrc=size=320x180:rate=10 -frames:v 10 -pix_fmt yuvj422p \
  -q:v 5 "$work/jpg/%02d.jpg"
cp "$probe" "$work/in/capture_probe"
cp "$here/v4l2_guest.sh" "$work/in/test"
# What the probe links, but for the C library, which the guest has.
ldd "$probe" | awk '$2 == "=>" {print $3}' | grep -vE '/(libc|libm)\.so' |
  xargs -I{} cp -L {} "$work/in/lib/"

# Beside the guest: a webcam that takes its commands from a file that the guest writes.
cat >"$work/peer" <<G
mkfifo "\$VMRIG_USB/commands"; exec 9<>"\$VMRIG_USB/commands"
while :; do
  $work/fake-uvc -s A0 -j $work/jpg "\$VMRIG_USB/usb0" <&9 & camera=\$!
  while kill -0 \$camera 2>/dev/null; do
    if [ -e "\$VMRIG_OUT/tell" ]; then
      mv "\$VMRIG_OUT/tell" "\$VMRIG_USB/tell"; cat "\$VMRIG_USB/tell" >&9
    fi
    sleep 0.1
  done
  sleep 1
done
G
status=0
"$here/run-in-guest.sh" -t 600 -i "$work/in" -o "$work/out" -p "$work/peer" -- bash /vmrig/in/test ||
  status=$?
if ((status != 0)); then tail -n 30 "$work/out/dmesg.txt" >&2 || true; fi
exit "$status"
