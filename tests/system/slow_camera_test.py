#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A GigE Vision camera that takes its time for every register, so that opening it lasts for much longer than the watchdog has
patience with a thread: that is a wait and no hang. In a network namespace; exits 77 where none can be made."""
import os
import sys
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "gige"))
from gige import ADDRESSES, Simulator, enter_namespace  # noqa: E402
from support import BENCH, BIN, DaemonCase, wait_until  # noqa: E402

SIMULATOR = os.path.join(BIN, "gige_simulator")
ANSWER_US = 350_000  # within what Aravis waits for one answer
STOP_S = 8           # the daemon allows itself 2 s; the machine may be busy


class SlowCamera(DaemonCase):
    def setUp(self):
        super().setUp()
        self.camera = Simulator(SIMULATOR, ADDRESSES[0], "--serial", "S0", answer_us=ANSWER_US)
        self.addCleanup(self.camera.close)
        text = f'calibration = "{BENCH}/calibration.toml"\n'
        text += f'[[camera]]\nname = "left"\nsource = "aravis:{ADDRESSES[0]}"\nrate = 20\n'
        text += f'[[camera]]\nname = "right"\nsource = "replay:{BENCH}"\nloop = true\n'
        self.daemon = self.start(text + "[rtsp]\nport = 0\n[http]\nport = 0\n", watchdog_us=10_000_000)

    def waits(self):
        return [wait for wait in self.daemon.state().get("waiting", []) if wait["thread"] == "cap:left"]

    def test_it_is_waited_for_and_the_watchdog_fed(self):
        wait_until(self.waits, "it says that it waits for it")
        self.assertEqual(self.waits()[0]["for"], "the camera")
        self.assertIn("cap:left waits for the camera", self.daemon.get("/healthz"))
        wait_until(lambda: "s for the camera; everything else goes on" in self.daemon.log_text(), "the journal has it")
        frames = self.daemon.state()["cameras"][1]["frames"]
        wait_until(lambda: self.daemon.state()["cameras"][1]["frames"] > frames + 50, "the other camera goes on")
        self.assertNotIn("no progress", self.daemon.log_text())
        begin = time.monotonic()
        self.assertEqual(self.daemon.stop(), 0)
        self.assertLess(time.monotonic() - begin, STOP_S)

    def test_it_opens_once_it_answers_faster(self):
        wait_until(self.waits, "it says that it waits for it")
        self.camera.set("answer-us", 0)
        wait_until(lambda: self.daemon.state()["cameras"][0]["frames"] > 10 or
                   "problem" in self.daemon.state()["cameras"][0], "it opens, or is refused for its images")
        wait_until(lambda: not self.waits(), "nobody waits any more")
        self.assertNotIn("no progress", self.daemon.log_text())
        self.assertEqual(self.daemon.stop(), 0)


if __name__ == "__main__":
    enter_namespace()
    unittest.main(verbosity=2)
