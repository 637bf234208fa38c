# SPDX-License-Identifier: Apache-2.0
"""The libcamera source with an emulated webcam behind libcamera's UVC handler: listed, streamed in two formats, controls
set, unplugged while it streams. SIGHTLINE_VM_SUITE=trixie: the virtual cameras of libcamera 0.4 are listed, too."""
import os
import re
import subprocess
import time

from guest import ENVIRONMENT, PREFIX, ask, check, finish, mount_product, program, say, until

SIZE = "320x180"
WEBCAM = "/dev/v4l/by-id/usb-VM_rig_Fake_UVC_camera_A0-video-index0"
TURNS = 3
VIRTUAL = """"Virtual0":
  supported_formats:
  - width: 320
    height: 180
    frame_rates:
    - 10
  test_pattern: "lines"
  location: "CameraLocationFront"
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
    folder = "/usr/share/libcamera/pipeline/virtual"
    os.makedirs(folder, exist_ok=True)
    with open(folder + "/virtual.yaml", "w", encoding="utf-8") as file:
        file.write(VIRTUAL)
    listing = probe("list")
    check("the virtual camera is listed, with its modes", re.search(r"[Vv]irtual.*[1-9]\d* modes", listing) is not None)


def unplug(camera):
    with open("/tmp/log", "w", encoding="utf-8") as log:
        client = subprocess.Popen([PREFIX + "/bin/capture_probe", "libcamera", "stream", camera, "YUYV", SIZE, "600"],
                                  env=dict(os.environ, **ENVIRONMENT), stdout=log, stderr=subprocess.STDOUT)

    def said(words):
        with open("/tmp/log", encoding="utf-8") as file:
            return words in file.read() or client.poll() is not None

    for turn in range(1, TURNS + 1):
        until(lambda: said(f"streaming: epoch {turn}"), "it streams")
        time.sleep(1)
        ask("unplug usb0")
        until(lambda: not os.path.exists(WEBCAM), "the webcam is gone")
        ask("plug usb0 uvc A0")
    until(lambda: said(f"streaming: epoch {TURNS + 1}"), "it streams again")
    running = client.poll() is None
    files = len(os.listdir(f"/proc/{client.pid}/fd")) if running else 0
    client.kill()
    client.wait(timeout=60)
    with open("/tmp/log", encoding="utf-8") as file:
        text = file.read()
    say("      " + text.replace("\n", "\n      "))
    check(f"a pulled cable is told, and the camera comes back, {TURNS} times ({files} files)",
          running and text.count("error: probe: ") >= TURNS and files <= 20)


def main():
    mount_product()
    ask("plug usb0 uvc A0")
    until(lambda: os.path.exists(WEBCAM), "the webcam is there")
    listing = probe("list")
    cameras = [name for name in ids(listing) if "1d6b:0102" in name]
    check("the webcam is listed, with its modes", len(cameras) == 1 and re.search(r"[1-9]\d* modes", listing) is not None)
    if not cameras:
        finish()
    for form in ("YUYV", "MJPEG"):
        got = numbers(probe("stream", cameras[0], form, SIZE, "10", "Brightness=0.25", "Contrast=1.2"))
        check(f"{form} streams, with controls", got["good"] >= 3 and got["openings"] == 1)
    brightness = subprocess.run(["v4l2-ctl", "-d", WEBCAM, "-C", "brightness"], capture_output=True, text=True,
                                check=False).stdout
    say("      " + brightness.strip())
    check("the control has arrived at the driver", "brightness: 88" in brightness)
    unplug(cameras[0])
    if os.environ.get("SIGHTLINE_VM_SUITE") == "trixie":
        virtual()
    finish()


main()
