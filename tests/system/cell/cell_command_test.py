#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline cell init` and `status`: a real mosquitto and real daemons run with exactly the files that were written."""
import json
import os
import shutil
import stat
import subprocess
import sys
import tomllib
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from cell_support import BENCH, MOSQUITTO, CellCase, encode, missing  # noqa: E402
from support import WAIT_S, read_text, sightline, wait_until  # noqa: E402


def mode_of(path):
    return stat.S_IMODE(os.stat(path).st_mode)


class Init(CellCase):
    def setUp(self):
        super().setUp()
        self.out = self.path("out")
        shutil.copytree(os.path.join(BENCH, "objects"), self.path("objects"))
        shutil.copy(os.path.join(BENCH, "calibration.toml"), self.folder)
        text = 'name = "hall"\ncalibration = "calibration.toml"\n'
        for camera, owner in self.owners.items():
            text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{BENCH}"\nin_step = true\nhost = "{owner}"\n'
        text += ('[cell]\nname = "site/cell"\nage_limit = 0.2 # seconds\n# of the object\n'
                 '[[object]]\nfile = "objects/carton.toml"\n[rtsp]\nport = 0\n[http]\nport = 0\n')
        self.config = self.write("rig.toml", text)

    def init(self, *arguments, status=0):
        return sightline("cell", "init", self.out, *arguments, status=status)

    def init_cell(self, out=None, *more):
        out = out or self.out
        return sightline("cell", "init", out, "--config", self.config, "--fusion", "f", "--broker", "127.0.0.1", "--port",
                         str(self.port), "--broker-folder", os.path.join(out, "broker"), *more)

    def broker_of(self, out):
        # Tests run as root, whose keys no other user could read.
        config = self.write("main.conf", f"user root\ninclude_dir {os.path.join(out, 'broker')}\n")
        process = subprocess.Popen([MOSQUITTO, "-c", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        def end():
            process.kill()
            process.wait(timeout=WAIT_S)
        self.addCleanup(end)
        return process

    def start(self, name, config):
        folder = self.path("run_" + name)
        os.mkdir(folder)
        return self.started(folder, config)

    def files(self, host, name, out=None):
        return os.path.join(out or self.out, "hosts", host, name)

    def pub(self, host, topic, payload, out=None):
        """As who has that host's certificate; what the broker makes of it is seen elsewhere."""
        path = self.path("message")
        with open(path, "wb") as file:
            file.write(payload)
        folder = self.files(host, "cell", out)
        return subprocess.run(["mosquitto_pub", "-h", "127.0.0.1", "-p", str(self.port), "-t", topic, "-f", path, "-q", "1",
                               "--cafile", self.files("f", "cell/ca.pem"), "--cert", folder + "/host.pem", "--key",
                               folder + "/host.key"], timeout=WAIT_S, capture_output=True, check=False).returncode

    def status(self, host="f", status=0):
        out, err = sightline("cell", "status", "--config", self.files(host, "sightline.toml"), "--json", status=status)
        return json.loads(out) if status in (0, 1) else err

    def test_a_cell_runs_with_what_was_written(self):
        self.init_cell()
        self.assertEqual(mode_of(self.out), 0o700)
        for key in ("authority/ca.key", "broker/broker.key", "hosts/a/cell/host.key"):
            self.assertEqual(mode_of(os.path.join(self.out, key)), 0o600)
        self.assertIn("# of the object\n[[object]]", read_text(self.files("a", "sightline.toml")))
        written = tomllib.loads(read_text(self.files("a", "sightline.toml")))
        self.assertEqual((written["cell"]["role"], written["cell"]["age_limit"]), ("cameras", 0.2))
        err = self.status(status=3)
        self.assertIn("the broker of the cell is not to be reached", err)
        self.broker_of(self.out)
        daemons = {name: self.start(name, self.files(name, "sightline.toml")) for name in ("f", "a", "b")}
        for daemon in daemons.values():
            self.wait_for_state(daemon, "tracking")
        seen = set()
        wait_until(lambda: seen.update(daemons["f"].state()["objects"][0].get("cameras", [])) or seen >= {"left", "right"},
                   "cameras of both hosts take part")
        self.check_status()
        self.check_what_is_refused(daemons["f"])
        self.assertEqual(daemons["b"].stop(), 0)
        away = self.status(status=1)
        self.assertFalse(away["whole"])
        self.assertIn("host b is away", away["faults"])

    def check_status(self):
        status = self.status()
        self.assertTrue(status["whole"], status)
        self.assertEqual(status["fusion"], "f")
        hosts = {host["host"]: host for host in status["hosts"]}
        self.assertEqual({name: host["role"] for name, host in hosts.items()}, {"a": "cameras", "b": "cameras", "f": "fusion"})
        self.assertTrue(hosts["a"]["clock_fit"])
        self.assertEqual([camera["name"] for camera in hosts["b"]["cameras"]], ["right", "side"])
        self.assertGreater(hosts["a"]["cameras"][0]["observations"], 0)
        self.assertGreater(status["observations"]["taken"], 0)
        self.assertGreater(status["objects"][0]["tracks"], 0)
        table, _ = sightline("cell", "status", "--config", self.files("a", "sightline.toml"))
        for part in ("f keeps the estimates", "object carton: ", "observations since f was started: "):
            self.assertIn(part, table)

    def check_what_is_refused(self, fusion):
        before = fusion.metric("sightline_cell_messages_total", kind="observation", verdict="malformed")
        # What is its own reaches the fusion host, which cannot read it; what is another's does not.
        self.pub("b", "site/cell/cam/left/obs/carton", b"x")
        self.pub("a", "site/cell/track/carton", b"x")
        self.pub("a", "site/cell/host/b/state", encode("HostState", 'version: 1 host: "b" boot: 9 since_utc_ns: 1'))
        self.pub("a", "site/cell/cam/left/obs/carton", b"x")
        count = "sightline_cell_messages_total"
        wait_until(lambda: fusion.metric(count, kind="observation", verdict="malformed") > before, "its own is delivered")
        self.assertEqual(fusion.metric(count, kind="observation", verdict="malformed"), before + 1)
        self.assertTrue({host["host"]: host["online"] for host in fusion.state()["cell"]["hosts"]}["b"])
        # Of another authority, with the same names.
        other = self.path("other")
        self.init_cell(other)
        self.assertNotEqual(self.pub("a", "site/cell/cam/left/obs/carton", b"x", out=other), 0)
        shutil.copy(self.files("f", "cell/ca.pem"), self.files("a", "cell/ca.pem", other))
        stranger = self.start("stranger", self.files("a", "sightline.toml", other))
        wait_until(lambda: stranger.state()["cell"].get("problem"), "it says why it is not connected")
        self.assertFalse(stranger.state()["cell"]["connected"])
        stranger.stop()

    def test_a_host_is_added_and_another_one_taken_back(self):
        self.init_cell()
        kept = {name: read_text(os.path.join(self.out, name)) for name in
                ("authority/ca.key", "broker/broker.key", "broker/broker.pem", "hosts/a/cell/host.key", "hosts/a/cell/host.pem")}
        text = read_text(self.config)
        with open(self.config, "w", encoding="utf-8") as file:  # what b had is c's
            file.write(text.replace('host = "b"', 'host = "c"'))
        _, err = self.init_cell(None, "--update")
        self.assertIn("host b is in the cell no more", err)
        for name, content in kept.items():
            self.assertEqual(read_text(os.path.join(self.out, name)), content, name)
        self.assertEqual(sorted(os.listdir(os.path.join(self.out, "hosts"))), ["a", "c", "f"])
        self.assertEqual(mode_of(self.files("c", "cell/host.key")), 0o600)
        before = os.path.join(self.out, "revoked", "b")
        self.broker_of(self.out)
        daemons = [self.start(name, self.files(name, "sightline.toml")) for name in ("f", "a", "c")]
        for daemon in daemons:
            self.wait_for_state(daemon, "tracking")
        seen = set()
        wait_until(lambda: seen.update(daemons[0].state()["objects"][0].get("cameras", [])) or seen >= {"left", "right"},
                   "the new host takes part")
        gone = self.start("gone", os.path.join(before, "sightline.toml"))
        wait_until(lambda: gone.state()["cell"].get("problem"), "it says why it is not connected")
        self.assertFalse(gone.state()["cell"]["connected"])
        # Back again: with another certificate, the old one stays what it is.
        with open(self.config, "w", encoding="utf-8") as file:
            file.write(text)
        self.init_cell(None, "--update")
        self.assertNotEqual(read_text(self.files("b", "cell/host.pem")), read_text(os.path.join(before, "cell", "host.pem")))
        listed = subprocess.run(["openssl", "crl", "-in", os.path.join(self.out, "broker", "revoked.pem"), "-noout", "-text",
                                 "-CAfile", os.path.join(self.out, "authority", "ca.pem")], check=True, capture_output=True,
                                timeout=WAIT_S)
        self.assertEqual(listed.stdout.decode().count("Serial Number"), 2)
        self.assertIn("verify OK", listed.stdout.decode() + listed.stderr.decode())

    def test_an_update_needs_the_authority(self):
        _, err = self.init("--config", self.config, "--fusion", "f", "--broker", "127.0.0.1", "--update", status=2)
        self.assertIn("is no folder of `sightline cell init`", err)
        self.assertFalse(os.path.exists(self.out))

    def test_nothing_is_overwritten(self):
        os.mkdir(self.out)
        _, err = self.init("--config", self.config, "--fusion", "f", "--broker", "127.0.0.1", status=2)
        self.assertIn("never overwritten", err)
        self.assertEqual(os.listdir(self.out), [])

    def test_a_list_of_hosts_will_do(self):
        self.init("--host", "hall-1=left,right", "--host", "hall-2", "--fusion", "hall-2", "--broker", "hall-2.local")
        section = tomllib.loads(read_text(self.files("hall-1", "cell.toml")))["cell"]
        self.assertEqual((section["role"], section["broker"], section["port"]), ("cameras", "hall-2.local", 8883))
        access = read_text(os.path.join(self.out, "broker", "access"))
        self.assertIn("topic write sightline/cell/cam/right/obs/#", access)
        shown = subprocess.run(["openssl", "x509", "-in", os.path.join(self.out, "broker", "broker.pem"), "-noout", "-text"],
                               check=True, capture_output=True, timeout=WAIT_S).stdout.decode()
        for part in ("DNS:hall-2.local", "TLS Web Server Authentication", "CA:FALSE"):
            self.assertIn(part, shown)
        subprocess.run(["openssl", "verify", "-CAfile", os.path.join(self.out, "authority", "ca.pem"), "-purpose", "sslclient",
                        self.files("hall-1", "cell/host.pem")], check=True, capture_output=True, timeout=WAIT_S)

    def test_wrong_usage(self):
        good = {"--config": self.config, "--fusion": "f", "--broker": "127.0.0.1"}
        for more, expected in (({"--host": "c=left"}, 'camera left has host = "a" there, but --host says c'),
                               ({"--host": "c=top"}, "has no camera top"), ({"--name": "a#"}, "a topic without"),
                               ({"--host": "a b"}, "is no host"), ({"--broker": "x,DNS:evil"}, "name or address"),
                               ({"--name": "a\ntopic readwrite #"}, "a topic without")):
            _, err = self.init(*(part for pair in (good | more).items() for part in pair), status=2)
            self.assertIn(expected, err)
            self.assertFalse(os.path.exists(self.out), more)
        _, err = self.init("--config", self.config, "--broker", "127.0.0.1", status=2)
        self.assertIn("which host keeps the estimates", err)
        with open(self.config, "a", encoding="utf-8") as file:
            file.write("nonsense = 1\n")
        _, err = self.init(*(part for pair in good.items() for part in pair), status=2)
        self.assertIn("nonsense", err)
        self.assertFalse(os.path.exists(self.out))


if __name__ == "__main__":
    if missing():
        print("skipped: without", ", ".join(missing()))
        sys.exit(77)
    unittest.main(verbosity=2)
