# SPDX-License-Identifier: Apache-2.0
"""The libcamera source with an emulated webcam behind libcamera's UVC handler: listed, streamed in two formats, controls
set, unplugged while it streams. SIGHTLINE_VM_SUITE=trixie: the virtual cameras of libcamera 0.4 are listed, too."""
import os
import re
import subprocess
import threading
import time

from guest import PREFIX, ask, check, finish, mount_product, program, say, until

SIZE = "320x180"
VIRTUAL = """"Virtual0":
  supported_formats:
  - width: 320
    height: 180
    frame_rates:
    - 10
  test_pattern: "lines"
  location: "front"
  model: "Rig virtual camera"
"""


def probe(*arguments):
    done = program("capture_probe", "libcamera", *arguments)
    say("      " + done.stdout.replace("\n", "\n      ") + done.stderr)
    return done.stdout


def numbers(text):
    found = dict.fromkeys(("good", "damaged", "openings", "files"), 0)
    return found | {key: int(value) for key, value in re.findall(r"(\w+)=(\d+)", text)}


def ids(listing):
    return [line.split(" | ")[0] for line in listing.split("\n") if " | " in line]


def virtual():
    subprocess.run(["modprobe", "udmabuf"], check=False)
    folder = "/usr/share/libcamera/pipeline/virtual"
    os.makedirs(folder, exist_ok=True)
    with open(folder + "/virtual.yaml", "w", encoding="utf-8") as file:
        file.write(VIRTUAL)
    listing = probe("list")
    check("the virtual camera is listed, with its modes", re.search(r"[Vv]irtual.*[1-9]\d* modes", listing) is not None)


def main():
    mount_product()
    ask("plug usb0 uvc A0")
    until(lambda: os.path.exists("/dev/v4l/by-id/usb-VM_rig_Fake_UVC_camera_A0-video-index0"), "the webcam is there")
    listing = probe("list")
    cameras = [name for name in ids(listing) if "1d6b:0102" in name]
    check("the webcam is listed, with its modes", len(cameras) == 1 and re.search(r"[1-9]\d* modes", listing) is not None)
    if not cameras:
        finish()
    for form in ("YUYV", "MJPEG"):
        got = numbers(probe("stream", cameras[0], form, SIZE, "6", "Brightness=0.25", "Contrast=1.2"))
        check(f"{form} streams, with controls", got["good"] >= 30 and got["openings"] == 1)
    brightness = subprocess.run(["v4l2-ctl", "-d", "/dev/v4l/by-id/usb-VM_rig_Fake_UVC_camera_A0-video-index0", "-C",
                                 "brightness"], capture_output=True, text=True, check=False).stdout
    say("      " + brightness.strip())
    check("the control has arrived at the driver", "brightness: 32" not in brightness and "brightness" in brightness)

    def meddle():
        time.sleep(6)
        ask("unplug usb0")
        time.sleep(1)
        ask("plug usb0 uvc A0")

    meddler = threading.Thread(target=meddle)
    meddler.start()
    text = probe("stream", cameras[0], "YUYV", SIZE, "25")
    meddler.join()
    got = numbers(text)
    check("a pulled cable is told, and the camera comes back", "error: " in text and got["openings"] >= 2 and
          "streaming: epoch 2" in text)
    if os.environ.get("SIGHTLINE_VM_SUITE") == "trixie":
        virtual()
    finish()


main()
