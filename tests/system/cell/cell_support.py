# SPDX-License-Identifier: Apache-2.0
"""A cell on one machine: a real mosquitto, and daemons that are its hosts; messages of the wire format by protoc."""
import os
import random
import shutil
import socket
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import BENCH, BIN, ROOT, WAIT_S, Daemon, TemporaryFolder, fixed_port, wait_until  # noqa: E402, F401

MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
PROTO = os.path.join(ROOT, "src", "publish", "cell")


def missing():
    """What the machine lacks for these tests; empty: nothing."""
    return [name for name, found in (("mosquitto", MOSQUITTO), ("mosquitto_pub", shutil.which("mosquitto_pub")),
                                     ("protoc", shutil.which("protoc"))) if not found]


def encode(kind, text):
    done = subprocess.run(["protoc", "-I", PROTO, f"--encode=sightline.cell.v1.{kind}", "cell.proto"], input=text.encode(),
                          capture_output=True, timeout=WAIT_S, check=True)
    return done.stdout


def decode(kind, payload):
    """As protoc writes it."""
    done = subprocess.run(["protoc", "-I", PROTO, f"--decode=sightline.cell.v1.{kind}", "cell.proto"], input=payload,
                          capture_output=True, timeout=WAIT_S, check=True)
    return done.stdout.decode()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class CellCase(TemporaryFolder):
    """One broker and any number of hosts, each a daemon of its own, that play a recording."""
    recording = BENCH
    owners = {"left": "a", "right": "b", "side": "b"}  # which host has which camera
    objects = ("carton",)

    def setUp(self):
        super().setUp()
        self.port = fixed_port()
        self.tools = self.path("tools")
        os.mkdir(self.tools)
        self.chrony("printf 'C0A80001,a,3,1.0,0.00001,0,0,0,0,0,0.0001,0.0001,64,Normal\\n'")
        self.hosts = {}

    def chrony(self, command):
        """What stands in for chronyc: the machine's own clock is not to decide."""
        path = os.path.join(self.tools, "chronyc")
        with open(path + ".new", "w", encoding="utf-8") as file:
            file.write(f"#!/bin/sh\n{command}\n")
        os.chmod(path + ".new", 0o755)
        os.rename(path + ".new", path)

    def broker(self, extra=""):
        access = "" if "require_certificate" in extra else "allow_anonymous true\n"
        config = self.write("mosquitto.conf", f"user root\nset_tcp_nodelay true\nlistener {self.port} 127.0.0.1\n"
                                              f"{access}{extra}")
        process = subprocess.Popen([MOSQUITTO, "-c", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        def end():
            process.kill()
            process.wait(timeout=WAIT_S)
        self.addCleanup(end)

        def listens():
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", self.port)) == 0
        wait_until(listens, "the broker listens")
        return process

    def certificate(self, name, authority=None):
        """Makes NAME.pem and NAME.key, signed by AUTHORITY or, without one, by itself."""
        pem, key, request = (self.path(f"{name}.{end}") for end in ("pem", "key", "csr"))
        make = ["openssl", "req", "-newkey", "rsa:2048", "-nodes", "-keyout", key, "-subj", f"/CN={name}"]
        if authority is None:
            commands = [make + ["-x509", "-days", "2", "-out", pem]]
        else:
            names = self.write("names", "subjectAltName=IP:127.0.0.1\n")
            commands = [make + ["-out", request],
                        ["openssl", "x509", "-req", "-in", request, "-CA", self.path(f"{authority}.pem"), "-CAkey",
                         self.path(f"{authority}.key"), "-CAcreateserial", "-days", "2", "-out", pem, "-extfile", names]]
        for command in commands:
            subprocess.run(command, check=True, capture_output=True, timeout=WAIT_S)

    def text(self, host, role, port=None, extra="", calibration=None, tls=""):
        text = f'name = "{host}"\ncalibration = "{calibration or self.recording + "/calibration.toml"}"\n'
        for camera, owner in self.owners.items():
            text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{self.recording}"\nin_step = true\n'
            text += f'host = "{owner}"\n' if role != "alone" else ""
        text += "".join(f'[[object]]\nfile = "{self.recording}/objects/{name}.toml"\n' for name in self.objects)
        text += "[rtsp]\nport = 0\n[http]\nport = 0\n" + extra
        return text if role == "alone" else text + (
            f'[cell]\nrole = "{role}"\nname = "site/cell"\nhost = "{host}"\nbroker = "127.0.0.1"\n'
            f'port = {port or self.port}\n{tls}')

    def host(self, name, role="cameras", **options):
        folder = self.path(f"host_{name}_{random.randrange(10**9)}")
        os.mkdir(folder)
        config = os.path.join(folder, "sightline.toml")
        with open(config, "w", encoding="utf-8") as file:
            file.write(self.text(name, role, **options))
        daemon = self.started(folder, config)
        self.hosts[name] = daemon
        return daemon

    def started(self, folder, config):
        """A daemon that runs; it finds the chronyc of the test."""
        before = os.environ["PATH"]
        os.environ["PATH"] = self.tools + ":" + before
        try:
            daemon = Daemon(folder, config)
        finally:
            os.environ["PATH"] = before
        self.addCleanup(daemon.close)
        daemon.wait_for_word("READY=1")
        return daemon

    def cell(self):
        """Broker, two hosts with cameras, and the one that keeps the estimates; tracking."""
        broker = self.broker()
        fusion = self.host("f", "fusion")
        cameras = [self.host("a"), self.host("b")]
        for daemon in cameras:
            self.wait_for_state(daemon, "tracking")
        self.wait_for_state(fusion, "tracking")
        return broker, fusion, cameras

    @staticmethod
    def object_state(daemon):
        return daemon.state()["objects"][0]["state"]

    def wait_for_state(self, daemon, *states):
        """Seconds until the object is in one of them."""
        begin = time.monotonic()
        wait_until(lambda: self.object_state(daemon) in states, f"the object is {states}")
        return time.monotonic() - begin

    @staticmethod
    def verdicts(daemon, kind="observation"):
        names = ("taken", "late", "future", "duplicate", "old_boot", "foreign", "calibration", "malformed")
        return {name: daemon.metric("sightline_cell_messages_total", kind=kind, verdict=name) for name in names}

    def publish(self, topic, payload, retain=False):
        path = self.path("payload")
        with open(path, "wb") as file:
            file.write(payload)
        subprocess.run(["mosquitto_pub", "-h", "127.0.0.1", "-p", str(self.port), "-t", topic, "-f", path]
                       + (["-r"] if retain else []), check=True, timeout=WAIT_S, capture_output=True)

    def hear(self, topic):
        """The next message at a topic, as bytes."""
        done = subprocess.run(["mosquitto_sub", "-h", "127.0.0.1", "-p", str(self.port), "-t", topic, "-C", "1", "-N",
                               "-W", "20"], capture_output=True, timeout=WAIT_S, check=True)
        return done.stdout
