#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A disk that takes its time, for a recording and for one that is played: who waits for it says so, the watchdog is fed, and
SIGTERM is obeyed. Delays are made by slow_calls.cpp, loaded into the daemon."""
import os
import time
import unittest
from unittest import mock

from support import BENCH, BIN, DaemonCase, installation, sightline, wait_until

SHIM = os.environ.get("SIGHTLINE_SLOW_CALLS", os.path.join(BIN, "slow_calls.so"))
STOP_S = 8  # the daemon allows itself 2 s; the machine may be busy
WATCHDOG_US = 10_000_000


class SlowDisk(DaemonCase):
    def start_slowly(self, text, **rules):
        """Rules are "TEXT:MILLISECONDS" for slow_calls.cpp; READY=1 may come late."""
        with mock.patch.dict(os.environ, LD_PRELOAD=SHIM, **rules):
            return self.start(text, watchdog_us=WATCHDOG_US)

    def wait_of(self, daemon, thread):
        for wait in daemon.state().get("waiting", []):
            if wait["thread"].startswith(thread):
                return wait
        return None

    def beats_while(self, daemon, seconds):
        """The longest time without a word to the watchdog."""
        longest, last, begin = 0, time.monotonic(), time.monotonic()
        while time.monotonic() < begin + seconds:
            before = len(daemon.words)
            fed = "WATCHDOG=1" in daemon.read_notifications()[before:]
            longest = max(longest, time.monotonic() - last)
            last = time.monotonic() if fed else last
        return longest

    def stops(self, daemon):
        begin = time.monotonic()
        status = daemon.stop()
        self.assertLess(time.monotonic() - begin, STOP_S)
        return status

    def test_the_disk_of_a_recording_that_is_played(self):
        # Each read takes 0.3 s: it is read for more than half a minute before the first frame.
        daemon = self.start_slowly(installation(), SLOW_READ=".mkv:300")
        wait_until(lambda: self.wait_of(daemon, "cap:"), "it says that it waits for it")
        self.assertIn("waits for the", daemon.get("/healthz"))
        self.assertLess(self.beats_while(daemon, 12), 8)
        self.assertNotIn("no progress", daemon.log_text())
        wait = self.wait_of(daemon, "cap:")
        self.assertIn(wait["for"], ("the disk", "the recording"))
        self.assertGreater(daemon.metric("sightline_waiting_seconds", **{"for": wait["for"], "thread": wait["thread"]}), 5)
        self.assertIn("everything else goes on", daemon.log_text())
        self.assertEqual(self.stops(daemon), 0)

    def test_a_disk_that_does_not_answer(self):
        # One read takes ten minutes.
        daemon = self.start_slowly(installation(), SLOW_READ="left.mkv:600000")
        wait_until(lambda: self.wait_of(daemon, "cap:"), "it says that it waits for it")
        self.assertLess(self.beats_while(daemon, 8), 7)
        self.assertNotIn("no progress", daemon.log_text())
        self.assertEqual(self.stops(daemon), 0)

    def record(self, delay_ms):
        folder = self.path("recordings")
        os.mkdir(folder)
        text = installation(extra=f'[record]\nenabled = true\ndirectory = "{folder}"\n')
        daemon = self.start_slowly(text, SLOW_SYNC=f"{folder}:{delay_ms}")
        wait_until(lambda: os.listdir(folder), "it begins a recording")
        return daemon, os.path.join(folder, os.listdir(folder)[0])

    def test_the_disk_of_a_recording_that_is_made(self):
        daemon, recording = self.record(12_000)
        wait_until(lambda: self.wait_of(daemon, "record"), "it says that it waits for it")
        self.assertEqual(self.wait_of(daemon, "record")["for"], "the disk")
        self.assertIn("record waits for the disk", daemon.get("/healthz"))
        self.assertLess(self.beats_while(daemon, 6), 5)
        self.assertNotIn("no progress", daemon.log_text())
        frames = daemon.state()["cameras"][0]["frames"]
        wait_until(lambda: daemon.state()["cameras"][0]["frames"] > frames + 5, "the cameras go on")
        # What could not be finished is said, and is an error; what was written opens.
        self.assertEqual(self.stops(daemon), 1)
        self.assertIn("stopped without the recording", daemon.log_text())
        sightline("replay", recording, "--poses", self.path("poses.csv"))

    def test_a_recording_whose_disk_hangs_for_good(self):
        # Longer than any limit of progress: old or new, the watchdog must not end the service for it.
        daemon, _ = self.record(600_000)
        wait_until(lambda: "s for the disk; everything else goes on" in daemon.log_text(), "it says that it waits for it")
        self.assertGreater(daemon.metric("sightline_waiting_seconds", **{"for": "the disk", "thread": "record"}), 0)
        self.assertEqual(self.stops(daemon), 1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
