# SPDX-License-Identifier: Apache-2.0
"""What the system tests share: the programs under test, the daemon as a process, and its notifications."""
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest
import urllib.request

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
BIN = os.environ.get("SIGHTLINE_BIN", os.path.join(ROOT, "build", "release", "bin"))
BENCH = os.path.join(ROOT, "recordings", "bench")
WAIT_S = float(os.environ.get("SIGHTLINE_TEST_WAIT_S", "120"))  # bound of every wait; sanitizers are slow


def fixed_port():
    """A port for what has to come back at the same place. Below the range from which the kernel hands out ports, so that
    nothing takes it by chance in between."""
    for port in range(20000 + os.getpid() % 9000, 30000):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
                return port
            except OSError:
                continue
    raise AssertionError("no port is free")


def sightline(*arguments, status=0):
    """Runs the command line program and checks its exit status (None: any); returns (stdout, stderr)."""
    done = subprocess.run([os.path.join(BIN, "sightline"), *map(str, arguments)], capture_output=True, text=True,
                          timeout=4 * WAIT_S, check=False)
    assert status in (None, done.returncode), f"{arguments}: exit {done.returncode}, expected {status}\n{done.stderr}"
    return done.stdout, done.stderr


def read_text(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def wait_until(condition, what):
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("timed out waiting until " + what)


class TemporaryFolder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="sightline_test.")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, name, text):
        path = self.path(name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path


def installation(rtsp=0, http=0, cameras=("left", "right", "side"), styles='["circle", "outline", "label"]', extra=""):
    """An installation file that plays the bundled recording. Ports are chosen by the daemon, which names them in its log,
    so that two tests never race for one."""
    text = f'name = "test"\ncalibration = "{BENCH}/calibration.toml"\n'
    for camera in cameras:
        text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{BENCH}"\n'
    text += f'[[object]]\nfile = "{BENCH}/objects/carton.toml"\n'
    text += f"[overlay]\nstyles = {styles}\n[rtsp]\nport = {rtsp}\n[http]\nport = {http}\n"
    return text + extra


class Daemon:
    """A running sightlined, with its notifications to the service manager and its HTTP interface."""

    def __init__(self, folder, config, watchdog_us=None):
        self.notify_path = os.path.join(folder, "notify.sock")
        if os.path.exists(self.notify_path):
            os.unlink(self.notify_path)
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.notify.bind(self.notify_path)
        self.notify.settimeout(0.05)
        self.words = []
        self.log_path = os.path.join(folder, "daemon.log")
        # What another daemon of the same rig has left (a proposed calibration, rooms, last poses) is not this one's.
        environment = {"XDG_STATE_HOME": os.path.join(folder, "state"), **os.environ, "NOTIFY_SOCKET": self.notify_path}
        if watchdog_us:
            environment["WATCHDOG_USEC"] = str(watchdog_us)
        self.log = open(self.log_path, "w", encoding="utf-8")
        self.process = subprocess.Popen([os.path.join(BIN, "sightlined"), "--config", config], stderr=self.log,
                                        env=environment)

    @property
    def rtsp(self):
        return self.port(r"rtsp://127\.0\.0\.1:(\d+)/\S+")

    @property
    def http(self):
        return self.port(r"http://127\.0\.0\.1:(\d+)/metrics")

    def port(self, address):
        """The port of the newest such address in the log; it is written when the daemon is ready."""
        line = re.compile(rf"\binfo\s+{address}$", re.MULTILINE)  # and nothing else in it: addresses of cameras are elsewhere
        wait_until(lambda: self.process.poll() is not None or line.search(self.log_text()), "it names its addresses")
        found = line.findall(self.log_text())
        assert found, f"the daemon ended: {self.log_text()}"
        return int(found[-1])

    def read_notifications(self):
        while True:
            try:
                self.words += self.notify.recv(4096).decode().split("\n")
            except (socket.timeout, BlockingIOError):
                return self.words

    def wait_for_word(self, prefix, count=1):
        wait_until(lambda: self.process.poll() is not None or
                   sum(w.startswith(prefix) for w in self.read_notifications()) >= count, f"it says {prefix}")
        assert self.process.poll() is None, f"the daemon ended: {self.log_text()}"

    def log_text(self):
        return read_text(self.log_path)

    def get(self, path):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.http}{path}", timeout=WAIT_S) as answer:
            return answer.read().decode()

    def state(self):
        return json.loads(self.get("/api/state"))

    def find_metric(self, name, **labels):
        """None where there is no such metric."""
        wanted = name + ("{" + ",".join(f'{k}="{v}"' for k, v in sorted(labels.items())) + "}" if labels else "")
        for line in self.get("/metrics").split("\n"):
            if line.startswith(wanted + " "):
                return float(line.split()[-1])
        return None

    def metric(self, name, **labels):
        value = self.find_metric(name, **labels)
        assert value is not None, f"no metric {name} {labels}"
        return value

    def pull(self, camera, frames=20):
        """An ffmpeg client of one stream, not waited for."""
        return subprocess.Popen(["ffmpeg", "-nostdin", "-loglevel", "error", "-rtsp_transport", "tcp", "-i",
                                 f"rtsp://127.0.0.1:{self.rtsp}/{camera}", "-frames:v", str(frames), "-f", "null", "-"])

    def stop(self):
        """SIGTERM; the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        # As a service manager does: a full socket would hold the daemon up.
        wait_until(lambda: self.read_notifications() is not None and self.process.poll() is not None, "it ends")
        return self.process.returncode

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(timeout=WAIT_S)
        self.notify.close()
        self.log.close()


class DaemonCase(TemporaryFolder):
    """Runs daemons and reloads them."""

    def start(self, text=None, **options):
        self.config = self.write("sightline.toml", text or installation())
        daemon = Daemon(self.folder, self.config, **options)
        self.addCleanup(daemon.close)
        daemon.wait_for_word("READY=1")
        return daemon

    def reload(self, daemon, text):
        """Reloads with this text; true if it is in force then."""
        self.write("sightline.toml", text)
        before = sum(w == "READY=1" for w in daemon.read_notifications())
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_word("READY=1", count=before + 1)
        return "refused" not in daemon.state()["config"]
