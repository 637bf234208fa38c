# SPDX-License-Identifier: Apache-2.0
"""The processes of a soak: the daemon with eight cameras, the process behind two of them, a broker, viewers."""
import http.client
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import threading
import time
import urllib.request

import disk
import viewer
from plan import CAMERAS, MORTAL
from support import BENCH, Daemon, fixed_port, installation, read_text

MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
RECORDED = ("left", "right", "side")
STYLES = ('["circle", "outline", "label"]', '["box3d", "axes", "label"]', '["fill", "trail", "label"]')
KINDS = ("source", "viewing", "poses")
NAMES = [f"cam{i}" for i in range(CAMERAS)]
ENDLESS = ("/api/v1/events?state=1", "/cameras/cam0/stream.mjpeg", "/cameras/cam6/stream.mjpeg")


def tables(calibration, name, wanted):
    """The [[camera]] table of one camera of the recording, under another name."""
    table = next(part for part in calibration.split("[[camera]]")[1:] if f'name = "{wanted}"' in part)
    return "\n[[camera]]" + table.replace(f'name = "{wanted}"', f'name = "{name}"')


class Rig:
    def __init__(self, folder, slow_disk):
        self.folder, self.viewers, self.source, self.broker = folder, [], None, None
        self.reloads = 0
        self.disk = disk.Disk(os.path.abspath(slow_disk), folder) if slow_disk else None
        self.source_port = fixed_port()
        self.start_source()
        self.source.wait_for_word("READY=1")
        self.broker_port = fixed_port()
        self.start_broker()
        self.daemon = self.start_daemon()
        self.daemon.wait_for_word("READY=1")
        self.rtsp, self.http = self.daemon.rtsp, self.daemon.http

    def start_daemon(self):
        added = self.disk.environment() if self.disk else {}
        os.environ.update(added)
        try:
            return Daemon(self.folder, self.write(), watchdog_us=10_000_000)
        finally:
            for name in added:
                del os.environ[name]

    def write(self, styles=STYLES[0], extra=""):
        """The installation: six cameras of the recording, two of the process that dies."""
        recorded = read_text(os.path.join(BENCH, "calibration.toml"))
        calibration, cameras = "", ""
        for i, name in enumerate(NAMES):
            wanted = RECORDED[i % 2 if i >= CAMERAS - MORTAL else i % len(RECORDED)]
            calibration += tables(recorded, name, wanted)
            source = f'"replay:{BENCH}"\nrecorded_as = "{wanted}"'
            if i >= CAMERAS - MORTAL:
                source = f'"rtsp://127.0.0.1:{self.source_port}/{wanted}"'
            cameras += f'[[camera]]\nname = "{name}"\nsource = {source}\n'
        text = installation(cameras=(), styles=styles, extra=extra).replace("[[object]]", cameras + "[[object]]", 1)
        text = text.replace(f'"{BENCH}/calibration.toml"', '"calibration.toml"')
        if self.disk:
            text += f'[record]\ndirectory = "{self.disk.folder}"\nquota_gb = 1\n'
        text += f'[publish.mqtt]\nhost = "127.0.0.1"\nport = {self.broker_port}\n'
        for name, content in (("calibration.toml", calibration), ("soak.toml", text)):
            with open(os.path.join(self.folder, name), "w", encoding="utf-8") as file:
                file.write(content)
        return os.path.join(self.folder, "soak.toml")

    def start_source(self):
        folder = os.path.join(self.folder, "source")
        os.makedirs(folder, exist_ok=True)
        path = os.path.join(folder, "source.toml")
        text = installation(rtsp=self.source_port, cameras=RECORDED[:MORTAL])
        text = text.replace(f'[[object]]\nfile = "{BENCH}/objects/carton.toml"\n', "")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        self.source = Daemon(folder, path)

    def start_broker(self):
        if not MOSQUITTO:
            return
        path = os.path.join(self.folder, "mosquitto.conf")
        with open(path, "w", encoding="utf-8") as file:
            file.write(f"listener {self.broker_port} 127.0.0.1\nuser root\nallow_anonymous true\n")
        self.broker = subprocess.Popen([MOSQUITTO, "-c", path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def get(self, path):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.http}{path}", timeout=20) as answer:
            return answer.read().decode()

    def order(self, path, body, method="POST"):
        """The status of the answer; 0: none came."""
        request = urllib.request.Request(f"http://127.0.0.1:{self.http}{path}", method=method, data=json.dumps(body).encode(),
                                         headers={"Content-Type": "application/json"})
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            return error.code
        except (OSError, http.client.HTTPException):
            return 0

    def reload(self, text_extra="", number=0):
        self.write(STYLES[number % len(STYLES)], text_extra)
        self.daemon.process.send_signal(signal.SIGHUP)
        self.reloads += 1

    def close(self):
        for process in (self.broker,):
            if process and process.poll() is None:
                process.kill()
                process.wait()
        for daemon in (self.source, getattr(self, "daemon", None)):
            if daemon:
                daemon.close()
        if self.disk:
            self.disk.remove()


class Watching(threading.Thread):
    """A viewer that reads, and times what it sees."""

    def __init__(self, port, camera, seconds):
        super().__init__(daemon=True)
        self.port, self.camera, self.seconds = port, camera, seconds
        self.frames, self.delays_ms, self.problem = 0, [], ""

    def run(self):
        end = time.monotonic() + self.seconds
        try:
            player = viewer.Viewer(self.port, self.camera)
            player.play()
            player.sock.settimeout(20)
            while time.monotonic() < end:
                player.more()
                player.take(time.monotonic_ns())
            player.send("TEARDOWN")
            player.sock.close()
            self.frames = len(player.frames)
            self.delays_ms = [(frame[0] - frame[3]) / 1e6 for frame in player.frames]
        except (OSError, KeyError) as problem:
            self.problem = str(problem) or type(problem).__name__


def stop_reading(port, camera, seconds):
    """Plays, takes no byte more, and goes without a word."""
    try:
        player = viewer.Viewer(port, camera)
        player.play()
        time.sleep(seconds)
        player.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
        player.sock.close()
    except (OSError, KeyError):
        pass


def read_endless(port, path, seconds):
    """A reader of events or motion JPEG."""
    end = time.monotonic() + seconds
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=20) as sock:
            sock.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            while time.monotonic() < end and sock.recv(1 << 16):
                pass
    except OSError:
        pass


def pick(names, number):
    return names[random.Random(number).randrange(len(names))]
