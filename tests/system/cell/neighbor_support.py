# SPDX-License-Identifier: Apache-2.0
"""Two cells on one machine, each with a real mosquitto of its own that bridges what it needs of the other one's, and what
their brokers say of one object."""
import csv
import math
import os
import shutil
import socket
import struct
import subprocess
import sys
import threading

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from cell_support import BENCH, MOSQUITTO, CellCase  # noqa: E402
from support import WAIT_S, fixed_port, wait_until  # noqa: E402

STATES = ("searching", "tracking", "degraded", "coasting", "lost")


def fields(data):
    """(number, value) of a protobuf message: whole numbers, or bytes."""
    at = 0

    def varint():
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value
    while at < len(data):
        key = varint()
        if key & 7 == 0:
            yield key >> 3, varint()
        elif key & 7 == 1:
            at += 8
            yield key >> 3, int.from_bytes(data[at - 8:at], "little")
        else:
            size = varint()
            at += size
            yield key >> 3, data[at - size:at]


def doubles(data):
    return struct.unpack(f"<{len(data) // 8}d", data)


class Track:
    """A message of the topic track/OBJECT."""

    def __init__(self, arrival, topic, payload):
        self.arrival, self.cell = arrival, topic.split("/track/")[0]
        read = list(fields(payload))
        values = dict(read)
        self.cameras = {value.decode() for number, value in read if number == 14}
        self.utc_ns, self.term = values[6], values.get(15, 0)
        self.state = STATES[values.get(8, 0)]
        self.place = self.sigma = None
        if 10 not in values:
            return
        self.turn, self.place = doubles(dict(fields(values[10]))[1])[:4], doubles(dict(fields(values[10]))[1])[4:]
        self.twist, packed = doubles(values[11]), doubles(values[12])
        row, diagonal = 0, []
        for size in range(12, 0, -1):  # rows of the upper triangle
            diagonal.append(packed[row])
            row += size
        self.sigma = math.sqrt(sum(diagonal[3:6]))

    def place_at(self, utc_ns):
        """Predicted with its velocity, which is of the object's frame."""
        dt = (utc_ns - self.utc_ns) * 1e-9
        w, *u = self.turn
        v = self.twist[3:]
        cross = [u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3] + w * v[i] for i in range(3)]
        moved = [v[i] + 2 * (u[(i + 1) % 3] * cross[(i + 2) % 3] - u[(i + 2) % 3] * cross[(i + 1) % 3]) for i in range(3)]
        return [self.place[i] + dt * moved[i] for i in range(3)]


class Truth:
    """Where the object of a recording is that hosts play in step, over and over."""
    JUMP_NS = 500_000_000  # at the begin of a turn it jumps back: no motion that an estimator is made for

    def __init__(self, folder):
        with open(f"{folder}/truth.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.places = [[float(row[key]) for key in ("tx", "ty", "tz")] for row in rows]
        self.frame_ns = (int(rows[-1]["t_ns"]) - int(rows[0]["t_ns"])) / (len(rows) - 1)
        self.turn_ns = round(self.frame_ns * len(rows))

    def error(self, utc_ns, place):
        """How far it is off, as a vector [m]; None where it has just jumped, or between two truths."""
        slack_ns = 1_000_000
        in_turn_ns = (utc_ns + slack_ns) % self.turn_ns - slack_ns
        frame = round(in_turn_ns / self.frame_ns)
        if abs(in_turn_ns - frame * self.frame_ns) > slack_ns or in_turn_ns < self.JUMP_NS:
            return None
        return [a - b for a, b in zip(place, self.places[frame])]

    def jump(self, before, after):
        """Of (UTC, place) and a later one: by how much the error differs; None as above."""
        errors = [self.error(*one) for one in (before, after)]
        return None if None in errors else math.dist(*errors)


class Listener:
    """Every track of an object that a broker has, in order of arrival."""

    def __init__(self, port, name, cells):
        topics = [part for cell in cells for part in ("-t", f"{cell}/track/{name}")]
        self.tracks = []
        self.process = subprocess.Popen(["mosquitto_sub", "-h", "127.0.0.1", "-p", str(port), *topics, "-F", "%U %t %x"],
                                        stdout=subprocess.PIPE, text=True)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        for line in self.process.stdout:
            arrival, topic, payload = line.rsplit(maxsplit=2)
            self.tracks.append(Track(float(arrival), topic, bytes.fromhex(payload)))

    def close(self):
        self.process.terminate()
        self.process.wait(timeout=WAIT_S)
        self.thread.join(timeout=WAIT_S)
        self.process.stdout.close()


class NeighborsCase(CellCase):
    """Cell site/a has the cameras left and side, cell site/b the camera right; each sees its end of the bench alone, both
    see the middle. `side` is at the border: both cells fuse it."""
    CELLS = ("site/a", "site/b")
    cell_of = {"left": 0, "side": 0, "right": 1}
    border = ("side",)

    def setUp(self):
        super().setUp()
        self.ports = [self.port, self.other_port()]
        self.brokers = [None, None]
        self.recording = self.halves()

    def other_port(self):
        with socket.socket() as probe:  # the first one is free still: it is taken meanwhile
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", self.port))
            probe.listen()
            return fixed_port()

    def halves(self):
        """The recording, but that each of the two cameras sees its half of it: the other one is gray."""
        folder = self.path("crossing")
        shutil.copytree(BENCH, folder)
        for camera, box in (("left", "x=400:y=0:w=240:h=480"), ("right", "x=0:y=0:w=180:h=480")):
            subprocess.run(["ffmpeg", "-y", "-v", "error", "-i", f"{BENCH}/{camera}.mkv", "-vf",
                            f"drawbox={box}:color=gray:t=fill", "-c:v", "libx264", "-preset", "veryfast", "-crf", "8", "-bf",
                            "0", "-g", "15", "-pix_fmt", "yuv420p", f"{folder}/{camera}.mkv"], check=True, timeout=WAIT_S)
        return folder

    def take_markers(self):
        """From the object: it has to be found and followed by its looks."""
        path = f"{self.recording}/objects/{self.objects[0]}.toml"
        with open(path, encoding="utf-8") as file:
            text = file.read()
        with open(path, "w", encoding="utf-8") as file:
            file.write(text[:text.index("[[fiducial]]")])

    def bridge(self, cell):
        """What `sightline cell init --neighbor` writes."""
        other, name = 1 - cell, self.CELLS[1 - cell]
        topics = [("fusion", 1), ("track/+", 0), ("bid/+", 0)] + [(f"cam/{c}/obs/+", 0) for c in self.border
                                                                  if self.cell_of[c] == other]
        return (f"connection {name.replace('/', '-')}\naddress 127.0.0.1:{self.ports[other]}\ncleansession true\n"
                "notifications false\nrestart_timeout 1\nkeepalive_interval 5\n"
                + "".join(f"topic {name}/{topic} in {qos}\n" for topic, qos in topics))

    def start_broker(self, cell):
        self.port = self.ports[cell]
        config = self.write(f"mosquitto{cell}.conf", f"user root\nset_tcp_nodelay true\nlistener {self.port} 127.0.0.1\n"
                                                     f"allow_anonymous true\n{self.bridge(cell)}")
        process = subprocess.Popen([MOSQUITTO, "-c", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        def end():
            process.kill()
            process.wait(timeout=WAIT_S)
        self.addCleanup(end)
        self.brokers[cell] = process
        return process

    def text_of(self, cell, host, role, extra=""):
        text = f'name = "{host}"\ncalibration = "{self.recording}/calibration.toml"\n'
        for camera, owner in self.cell_of.items():
            if owner != cell and camera not in self.border:
                continue
            text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{self.recording}"\nin_step = true\n'
            text += f'host = "{self.host_of(owner)}"\n' + (f'cell = "{self.CELLS[owner]}"\n' if owner != cell else "")
        text += "".join(f'[[object]]\nfile = "{self.recording}/objects/{name}.toml"\n' for name in self.objects)
        return text + ("[rtsp]\nport = 0\n[http]\nport = 0\n"
                       f'[cell]\nrole = "{role}"\nname = "{self.CELLS[cell]}"\nhost = "{host}"\nbroker = "127.0.0.1"\n'
                       f'port = {self.ports[cell]}\nneighbors = ["{self.CELLS[1 - cell]}"]\n{extra}')

    @staticmethod
    def host_of(cell):
        return "ab"[cell]

    def start_host(self, cell, role="cameras", extra=""):
        host = "f" if role == "fusion" else self.host_of(cell)  # names are a cell's own
        self.text = lambda *_, **__: self.text_of(cell, host, role, extra)
        daemon = self.host(host, role)
        return daemon

    def both_cells(self):
        for cell in (0, 1):
            self.start_broker(cell)
        self.fusions = [self.start_host(cell, "fusion") for cell in (0, 1)]
        self.cameras = [self.start_host(cell) for cell in (0, 1)]
        for daemon in self.cameras:
            self.wait_for_state(daemon, "tracking")

    @staticmethod
    def keeper(daemon):
        """The cell that has the object, as a host sees it."""
        return daemon.state()["cell"]["objects"][0]["cell"]

    def wait_for_keeper(self, daemon, cell):
        wait_until(lambda: self.keeper(daemon) == self.CELLS[cell], f"{self.CELLS[cell]} has the object")

    def listen(self, cell):
        listener = Listener(self.ports[cell], self.objects[0], self.CELLS)
        self.addCleanup(listener.close)
        return listener
