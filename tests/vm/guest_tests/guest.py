# SPDX-License-Identifier: Apache-2.0
"""What the tests in the guest share: the cameras beside it, the service, checks and figures."""
import json
import os
import re
import statistics
import subprocess
import sys
import time
import typing
import urllib.error
import urllib.request

PREFIX = "/opt/sightline"
SHELF = "/vmrig/out/shelf"
WAIT_S = 120  # bound of every wait; emulation on a busy machine is slow
HTTP = 8080
ENVIRONMENT = {
    "LD_LIBRARY_PATH": PREFIX + "/lib",
    "GST_PLUGIN_SYSTEM_PATH_1_0": PREFIX + "/gst",
    "GST_REGISTRY_FORK": "no",
}
failed = []


def say(text):
    print(text, flush=True)


def check(what, condition):
    say(("ok    " if condition else "FAIL  ") + what)
    if not condition:
        failed.append(what)


def finish():
    say("all good" if not failed else f"{len(failed)} failed: " + "; ".join(failed))
    sys.exit(1 if failed else 0)


def until(condition, what, wait=WAIT_S, step=0.05):
    """Seconds until it held. Ends the test if it never does."""
    start = time.monotonic()
    while not condition():
        if time.monotonic() - start > wait:
            say(f"FAIL  timed out waiting until {what}")
            say(subprocess.run(["journalctl", "-u", "sightlined", "-n", "20", "--no-pager", "-o", "cat"], capture_output=True,
                               text=True, check=False).stdout)
            sys.exit(1)
        time.sleep(step)
    return time.monotonic() - start


def ask(line):
    """Tells the shelf beside the guest to do something with a camera, and waits until it is done."""
    name = f"{SHELF}/{time.monotonic_ns()}"
    with open(name + ".part", "w", encoding="utf-8") as file:
        file.write(line)
    os.rename(name + ".part", name + ".ask")
    until(lambda: os.path.exists(name + ".done"), f"the shelf answers to '{line}'", step=0.02)
    with open(name + ".done", encoding="utf-8") as file:
        complaint = file.read()
    if complaint:
        raise RuntimeError(f"{line}: {complaint}")


def mount_product():
    os.makedirs(PREFIX, exist_ok=True)
    subprocess.run(["mount", "-o", "ro", "/dev/vdb", PREFIX], check=True)


def program(*arguments, timeout=WAIT_S):
    return subprocess.run([f"{PREFIX}/bin/{arguments[0]}", *arguments[1:]], capture_output=True, text=True, timeout=timeout,
                          check=False, env=dict(os.environ, **ENVIRONMENT))


def calibration(names, width, height):
    text = ""
    for name in names:
        text += f'[[camera]]\nname = "{name}"\nwidth = {width}\nheight = {height}\nmodel = "brown_conrady"\n'
        text += f"fx = {width}\nfy = {width}\ncx = {width / 2}\ncy = {height / 2}\ndistortion = [0, 0, 0, 0, 0]\n"
        text += "world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    return text


class Usage(typing.NamedTuple):
    files: int
    threads: int
    memory_kb: int

    def __str__(self):
        return f"files {self.files}, threads {self.threads}, memory {self.memory_kb} kB"


def flat(usages, limit_kb):
    """Whether the memory stays: the median slope between any two looks (Theil 1950, Sen 1968), times all of them. A leak
    grows from look to look; an allocator that takes its last arena once does not."""
    slopes = [(b.memory_kb - a.memory_kb) / (j - i) for i, a in enumerate(usages) for j, b in enumerate(usages) if i < j]
    growth = round(statistics.median(slopes) * (len(usages) - 1))
    say(f"      memory: {growth:+d} kB from the first look to the last, by the median slope")
    return growth <= limit_kb


def figures(what, values):
    values = sorted(values)
    say(f"      {what}: median {values[len(values) // 2]:.2f} s, longest {values[-1]:.2f} s")


class Service:
    """sightlined under systemd, by its real unit."""

    def __init__(self, cameras, width, height):
        """`cameras`: the [[camera]] tables, by name."""
        os.makedirs("/etc/sightline", exist_ok=True)
        with open("/etc/sightline/calibration.toml", "w", encoding="utf-8") as file:
            file.write(calibration(cameras, width, height))
        with open("/etc/sightline/sightline.toml", "w", encoding="utf-8") as file:
            file.write('calibration = "calibration.toml"\n' + "".join(
                f'[[camera]]\nname = "{name}"\n{table}\n' for name, table in cameras.items()))
            file.write(f'[[object]]\nfile = "{PREFIX}/objects/carton.toml"\n[http]\nport = {HTTP}\n')
        os.makedirs("/etc/systemd/system/sightlined.service.d", exist_ok=True)
        os.symlink(PREFIX + "/lib/systemd/system/sightlined.service", "/etc/systemd/system/sightlined.service")
        with open("/etc/systemd/system/sightlined.service.d/libraries.conf", "w", encoding="utf-8") as file:
            file.write("[Service]\n" + "".join(f"Environment={key}={value}\n" for key, value in ENVIRONMENT.items()))
            file.write("Environment=GST_REGISTRY_1_0=/var/cache/sightline/registry.bin\n")
            if os.environ.get("SIGHTLINE_VM_WATCHDOG") != "unit":
                file.write("WatchdogSec=600\n")  # on a busy machine the whole guest may stand still for long
        if not os.path.exists("/usr/share/fonts"):
            os.symlink(PREFIX + "/fonts", "/usr/share/fonts")
        for folder in ("lib/udev/rules.d",):
            rules = os.path.join(PREFIX, folder)
            for name in os.listdir(rules) if os.path.isdir(rules) else []:
                os.makedirs("/run/udev/rules.d", exist_ok=True)
                os.symlink(os.path.join(rules, name), "/run/udev/rules.d/" + name)
        subprocess.run(["udevadm", "control", "--reload"], check=True)
        subprocess.run(["systemctl", "daemon-reload"], check=True)

    def start(self):
        done = subprocess.run(["systemctl", "start", "sightlined"], capture_output=True, text=True, check=False)
        if done.returncode:
            say(subprocess.run(["journalctl", "-u", "sightlined", "--no-pager", "-o", "cat"], capture_output=True,
                               text=True, check=False).stdout)
            raise SystemExit("the service does not start: " + done.stderr)
        self.pid = self.show("MainPID")

    @staticmethod
    def show(what):
        return subprocess.run(["systemctl", "show", "-P", what, "sightlined"], capture_output=True, text=True,
                              check=True).stdout.strip()

    @staticmethod
    def get(path):
        for _ in range(3):  # the machine may stand still for seconds
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{HTTP}{path}", timeout=20) as answer:
                    return answer.read().decode()
            except urllib.error.URLError as error:
                last = error
        raise SystemExit(f"the service does not answer: {last}")

    def camera(self, name):
        return next(c for c in json.loads(self.get("/api/state"))["cameras"] if c["name"] == name)

    def metric(self, metric, **labels):
        """Sum over the series that carry these labels; 0 without any."""
        total = 0.0
        for line in self.get("/metrics").split("\n"):
            if line.startswith(metric + "{") and all(f'{key}="{value}"' in line for key, value in labels.items()):
                total += float(line.split()[-1])
        return total

    def same_process(self):
        return self.show("NRestarts") == "0" and self.show("MainPID") == self.pid and self.show("ActiveState") == "active"

    def usage(self):
        """Files, threads and memory in kB; the least of some looks, since our own questions open connections."""
        looks = []
        for _ in range(5):
            with open(f"/proc/{self.pid}/status", encoding="utf-8") as file:
                memory = int(re.search(r"VmRSS:\s+(\d+)", file.read()).group(1))
            looks.append((len(os.listdir(f"/proc/{self.pid}/fd")), len(os.listdir(f"/proc/{self.pid}/task")), memory))
            time.sleep(0.2)
        return Usage(*map(min, zip(*looks)))

    def comes(self, name, wait=WAIT_S):
        """Seconds until fresh frames of it have come."""
        frames = self.camera(name)["frames"]
        return until(lambda: self.camera(name)["present"] and self.camera(name)["frames"] >= frames + 5,
                     f"frames of {name} come", wait)

    def goes(self, name, word=""):
        """Seconds until it is reported without signal, for a reason that holds `word`."""
        return until(lambda: not self.camera(name)["present"] and word in self.camera(name).get("problem", ""),
                     f"{name} is reported gone: {word}")
