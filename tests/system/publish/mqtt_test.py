#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Poses by MQTT through a real mosquitto: what arrives is what the API describes, the last pose and the state are retained,
a daemon that dies is said to be offline, and a broker that is away, restarted or stopped costs nobody else anything."""
import json
import os
import shutil
import signal
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from api_test import Client, fault  # noqa: E402
from support import WAIT_S, DaemonCase, fixed_port, installation, wait_until  # noqa: E402

MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")


class Mqtt(DaemonCase):
    def setUp(self):
        super().setUp()
        self.port = fixed_port()

    def broker(self, extra="allow_anonymous true\n"):
        config = self.write("mosquitto.conf", f"listener {self.port} 127.0.0.1\nuser root\n{extra}")
        process = subprocess.Popen([MOSQUITTO, "-c", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        def end():
            process.kill()
            process.wait(timeout=WAIT_S)
        self.addCleanup(end)
        wait_until(lambda: self.subscribe("$SYS/broker/version", check=False) is not None or "allow" not in extra, "it listens")
        return process

    def subscribe(self, topic, count=1, check=True, retained_only=False):
        """The next messages, or None after 5 s."""
        command = ["mosquitto_sub", "-h", "127.0.0.1", "-p", str(self.port), "-t", topic, "-W", "5"]
        command += ["--retained-only"] if retained_only else ["-C", str(count)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=WAIT_S, check=False)
        lines = done.stdout.split("\n")[:-1]
        if len(lines) < count:
            assert not check, f"{topic}: {done.stderr}"
            return None
        return lines

    def text(self, extra=""):
        return installation(extra=f'[publish.mqtt]\nhost = "127.0.0.1"\nport = {self.port}\ntopic = "site/rig"\n{extra}')

    def connected(self, daemon):
        return daemon.state()["mqtt"]["connected"]

    def test_poses_arrive_as_described_and_the_last_one_stays(self):
        self.broker()
        daemon = self.start(self.text())
        wait_until(lambda: self.connected(daemon), "it is connected")
        self.assertEqual(self.subscribe("site/rig/status"), ["online"])
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the object is found")
        description = json.loads(Client(daemon.http).get("/api/v1/openapi.json")[2])
        poses = [json.loads(line) for line in self.subscribe("site/rig/objects/carton", 40)]
        for pose in poses:
            self.assertIsNone(fault(pose, {"$ref": "/Pose"}, description))
        self.assertGreater(len({pose["t_ns"] for pose in poses}), 5)
        self.assertEqual(len(poses[-1]["covariance"]), 36)
        self.assertRegex(poses[-1]["calibration"], "^[0-9a-f]{16}$")
        self.assertLess(poses[-1]["age_s"], 5)
        self.assertGreater(daemon.metric("sightline_mqtt_published_total"), 40)
        self.assertEqual(daemon.stop(), 0)
        self.assertEqual(self.subscribe("site/rig/status"), ["offline"])
        last = json.loads(self.subscribe("site/rig/objects/carton")[0])
        self.assertEqual(last["object"], "carton")

    def test_the_last_will_of_a_daemon_that_dies(self):
        self.broker()
        daemon = self.start(self.text())
        wait_until(lambda: self.connected(daemon), "it is connected")
        daemon.process.send_signal(signal.SIGKILL)
        daemon.process.wait(timeout=WAIT_S)
        wait_until(lambda: self.subscribe("site/rig/status") == ["offline"], "the broker says so")

    def test_a_broker_may_come_late_go_and_come_back(self):
        daemon = self.start(self.text())
        wait_until(lambda: daemon.state()["mqtt"].get("problem"), "it says why not")
        self.assertIn("refused", daemon.state()["mqtt"]["problem"])
        broker = self.broker()
        wait_until(lambda: self.connected(daemon), "it is connected")
        self.assertEqual(daemon.metric("sightline_mqtt_connected"), 1)
        broker.kill()
        broker.wait(timeout=WAIT_S)
        wait_until(lambda: not self.connected(daemon), "it is noticed")
        frames = daemon.state()["cameras"][0]["frames"]
        wait_until(lambda: daemon.state()["cameras"][0]["frames"] > frames + 30, "the cameras go on")
        self.broker()
        wait_until(lambda: self.connected(daemon), "it is connected again")
        self.assertEqual(len(self.subscribe("site/rig/objects/carton", 5)), 5)
        self.assertLessEqual(daemon.log_text().count("mqtt: 127.0.0.1"), 4)  # no flood: each reason once
        self.assertEqual(daemon.stop(), 0)

    def test_a_broker_that_stands_still_holds_up_nobody(self):
        broker = self.broker()
        daemon = self.start(self.text())
        wait_until(lambda: self.connected(daemon), "it is connected")
        broker.send_signal(signal.SIGSTOP)
        try:
            frames = daemon.state()["cameras"][0]["frames"]
            wait_until(lambda: daemon.state()["cameras"][0]["frames"] > frames + 150, "the cameras go on")
            self.assertNotIn("no progress", daemon.log_text())
            self.assertEqual(daemon.stop(), 0)
        finally:
            broker.send_signal(signal.SIGCONT)

    def test_a_reload_takes_another_broker_and_none(self):
        self.broker()
        daemon = self.start(installation())
        self.assertNotIn("mqtt", daemon.state())
        self.assertTrue(self.reload(daemon, self.text()))
        wait_until(lambda: self.connected(daemon), "it is connected")
        self.assertTrue(self.reload(daemon, installation()))
        self.assertEqual(self.subscribe("site/rig/status"), ["offline"])
        self.assertEqual(daemon.stop(), 0)

    def test_a_password_is_asked_for(self):
        passwords = self.path("passwords")
        subprocess.run(["mosquitto_passwd", "-b", "-c", passwords, "rig", "pass-one-xyz"], check=True, timeout=WAIT_S,
                       capture_output=True)
        self.broker(f"password_file {passwords}\n")
        secret = self.write("secret", "pass-two-xyz\n")
        extra = f'user = "rig"\npassword_file = "{secret}"\n'
        daemon = self.start(self.text(extra))
        wait_until(lambda: "refuses" in daemon.state()["mqtt"].get("problem", ""), "it is refused")
        self.write("secret", "pass-one-xyz\n")
        self.assertTrue(self.reload(daemon, self.text(extra + 'client_id = "rig"\n')))
        wait_until(lambda: self.connected(daemon), "it is connected")
        self.assertNotIn("xyz", daemon.log_text())


if __name__ == "__main__":
    if MOSQUITTO is None or shutil.which("mosquitto_sub") is None:
        print("skipped: mosquitto and mosquitto-clients are not installed")
        sys.exit(77)
    unittest.main(verbosity=2)
