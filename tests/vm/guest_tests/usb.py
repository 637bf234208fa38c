# SPDX-License-Identifier: Apache-2.0
"""The service with two webcams, one YUYV and one MJPEG: unplugged again and again while they stream, damaged,
stalled, silent, swapped. SIGHTLINE_VM_CYCLES: how often each is unplugged (20)."""
import os
import subprocess
import time

from guest import ENVIRONMENT, PREFIX, Service, ask, check, figures, finish, flat, mount_product, program, say, until

CYCLES = int(os.environ.get("SIGHTLINE_VM_CYCLES", "20"))
WARM_UP = 16  # of each camera: the allocator's last step comes after some 20 reopenings, then the memory stays
FORMATS = ('format = "YUYV"', 'format = "MJPEG"')
PORTS = {"plain": ("usb0", "A0"), "jpeg": ("usb1", "B0")}
LIMIT_KB = 3072


def plug(name):
    port, serial = PORTS[name]
    ask(f"plug {port} uvc {serial}")


def cycle(service, name, times):
    other = "jpeg" if name == "plain" else "plain"
    frames = service.camera(other)["frames"]
    ask("unplug " + PORTS[name][0])
    times["told"].append(service.goes(name))
    plug(name)
    times["back"].append(service.comes(name))
    return service.camera(other)["frames"] > frames


def cycles(service):
    say(f"== {CYCLES} times unplugged, each of the two, with a viewer")
    viewer = subprocess.Popen([PREFIX + "/bin/gst-launch-1.0", "-q", "rtspsrc", "location=rtsp://127.0.0.1:8554/plain",
                               "protocols=tcp", "!", "rtph264depay", "!", "h264parse", "!", "fakesink"],
                              env=dict(os.environ, **ENVIRONMENT, HOME="/root"))
    until(lambda: service.metric("sightline_images_encoded_total", camera="plain") > 3, "the viewer gets images")
    times = {"told": [], "back": []}
    for name in ("plain", "jpeg") * WARM_UP:
        cycle(service, name, times)
    opened = service.metric("sightline_source_opened_total")
    gone = service.metric("sightline_source_lost_total", cause="gone")
    encoded = service.metric("sightline_images_encoded_total", camera="plain")
    before = service.usage()
    usages = [before]
    say(f"      after {2 * WARM_UP} cycles: {before}")
    times = {"told": [], "back": []}
    others = 0
    for i in range(CYCLES):
        for name in ("plain", "jpeg"):
            others += cycle(service, name, times)
        if (i + 1) % 5 == 0:
            usages.append(service.usage())
            say(f"      after {2 * (i + 1)} more: {usages[-1]}")
    for word, values in times.items():
        figures(word, values)
    after = service.usage()
    usages.append(after)
    say(f"      at the end: {after}")
    check("not restarted", service.same_process())
    check("file descriptors and threads flat", after[:2] == before[:2])
    check("memory flat", flat(usages, LIMIT_KB))
    check("every one reopened once", service.metric("sightline_source_opened_total") - opened == 2 * CYCLES)
    check("every one counted as gone", service.metric("sightline_source_lost_total", cause="gone") - gone == 2 * CYCLES)
    check("the other camera went on, each time", others == 2 * CYCLES)
    check("the viewer is still there, its stream went on",
          viewer.poll() is None and service.metric("sightline_viewers", camera="plain") == 1 and
          service.metric("sightline_images_encoded_total", camera="plain") > encoded + CYCLES)
    viewer.terminate()
    viewer.wait(timeout=60)


def event(service, camera, cause):
    return service.metric("sightline_capture_events_total", camera=camera, cause=cause)


def damage(service):
    say("== damaged images")
    for command, camera, cause in (("cut 5", "jpeg", "damaged"), ("garbage 5", "jpeg", "damaged"),
                                   ("cut 5", "plain", "lost"), ("error 5", "jpeg", "lost")):
        time.sleep(1.5)  # the counters are published once a second
        before, opened = event(service, camera, cause), service.metric("sightline_source_opened_total", camera=camera)
        ask(f"say {PORTS[camera][0]} {command}")
        until(lambda: event(service, camera, cause) >= before + 4, f"{command} is counted as {cause}")
        service.comes(camera)
        check(f"{command} of {camera}: {event(service, camera, cause) - before:.0f} counted as {cause}, not reopened",
              service.metric("sightline_source_opened_total", camera=camera) == opened)


def stall(service):
    say("== stalled endpoint, silence")
    for camera in PORTS:
        before = event(service, camera, "damaged") + service.metric("sightline_source_lost_total", camera=camera)
        ask(f"say {PORTS[camera][0]} stall")
        until(lambda: event(service, camera, "damaged") + service.metric("sightline_source_lost_total", camera=camera) >
              before, "the stall is counted")
        service.comes(camera)
        check(f"{camera} survives a stalled endpoint", service.same_process())
        silent = service.metric("sightline_source_lost_total", camera=camera, cause="silent")
        ask(f"say {PORTS[camera][0]} freeze")
        told = service.goes(camera, "stalled")
        check(f"{camera}: silence is told ({told:.2f} s) and counted as silent",
              service.metric("sightline_source_lost_total", camera=camera, cause="silent") > silent)
        service.comes(camera)
        check(f"{camera}: comes back after silence", service.same_process())


def swap(service):
    say("== swapped")
    frames = {name: service.camera(name)["frames"] for name in PORTS}
    for name in PORTS:
        ask("unplug " + PORTS[name][0])
    for name in PORTS:
        service.goes(name)
    frames = {name: service.camera(name)["frames"] for name in PORTS}
    ask("plug usb0 uvc B0")
    ask("plug usb1 uvc A0")
    for name in PORTS:
        service.goes(name, "identity mismatch")
        until(lambda: service.metric("sightline_source_lost_total", camera=name, cause="mismatch") >= 2, "it is counted")
    say("      " + service.camera("plain")["problem"])
    time.sleep(3)
    check("no frame of a swapped camera is taken",
          frames == {name: service.camera(name)["frames"] for name in PORTS})
    ask("unplug usb0")
    ask("unplug usb1")
    for name in PORTS:
        service.goes(name, "no camera")
    for name in PORTS:
        plug(name)
    for name in PORTS:
        service.comes(name)
    check("put back, both come back", service.same_process())


def first_installation(service):
    say("== sightline init")
    done = program("sightline", "init", "--out", "/tmp/init.toml")
    say(done.stdout + done.stderr)
    with open("/tmp/init.toml", encoding="utf-8") as file:
        text = file.read()
    check("both webcams are in it, once each", text.count("[[camera]]") == 2 and text.count('source = "v4l2:') == 2)
    check("in formats that they offer", len([line for line in text.splitlines() if line in FORMATS]) == 2)
    check("it is accepted", program("sightline", "check", "/tmp/init.toml").returncode == 0)
    for name in PORTS:
        service.comes(name)


def main():
    mount_product()
    service = Service({
        "plain": 'source = "v4l2:usb:1-1,serial:A0"\nformat = "YUYV"\nrate = 10\n[camera.controls]\nbrightness = 12',
        "jpeg": 'source = "v4l2:usb:1-2,serial:B0"\nformat = "MJPEG"\nrate = 10',
    }, 320, 180)
    start = time.monotonic()
    service.start()
    say(f"started in {time.monotonic() - start:.1f} s")
    service.goes("plain", "no camera")
    check("starts without cameras, and says so", service.same_process())
    for name in PORTS:
        plug(name)
    for name in PORTS:
        service.comes(name)
    check("two webcams at once, at their rate", all(8 < service.camera(name)["rate_hz"] < 12 for name in PORTS) or
          until(lambda: all(8 < service.camera(name)["rate_hz"] < 12 for name in PORTS), "the rate settles") > 0)
    first_installation(service)
    damage(service)
    stall(service)
    swap(service)
    cycles(service)
    check("the service stops in order", subprocess.run(["systemctl", "stop", "sightlined"], check=False).returncode == 0 and
          service.show("Result") == "success")
    finish()


main()
