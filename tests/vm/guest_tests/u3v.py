# SPDX-License-Identifier: Apache-2.0
"""The service with a USB3 Vision camera, read through Aravis: every byte compared, unplugged again and again while
it streams, damaged, stalled, silent, another one at its name. SIGHTLINE_VM_CYCLES: how often it is unplugged (20)."""
import os
import re
import subprocess

from guest import Service, ask, check, figures, finish, flat, mount_product, program, say, until

CYCLES = int(os.environ.get("SIGHTLINE_VM_CYCLES", "20"))
WARM_UP = 5
LIMIT_KB = 2048
PLUG = "plug usb0 u3v U3V01 -d 200"  # its clock runs 200 ppm fast


def bytes_equal():
    say("== every byte")
    ask(PLUG)
    until(lambda: "1d6b:0103" in subprocess.run(["lsusb"], capture_output=True, text=True, check=False).stdout,
          "the camera is on the bus")
    done = program("capture_probe", "pattern", "u3v", "U3V01", "320x180", "8")
    say(done.stdout + done.stderr)
    good, torn = map(int, re.search(r"good=(\d+) torn=(\d+)", done.stdout).groups())
    check(f"{good} frames as they were sent", good >= 30 and torn == 0)
    listing = program("sightline", "cameras", "--json")
    check("it is listed", "U3V01" in listing.stdout)
    ask("unplug usb0")


def event(service, cause):
    return service.metric("sightline_capture_events_total", camera="cam", cause=cause)


def lost(service, cause):
    return service.metric("sightline_source_lost_total", camera="cam", cause=cause)


def trouble(service):
    say("== damage, stall, silence, another camera")
    for command in ("cut 3", "garbage 3"):
        before = event(service, "incomplete") + event(service, "lost") + lost(service, "silent")
        ask(f"say usb0 {command}")
        until(lambda: event(service, "incomplete") + event(service, "lost") + lost(service, "silent") > before,
              f"{command} is counted")
        service.comes("cam")
        check(f"{command}: dropped and counted", service.same_process())
    ask("say usb0 stall")
    service.comes("cam")
    check("a stalled endpoint is survived", service.same_process())
    silent = lost(service, "silent")
    ask("say usb0 freeze")
    told = service.goes("cam", "no frame")
    check(f"silence is told ({told:.2f} s) and counted as silent", lost(service, "silent") > silent)
    ask("say usb0 thaw")
    service.comes("cam")
    check("it comes back after silence", service.same_process())
    ask("unplug usb0")
    service.goes("cam")
    frames = service.camera("cam")["frames"]
    ask("plug usb0 u3v OTHER")
    service.goes("cam", "no camera with id")
    until(lambda: "OTHER" in service.camera("cam").get("problem", ""), "it names the one that is there")
    check("another camera is not taken for it", service.camera("cam")["frames"] == frames)
    ask("unplug usb0")
    ask(PLUG)
    service.comes("cam")


def cycles(service):
    say(f"== {CYCLES} times unplugged")
    told, back = [], []

    def cycle():
        ask("unplug usb0")
        told.append(service.goes("cam"))
        ask(PLUG)
        back.append(service.comes("cam"))

    for _ in range(WARM_UP):
        cycle()
    opened = service.metric("sightline_source_opened_total")
    before = service.usage()
    usages = [before]
    say(f"      after {WARM_UP} cycles: {before}")
    told.clear()
    back.clear()
    for i in range(CYCLES):
        cycle()
        if (i + 1) % 5 == 0:
            usages.append(service.usage())
            say(f"      after {i + 1} more: {usages[-1]}")
    figures("told", told)
    figures("back", back)
    until(lambda: service.usage()[:2] == before[:2], "files and threads are as before", 20)
    after = service.usage()
    usages.append(after)
    say(f"      at the end: {after}")
    check("not restarted", service.same_process())
    check("file descriptors and threads flat", after[:2] == before[:2])
    check("memory flat", flat(usages, LIMIT_KB))
    check("reopened every time", service.metric("sightline_source_opened_total") - opened >= CYCLES)


def main():
    mount_product()
    service = Service({"cam": 'source = "aravis:U3V01"\nformat = "Mono8"\nrate = 10'}, 320, 180)
    bytes_equal()
    service.start()
    service.goes("cam", "no camera with id")
    check("starts without the camera, and says so", service.same_process())
    ask(PLUG)
    service.comes("cam")
    trouble(service)
    cycles(service)
    check("the service stops in order", subprocess.run(["systemctl", "stop", "sightlined"], check=False).returncode == 0 and
          service.show("Result") == "success")
    finish()


main()
