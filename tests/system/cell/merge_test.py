#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline merge`: what two hosts recorded of one rig is, put together, what one host would have recorded."""
import os
import shutil
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import BENCH, TemporaryFolder, read_text, sightline  # noqa: E402

S = 10**9
BEGAN = "2026-05-04T12:00:00"


class Merge(TemporaryFolder):
    def part(self, name, cameras, shift_ns=0, start=BEGAN + "Z", start_ns=0):
        """The recording's cameras as a host would have them whose clock is so far ahead."""
        folder = self.path(name)
        os.mkdir(folder)
        for common in ("objects", "calibration.toml", "scene.obj"):
            copy = shutil.copytree if common == "objects" else shutil.copy
            copy(os.path.join(BENCH, common), os.path.join(folder, common))
        text = f'format = 1\nname = "{name}"\nobjects = ["objects/carton.toml"]\nscene = "scene.obj"\n'
        if start:
            text += f"start_utc = {start}\nstart_monotonic_ns = {start_ns}\n"
        for camera in cameras:
            text += f'[[camera]]\nname = "{camera}"\nfile = "{camera}.mkv"\ncodec = "h264"\nwidth = 640\nheight = 480\n'
            shutil.copy(os.path.join(BENCH, camera + ".mkv"), folder)
        self.write(os.path.join(name, "recording.toml"), text)
        header, *rows = read_text(os.path.join(BENCH, "frames.csv")).splitlines()
        mine = []
        for row in rows:
            camera, sequence, capture, arrival, dropped = row.split(",")
            if camera in cameras:
                mine.append(f"{camera},{sequence},{int(capture) + shift_ns},{int(arrival) + shift_ns},{dropped}")
        self.write(os.path.join(name, "frames.csv"), "\n".join([header] + mine) + "\n")
        return folder

    def poses(self, recording, name):
        sightline("replay", recording, "--poses", self.path(name))
        return read_text(self.path(name))

    def refused(self, *folders):
        _, err = sightline("merge", *folders, self.path("out"), status=2)
        self.assertFalse(os.path.exists(self.path("out")))
        return err

    def test_the_whole_is_what_one_host_would_have_recorded(self):
        a = self.part("a", ["left"])
        # It began half a second later, with a clock of its own, and writes another zone.
        b = self.part("b", ["right", "side"], 700 * S - S // 2, "2026-05-04T14:00:00.5+02:00", 700 * S)
        out = self.path("out")
        sightline("merge", a, b, out)
        rows, expected = (sorted(read_text(os.path.join(folder, "frames.csv")).splitlines()) for folder in (out, BENCH))
        self.assertEqual(rows, expected)
        times = [int(row.split(",")[2]) for row in read_text(os.path.join(out, "frames.csv")).splitlines()[1:]]
        self.assertEqual(times, sorted(times))
        for camera in ("left", "right", "side"):
            with open(os.path.join(out, camera + ".mkv"), "rb") as copy, open(os.path.join(BENCH, camera + ".mkv"), "rb") as video:
                self.assertEqual(copy.read(), video.read())
        # Neither its own names nor those of the scene may matter to what is estimated.
        self.assertEqual(self.poses(out, "merged.csv"), self.poses(BENCH, "bench.csv"))
        # A recording that has been made of others can be merged again.
        again = self.path("again")
        _, err = sightline("merge", out, self.part("c", ["left"]), again, status=2)
        self.assertIn("camera left is in", err)

    def test_poses_of_all_hosts_are_kept(self):
        a, b = self.part("a", ["left"]), self.part("b", ["right"], 5 * S, BEGAN + "Z", 5 * S)
        sightline("replay", a, "--poses", os.path.join(a, "poses.csv"))
        sightline("replay", b, "--poses", os.path.join(b, "poses.csv"))
        out = self.path("out")
        sightline("merge", a, b, out)
        rows = read_text(os.path.join(out, "poses.csv")).splitlines()[1:]
        count = sum(len(read_text(os.path.join(folder, "poses.csv")).splitlines()) - 1 for folder in (a, b))
        self.assertEqual(len(rows), count)
        first = [int(read_text(os.path.join(folder, "poses.csv")).splitlines()[1].split(",")[0]) for folder in (a, b)]
        self.assertEqual(int(rows[0].split(",")[0]), min(first[0], first[1] - 5 * S))

    def test_what_does_not_agree_is_named(self):
        a, b = self.part("a", ["left"]), self.part("b", ["right"])
        self.assertIn("does not say how its clock relates to UTC", self.refused(a, self.part("n", ["side"], start="")))
        calibration = os.path.join(b, "calibration.toml")
        before = read_text(calibration)
        self.assertEqual(before.count("fx = "), 3)
        at = before.index("fx = ") + len("fx = ")
        self.write(calibration, before[:at] + "1" + before[at:])
        self.assertRegex(self.refused(a, b), r"camera left has another calibration in .*/a")
        self.write(calibration, before)
        carton = os.path.join(b, "objects", "carton.toml")
        before = read_text(carton)
        self.write(carton, before + "# changed\n")
        self.assertRegex(self.refused(a, b), r"/b: object carton is another one in .*/a")
        self.write(carton, before.replace('"carton"', '"box"'))
        self.assertRegex(self.refused(a, b), r"/b: lacks object carton")
        self.write(carton, before)
        os.mkdir(self.path("full"))
        self.write("full/mine", "")
        _, err = sightline("merge", a, b, self.path("full"), status=2)
        self.assertIn("is not empty", err)
        sightline("merge", a, self.path("out"), status=2)
        later = self.part("later", ["side"], 0, "2026-05-05T12:00:00Z")
        _, err = sightline("merge", a, later, self.path("apart"))
        self.assertIn("have no time in common", err)


if __name__ == "__main__":
    unittest.main(verbosity=2)
