#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A daemon that is killed while it records: every recording opens, and at most its last second is missing."""
import csv
import glob
import os
import random
import signal
import time
import unittest

from support import WAIT_S, Daemon, TemporaryFolder, installation, read_text, sightline, wait_until

KILLS = 10
CAMERAS = ("left", "right", "side")


class KilledWhileRecording(TemporaryFolder):
    def start(self, number):
        """A daemon that records, and its folder."""
        folder, recordings = self.path(str(number)), self.path(str(number), "recordings")
        os.makedirs(recordings)
        text = installation(extra=f'[record]\nenabled = true\ndirectory = "{recordings}"\n')
        daemon = Daemon(folder, self.write(f"{number}.toml", text))
        self.addCleanup(daemon.close)
        daemon.wait_for_word("READY=1")
        return daemon, recordings

    @staticmethod
    def last_frames(recording):
        """Newest capture time of each camera, ns of CLOCK_MONOTONIC; a row that was cut off is none."""
        last = {}
        with open(os.path.join(recording, "frames.csv"), encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if row["capture_ns"] and row["dropped_before"] is not None:
                    last[row["camera"]] = int(row["capture_ns"])
        return last

    def test_ten_times(self):
        moments = random.Random(7)
        for number in range(KILLS):
            daemon, recordings = self.start(number)
            wait_until(lambda d=daemon: d.metric("sightline_record_frames_total") > 60, "it records")
            time.sleep(moments.uniform(0, 1.2))  # anywhere in the second between two syncs
            killed_ns = time.monotonic_ns()
            daemon.process.send_signal(signal.SIGKILL)
            daemon.process.wait(timeout=WAIT_S)
            (recording,) = glob.glob(os.path.join(recordings, "*"))
            last = self.last_frames(recording)
            self.assertEqual(set(last), set(CAMERAS), read_text(os.path.join(recording, "recording.toml")))
            for camera, capture_ns in last.items():
                self.assertLess((killed_ns - capture_ns) / 1e9, 1.1, f"{camera} of recording {number}: a second and a frame")
            poses = self.path(f"{number}.csv")
            sightline("replay", recording, "--poses", poses)
            # A row for each image that could be decoded: the video itself is there as well.
            newest = max(int(line.split(",")[0]) for line in read_text(poses).splitlines()[1:])
            self.assertLess((killed_ns - newest) / 1e9, 1.1, f"video of recording {number}")


if __name__ == "__main__":
    unittest.main(verbosity=2)
