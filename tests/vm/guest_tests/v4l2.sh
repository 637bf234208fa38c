# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# The V4L2 source against the kernel's own drivers: vivid (every format, injected errors, disconnect) and
# uvcvideo with an emulated webcam (damage, stall, silence, unplug).
set -u
bad=0
check() { # what, condition
  if eval "$2"; then echo "ok    $1"; else echo "FAIL  $1"; bad=1; fi
}
until_true() { for _ in $(seq 150); do eval "$1" && return 0; sleep 0.2; done; return 1; }
mkdir -p /opt/sightline && mount -o ro /dev/vdb /opt/sightline
probe() { LD_LIBRARY_PATH=/opt/sightline/lib timeout 120 /opt/sightline/bin/capture_probe "$@" 2>&1; }
ask() { # the shelf of cameras beside the guest
  local name
  name=/vmrig/out/shelf/$(date +%s%N)
  echo "$*" >"$name.part" && mv "$name.part" "$name.ask"
  until_true "[ -e $name.done ]"
  cat "$name.done"
}
tell() { ask say usb0 "$@"; }
replug() { ask unplug usb0; sleep 1; ask plug usb0 uvc A0; }
said() { grep -Eq "$1" /tmp/log; }
count() { grep -oE "$1=[0-9]+" /tmp/log | tail -n 1 | cut -d= -f2; }
shown() { sed 's/^/      /' /tmp/log; }

echo "== vivid"
modprobe vivid n_devs=2 node_types=0x1,0x1; udevadm settle
vivid=
for d in /dev/video*; do
  v4l2-ctl -d "$d" -D 2>/dev/null | grep -q "Driver name *: vivid" && vivid=${vivid:-$d}
done
probe list >/tmp/log; shown
check "vivid is listed with its modes" 'said "vivid.* [0-9][0-9]+ modes"'
v4l2-ctl -d "$vivid" -c test_pattern=0,osd_text_mode=2 >/dev/null 2>&1
probe formats "$vivid" 320x180 >/tmp/log; rc=$?; shown
check "every format gives the right colors" '[ $rc = 0 ]'
for format in YUYV UYVY NV12 YUV420 GREY Y10 Y12 Y16 RGB24 BGR24 \
              {SRGGB,SGRBG,SGBRG,SBGGR}{8,10,12}; do
  said "^ok $format " || check "$format was among them" false
done

stream_with() { # commands to run meanwhile, seconds
  (eval "$1") & local meddler=$!
  probe stream "$vivid" YUYV 320x180 "$2" >/tmp/log; wait "$meddler"; shown
}
stream_with 'sleep 3; v4l2-ctl -d $vivid -c inject_v4l2_buf_flag_error=1' 6
check "a buffer with the error flag is dropped" '[ "$(count damaged)" -ge 1 ] && [ "$(count openings)" = 1 ]'
stream_with 'sleep 3; v4l2-ctl -d $vivid -c percentage_of_dropped_buffers=40; sleep 3; v4l2-ctl -d $vivid -c percentage_of_dropped_buffers=0' 8
check "dropped buffers are seen as gaps" '[ "$(count lost)" -ge 3 ] && [ "$(count openings)" = 1 ]'
stream_with 'sleep 3; v4l2-ctl -d $vivid -c inject_vidioc_dqbuf_error=1 2>/dev/null || v4l2-ctl -d $vivid -c inject_fatal_streaming_error=1' 8
check "a fatal streaming error is told and survived" 'said "error: probe: .*transfer broke down|error: probe: .*driver refuses" && [ "$(count openings)" = 2 ]'
v4l2-ctl -d "$vivid" -c inject_vidioc_streamon_error=1
stream_with true 4
check "streaming that does not start is told and survived" 'said "error: probe: cannot start streaming" && [ "$(count good)" -ge 5 ]'
v4l2-ctl -d "$vivid" -c inject_vidioc_reqbufs_error=1
stream_with true 4
check "refused buffers are told and survived" 'said "error: probe: cannot get buffers" && [ "$(count good)" -ge 5 ]'
stream_with 'sleep 3; v4l2-ctl -d $vivid -c inject_vidioc_qbuf_error=1' 6
check "a buffer that is not taken back is offered again" '! said error && [ "$(count good)" -ge 15 ] && [ "$(count openings)" = 1 ]'
stream_with 'sleep 3; v4l2-ctl -d $vivid -c disconnect=1' 9
check "a disconnected camera is told and comes back" 'said "the camera is gone" && [ "$(count openings)" -ge 2 ]'
v4l2-ctl -d "$vivid" -c wrap_timestamp=1 >/dev/null 2>&1
stream_with true 4
check "wrapped time stamps are replaced" '[ "$(count rejected)" -ge 10 ]'
v4l2-ctl -d "$vivid" -c wrap_timestamp=0 >/dev/null 2>&1
stream_with 'sleep 1; probe stream $vivid YUYV 320x180 2 >/tmp/second' 5
check "a second reader is told that the camera is busy" 'grep -q "another program is using" /tmp/second'

echo "== uvcvideo"
uvc=/dev/v4l/by-id/usb-VM_rig_Fake_UVC_camera_A0-video-index0
ask plug usb0 uvc A0
check "the webcam appears" 'until_true "[ -e $uvc ]"'
uvc_with() { # commands to run meanwhile, format, seconds
  (eval "$1") & local meddler=$!
  probe stream serial:A0 "$2" 320x180 "$3" >/tmp/log; wait "$meddler"; shown
}
probe pattern uvc serial:A0 320x180 5 >/tmp/log; shown
check "YUYV: every byte as it was sent" '[ "$(count good)" -ge 40 ] && [ "$(count torn)" = 0 ]'
uvc_with 'sleep 3; tell cut 3; sleep 1; tell garbage 3' MJPEG 8
check "MJPEG: cut and overwritten frames are dropped, never fatal" '[ "$(count damaged)" -ge 4 ] && [ "$(count good)" -ge 40 ] && [ "$(count openings)" = 1 ]'
uvc_with 'sleep 3; tell stall' YUYV 9
check "a stalled endpoint is survived" 'said "end: good=[0-9]{2,}"'
uvc_with 'sleep 3; tell freeze; sleep 3; tell thaw' YUYV 10
check "silence is told and survived" 'said "the camera has stalled" && [ "$(count openings)" -ge 2 ]'
uvc_with 'sleep 3; replug' YUYV 12
check "a pulled cable is told, and the camera comes back" 'said "the camera is gone" && [ "$(count openings)" -ge 2 ] && said "streaming: epoch 2"'
check "all files are closed afterwards" '[ "$(count files)" -le 6 ]'
uvc_with 'for _ in 1 2; do sleep 4; replug; done' MJPEG 25
check "twice more, MJPEG" '[ "$(count openings)" -ge 3 ] && [ "$(count files)" -le 6 ]'
probe stream usb:1-1,serial:B0 YUYV 320x180 1 >/tmp/log; shown
check "another camera at the port is a mismatch" 'said "identity mismatch"'
probe stream "$vivid" YUYV 320x180 5 >/tmp/first &
probe stream serial:A0 YUYV 320x180 5 >/tmp/log; wait $!; shown
check "a webcam and a vivid at once" '[ "$(count good)" -ge 40 ] && grep -q "good=[1-9][0-9]" /tmp/first'
second=/dev/video$(( ${vivid#/dev/video} + 1 ))
probe stream "$vivid" YUYV 320x180 5 >/tmp/first &
probe stream "$second" UYVY 320x180 5 >/tmp/log; wait $!; shown
check "two vivids at once" '[ "$(count good)" -ge 15 ] && grep -q "good=[1-9][0-9]" /tmp/first'
exit $bad
