#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""One rig on two, four and eight hosts, each a network namespace of its own with a link to a bridge (needs root):
`namespaces.py [--hosts 2 4 8] [--seconds S]` prints for each the error against the truth, the age of the poses when a client of
the broker has them, and what was dropped; for the last also how soon a host whose link was down takes part again. Every host
has one camera: copies of the recording's three, by turns. The host that keeps the estimates has none and is counted besides."""
import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from split import BENCH, Recording, Split  # noqa: E402

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tests", "system", "cell"))
from cell_support import BIN, MOSQUITTO, WAIT_S  # noqa: E402

BROKER = "10.17.0.1"
FUSION = "f"


def ip(*words):
    subprocess.run(["ip", *words], check=True, timeout=WAIT_S, capture_output=True)


def copies(folder, count):
    """The recording with so many cameras, c0, c1, ...: copies of its own."""
    os.mkdir(folder)
    for name in ("objects", "truth.csv", "scene.obj"):
        os.symlink(os.path.join(BENCH, name), os.path.join(folder, name))
    recorded = [re.search(r'name = "(.*)"', part).group(1) for part in read(BENCH, "recording.toml").split("[[camera]]")[1:]]
    head, *places = read(BENCH, "calibration.toml").split("[[camera]]")
    rows = read(BENCH, "frames.csv").splitlines()
    manifest, calibration, frames = 'format = 1\nname = "copies"\nobjects = ["objects/carton.toml"]\n', head, rows[0] + "\n"
    for i in range(count):
        name = recorded[i % len(recorded)]
        os.symlink(os.path.join(BENCH, name + ".mkv"), os.path.join(folder, f"c{i}.mkv"))
        manifest += f'[[camera]]\nname = "c{i}"\nfile = "c{i}.mkv"\ncodec = "h264"\nwidth = 640\nheight = 480\n'
        place = next(place for place in places if f'"{name}"' in place)
        calibration += "[[camera]]" + place.replace(f'"{name}"', f'"c{i}"')
        frames += "".join(f"c{i}" + row[len(name):] + "\n" for row in rows[1:] if row.startswith(name + ","))
    for name, text in (("recording.toml", manifest), ("calibration.toml", calibration), ("frames.csv", frames)):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(text)
    return folder


def read(*path):
    with open(os.path.join(*path), encoding="utf-8") as file:
        return file.read()


class Namespaces(Split):
    def setUp(self):
        super().setUp()
        self.port, self.count = 1883, 0
        ip("link", "add", "rig", "type", "bridge")
        ip("link", "set", "rig", "up")
        self.addCleanup(ip, "link", "del", "rig")
        self.place(FUSION)

    def place(self, name):
        """A namespace with an address; the first one has the broker's."""
        self.count += 1
        ip("netns", "add", name)
        self.addCleanup(ip, "netns", "del", name)
        ip("link", "add", "to_" + name, "type", "veth", "peer", "name", "eth0", "netns", name)
        ip("link", "set", "to_" + name, "master", "rig", "up")
        for device in ("lo", "eth0"):
            ip("-n", name, "link", "set", device, "up")
        ip("-n", name, "addr", "add", f"10.17.0.{self.count}/24", "dev", "eth0")

    def spawn(self, place, *command):
        environment = dict(os.environ, PATH=self.tools + ":" + os.environ["PATH"])
        process = subprocess.Popen(["ip", "netns", "exec", place, *command], env=environment, stdout=subprocess.DEVNULL,
                                   stderr=open(self.path(place + ".log"), "ab"))

        def end():
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(timeout=WAIT_S)
            except subprocess.TimeoutExpired:
                process.kill()
        self.addCleanup(end)
        return process

    def broker(self, extra=""):
        config = self.write("mosquitto.conf", f"user root\nset_tcp_nodelay true\nlistener {self.port} {BROKER}\n"
                                              f"allow_anonymous true\n{extra}")
        self.spawn(FUSION, MOSQUITTO, "-c", config)

    def host(self, name, role="cameras", **options):
        folder = self.path("host_" + name)
        os.mkdir(folder)
        with open(os.path.join(folder, "sightline.toml"), "w", encoding="utf-8") as file:
            file.write(self.text(name, role, **options).replace('"127.0.0.1"', f'"{BROKER}"'))
        return self.spawn(name, os.path.join(BIN, "sightlined"), "--config", file.name)

    def listen(self, topic, seconds):
        done = subprocess.run(["ip", "netns", "exec", FUSION, "mosquitto_sub", "-h", BROKER, "-t", topic, "-R", "-W",
                               str(int(seconds)), "-F", "%U %p"], capture_output=True, text=True, check=False)
        for line in done.stdout.splitlines():
            stamp, text = line.split(" ", 1)
            yield float(stamp), json.loads(text)

    def next_message(self, topic):
        """Seconds until one comes."""
        begin = time.monotonic()
        subprocess.run(["ip", "netns", "exec", FUSION, "mosquitto_sub", "-h", BROKER, "-t", topic, "-R", "-C", "1", "-N", "-W",
                        "60"], capture_output=True, check=True)
        return round(time.monotonic() - begin, 2)

    def status(self):
        done = subprocess.run(["ip", "netns", "exec", FUSION, os.path.join(BIN, "sightline"), "cell", "status", "--config",
                               self.path("host_f/sightline.toml"), "--json"], capture_output=True, check=False)
        return json.loads(done.stdout) if done.returncode in (0, 1) else {"whole": False}

    def run_hosts(self, count, seconds, pull):
        played = Recording(copies(self.path("copies"), count))
        self.play(played)
        self.owners = {camera: f"h{i}" for i, camera in enumerate(played.cameras)}
        self.broker()
        self.host(FUSION, "fusion", extra=f'[publish.mqtt]\nhost = "{BROKER}"\ntopic = "f"\n')
        for host in self.owners.values():
            self.place(host)
            self.host(host)
        end = time.monotonic() + 60
        while not self.status()["whole"]:
            if time.monotonic() > end:
                raise RuntimeError(f"the cell does not come together: {self.status()}")
        row = self.measure(f"f/objects/{played.object}", seconds)
        status = self.status()
        row.update(status["observations"])
        row["per_camera_hz"] = sorted(round(camera["rate_hz"]) for host in status["hosts"] for camera in host["cameras"])
        for cut_s in (2, 15) if pull else ():
            ip("-n", "h0", "link", "set", "eth0", "down")
            time.sleep(cut_s)
            ip("-n", "h0", "link", "set", "eth0", "up")
            row[f"back_after_{cut_s}_s_down_s"] = self.next_message(f"site/cell/cam/{played.cameras[0]}/obs/+")
        if pull:
            row["late_at_the_end"] = self.status()["observations"]["late"]
        return row


def main():
    if "SIGHTLINE_NAMESPACES" not in os.environ:  # in namespaces of its own, so that nothing else is touched
        environment = dict(os.environ, SIGHTLINE_NAMESPACES="1")
        os.execvpe("unshare", ["unshare", "-m", "-n", sys.executable, *sys.argv], environment)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--hosts", type=int, nargs="+", default=[2, 4, 8])
    arguments = parser.parse_args()
    subprocess.run(["mount", "-t", "tmpfs", "namespaces", "/run"], check=True)
    for count in arguments.hosts:
        case = Namespaces()
        case.setUp()
        try:
            row = case.run_hosts(count, arguments.seconds, count == arguments.hosts[-1])
            print(json.dumps({"hosts": count, **row, "load": round(os.getloadavg()[0], 1)}), flush=True)
        finally:
            case.doCleanups()


if __name__ == "__main__":
    assert shutil.which("ip"), "needs iproute2"
    main()
