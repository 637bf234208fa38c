#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A camera host with `local = true` while the fusion host or the broker is away, with a real mosquitto and real daemons: it
goes on from the cell's last estimate, says so, publishes nothing for the cell, and follows the cell again without a jump."""
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import unittest
import urllib.request

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from cell_support import CellCase, missing  # noqa: E402
from neighbor_support import Truth  # noqa: E402
from support import WAIT_S, wait_until  # noqa: E402

POSED = ("tracking", "degraded", "coasting")


class Events:
    """What a host tells its clients, as it comes."""

    def __init__(self, daemon):
        self.poses = []
        self.stream = urllib.request.urlopen(f"http://127.0.0.1:{daemon.http}/api/v1/events", timeout=WAIT_S)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        try:
            for line in self.stream:
                if line.startswith(b"data: {"):
                    pose = json.loads(line[6:])
                    if "object" in pose:
                        self.poses.append(pose)
        except (OSError, ValueError):
            pass  # closed


class Local(CellCase):
    owners = {"left": "a", "right": "a", "side": "b"}

    def start(self):
        self.broker_process = self.broker()
        self.fusion = self.host("f", "fusion")
        self.alone = self.host("a", tls="local = true\n")
        self.other = self.host("b")
        for daemon in (self.alone, self.other):
            self.wait_for_state(daemon, "tracking")
        self.assertNotIn("local", self.alone.state()["objects"][0])
        self.events = Events(self.alone)
        self.addCleanup(self.events.stream.close)

    @staticmethod
    def is_local(daemon):
        return daemon.state()["objects"][0].get("local", False)

    def check_no_jump(self, what):
        """All along: the error against the truth changes by no more than both claim, from one estimate to the next."""
        truth = Truth(self.recording)
        rows = sorted((p for p in list(self.events.poses) if "translation_m" in p), key=lambda p: p["utc_ns"])
        worst, over, longest = 0.0, 0, 0
        for a, b in zip(rows, rows[1:]):
            longest = max(longest, b["utc_ns"] - a["utc_ns"])
            jump = truth.jump(*((p["utc_ns"], p["translation_m"]) for p in (a, b)))
            if jump is None:
                continue
            share = jump / (1e-3 * math.hypot(a["sigma_t_mm"], b["sigma_t_mm"]))
            worst = max(worst, share)
            over += share > 3
        print(f"figure: {what}: {len(rows)} estimates, {over} jumps of the error above 3 sigma, the largest {worst:.2f} sigma, "
              f"{longest * 1e-9:.2f} s without one at most", flush=True)
        self.assertGreater(len(rows), 100)
        self.assertLessEqual(over, len(rows) // 100)

    def test_the_fusion_host_dies_and_comes_back(self):
        self.start()
        self.fusion.process.send_signal(signal.SIGKILL)
        self.fusion.process.wait(timeout=WAIT_S)
        wait_until(lambda: self.is_local(self.alone), "it goes on by itself")
        self.assertEqual(self.alone.state()["cell"]["fusion"], "")
        self.assertEqual(self.alone.metric("sightline_cell_local", object="carton"), 1)
        self.assertIn("goes on by itself (local)", self.alone.log_text())
        self.wait_for_state(self.other, "lost", "searching")  # who is not to, does not
        self.assertFalse(self.is_local(self.other))
        # For itself only: nothing is said as the cell's.
        heard = subprocess.run(["mosquitto_sub", "-h", "127.0.0.1", "-p", str(self.port), "-t", "site/cell/track/#", "-t",
                                "site/cell/last/#", "-R", "-W", "3"], capture_output=True, timeout=WAIT_S, check=False)
        self.assertEqual(heard.stdout, b"")
        self.assertTrue(self.is_local(self.alone))
        self.assertIn(self.object_state(self.alone), POSED)
        self.fusion = self.host("f", "fusion")
        wait_until(lambda: not self.is_local(self.alone), "it follows the cell again")
        for daemon in (self.alone, self.other):
            self.wait_for_state(daemon, "tracking")
        self.assertEqual(self.alone.metric("sightline_cell_local", object="carton"), 0)
        time.sleep(1)
        self.check_no_jump("fusion host killed and started again")

    def test_the_broker_dies_and_comes_back(self):
        self.start()
        self.broker_process.kill()
        self.broker_process.wait(timeout=WAIT_S)
        wait_until(lambda: self.is_local(self.alone), "it goes on by itself")
        self.wait_for_state(self.other, "lost", "searching")
        time.sleep(3)
        self.assertTrue(self.is_local(self.alone))
        self.assertIn(self.object_state(self.alone), POSED)
        self.broker()
        wait_until(lambda: not self.is_local(self.alone), "it follows the cell again")
        for daemon in (self.alone, self.other):
            self.wait_for_state(daemon, "tracking")
        time.sleep(1)
        self.check_no_jump("broker killed and started again")

    def test_a_host_that_starts_alone_finds_the_object_itself(self):
        self.broker()
        alone = self.host("a", tls="local = true\n")
        self.wait_for_state(alone, "tracking", "degraded")
        wait_until(lambda: self.is_local(alone), "it says that it is by itself")
        self.host("f", "fusion")
        wait_until(lambda: not self.is_local(alone), "it follows the cell")
        self.wait_for_state(alone, "tracking")


if __name__ == "__main__":
    if missing():
        print("skipped: not installed: " + ", ".join(missing()))
        sys.exit(77)
    unittest.main(verbosity=2)
