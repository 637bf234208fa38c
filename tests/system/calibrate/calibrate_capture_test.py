#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline calibrate capture` with cameras that play a recording of somebody who holds a board: takes views, says what
is missing, stops by itself with a good report; interrupted, it writes what it has, and what is in force stays as it is."""
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import BIN, ROOT, WAIT_S, TemporaryFolder, read_text, sightline, wait_until  # noqa: E402

SHARED = os.path.join(ROOT, "..", "shared", "recordings")


class Recorded(TemporaryFolder):
    """A recording, made once for all tests."""

    @classmethod
    def setUpClass(cls):
        import tempfile
        cls.recordings = tempfile.mkdtemp(prefix="sightline_test.")
        cls.recording = os.path.join(cls.recordings, "shown")
        subprocess.run([os.path.join(BIN, "make_board_recording"), cls.recording], check=True, timeout=4 * WAIT_S)

    @classmethod
    def tearDownClass(cls):
        import shutil
        shutil.rmtree(cls.recordings, ignore_errors=True)

    def rig(self, extra="", recording=None, cameras=("left", "right")):
        text = extra
        for camera in cameras:
            text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{recording or self.recording}"\n'
        return self.write("rig.toml", text)

    def target(self):
        return os.path.join(self.recording, "board.toml")

    def arguments(self, config, out, *more):
        return ("calibrate", "capture", "--config", config, "--target", self.target(), "--out", out, *more)

    def begin(self, *arguments):
        """In the background, with what it says in a file."""
        self.said = self.path("said.txt")
        log = open(self.said, "w", encoding="utf-8")
        self.addCleanup(log.close)
        process = subprocess.Popen([os.path.join(BIN, "sightline"), *arguments], stdout=log, stderr=log)
        self.addCleanup(process.kill)
        return process

    def sets(self, out):
        """That corners.csv has; 0 before there is any."""
        path = os.path.join(out, "corners.csv")
        if not os.path.exists(path):
            return 0
        rows = [line for line in read_text(path).split("\n") if line[:1].isdigit()]
        return len({row.split(",")[0] for row in rows})

    def calibration(self, path):
        with open(path, "rb") as file:
            return {camera["name"]: camera for camera in tomllib.load(file)["camera"]}


class Capture(Recorded):
    def test_it_ends_by_itself_with_a_good_report(self):
        out = self.path("out")
        said, steps = sightline(*self.arguments(self.rig(), out))
        self.assertNotIn("left open", steps)
        self.assertIn("show it the board", steps)
        self.assertRegex(steps, r"left: show the board (in|at) the \w+")
        self.assertRegex(steps, r"tilted: its \w+ edge \(in the picture\) towards the camera")
        report = json.loads(read_text(os.path.join(out, "report.json")))
        self.assertEqual(report["grade"], "good", said)
        made, true = self.calibration(os.path.join(out, "calibration.toml")), self.calibration(
            os.path.join(self.recording, "calibration.toml"))
        for name in ("left", "right"):
            for key in ("fx", "fy", "cx", "cy"):
                sigma = made[name]["sigmas"][key]
                self.assertLess(abs(made[name][key] - true[name][key]), 6 * sigma, f"{name} {key}")
                self.assertLess(sigma, 3)
        base = [sum((true["left"]["world_from_camera"][i][3] - true["right"]["world_from_camera"][i][3]) ** 2
                    for i in range(3)), sum(made["right"]["world_from_camera"][i][3] ** 2 for i in range(3))]
        self.assertLess(abs(math.sqrt(base[0]) - math.sqrt(base[1])), 0.005)
        # What can be looked at, and solved again.
        for name in ("coverage_left.svg", "coverage_right.svg", "capture.html", "report.html"):
            self.assertIn("<svg", read_text(os.path.join(out, name)), name)
        self.assertNotIn("http-equiv=\"refresh\"", read_text(os.path.join(out, "capture.html")))
        again, _ = sightline("calibrate", "solve", os.path.join(out, "corners.csv"), "--out", self.path("again"))
        self.assertEqual(again.split("\n")[0], said.split("\n")[0])
        # Nothing is written over.
        _, error = sightline(*self.arguments(self.rig(), out), status=2)
        self.assertIn("is of an earlier capture: --resume goes on with it", error)

    def test_interrupted_it_writes_what_it_has_and_what_is_in_force_stays(self):
        force = os.path.join(self.recording, "calibration.toml")
        config = self.rig(extra=f'calibration = "{force}"\n')
        before = read_text(force)
        out = self.path("out")
        process = self.begin(*self.arguments(config, out))
        wait_until(lambda: self.sets(out) >= 11 or process.poll() is not None, "eleven sets are taken")
        self.assertIn("http-equiv=\"refresh\"", read_text(os.path.join(out, "capture.html")))
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=WAIT_S), 0, read_text(self.said))
        self.assertIn("left open: ", read_text(self.said))
        self.assertIn("calibration.toml", read_text(self.said))
        taken = self.sets(out)
        self.assertGreaterEqual(taken, 11)
        self.assertEqual(read_text(force), before)
        # Killed at any moment nothing that was taken is lost, and it goes on from there.
        process = self.begin(*self.arguments(config, out, "--resume"))
        wait_until(lambda: self.sets(out) > taken or process.poll() is not None, "another set is taken")
        process.kill()
        process.wait(timeout=WAIT_S)
        self.assertGreater(self.sets(out), taken)
        self.assertEqual(read_text(force), before)
        self.assertEqual(len(self.calibration(os.path.join(out, "calibration.toml"))), 2)

    def test_one_look_places_the_world(self):
        lying = self.path("lying")
        subprocess.run([os.path.join(BIN, "make_board_recording"), lying, "--floor", "--held", "3"], check=True, timeout=WAIT_S)
        out = self.path("floor")
        said, _ = sightline(*self.arguments(self.rig(recording=lying), out, "--sets", 1, "--corners-only"))
        self.assertIn("1 sets written", said)
        self.assertFalse(os.path.exists(os.path.join(out, "calibration.toml")))
        sightline("calibrate", "world", os.path.join(out, "corners.csv"), "--calibration",
                  os.path.join(self.recording, "calibration.toml"), "--out", self.path("world.toml"))
        for camera in self.calibration(self.path("world.toml")).values():
            self.assertAlmostEqual(camera["world_from_camera"][2][3], 0.53, delta=0.15)  # above the floor
        # It was not moved, so that there is no axis.
        _, error = sightline("calibrate", "world", os.path.join(out, "corners.csv"), "--motion", "x", "--calibration",
                             self.path("world.toml"), "--out", self.path("turned.toml"), status=2)
        self.assertIn("at 1 places, 5 or more are needed", error)
        self.assertFalse(os.path.exists(self.path("turned.toml")))

    def test_too_early_it_says_what_is_missing(self):
        out = self.path("out")
        process = self.begin(*self.arguments(self.rig(), out))
        wait_until(lambda: self.sets(out) >= 2 or process.poll() is not None, "two sets are taken")
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(timeout=WAIT_S), 2, read_text(self.said))
        self.assertRegex(read_text(self.said), "too few views|does not determine|not linked|no tilt|no change of distance")
        self.assertFalse(os.path.exists(os.path.join(out, "calibration.toml")))
        self.assertGreaterEqual(self.sets(out), 2)

    def test_what_cannot_be_is_refused(self):
        force = os.path.join(self.recording, "calibration.toml")
        config = self.rig(extra=f'calibration = "{force}"\n')
        _, error = sightline(*self.arguments(config, self.recording), status=2)
        self.assertIn("is the calibration in force", error)
        _, error = sightline("calibrate", "capture", "--config", config, "--out", self.path("out"), status=2)
        self.assertIn("say which target is shown: --target", error)
        _, error = sightline(*self.arguments(config, self.path("out"), "--camera", "top"), status=2)
        self.assertIn("has no camera 'top'", error)
        _, error = sightline(*self.arguments(self.rig(cameras=("left", "middle")), self.path("out")), status=2)
        self.assertIn("the recording has no camera \"middle\"", error)

    def test_a_camera_that_is_not_there_is_named(self):
        config = self.write("absent.toml", '[[camera]]\nname = "left"\nsource = "v4l2:/dev/video99"\n')
        _, error = sightline(*self.arguments(config, self.path("out")), status=3)
        self.assertRegex(error, r"camera left: no image in 20 s: no camera '/dev/video99'")

    def test_a_flipped_print_is_refused_while_it_is_shown(self):
        text = read_text(self.target()).replace('layout = "dark_first"', 'layout = "marker_first"')
        target = self.write("other.toml", text)
        _, error = sightline("calibrate", "capture", "--config", self.rig(), "--target", target, "--out", self.path("out"),
                             status=2)
        self.assertIn("the other layout for its even number of rows", error)
        self.assertFalse(os.path.exists(self.path("out", "calibration.toml")))

    def test_tags_that_stand_in_the_room_take_part(self):
        recording = self.path("wall")
        subprocess.run([os.path.join(BIN, "make_board_recording"), recording, "--wall", "--poses", "8", "--held", "0.3"],
                       check=True, timeout=4 * WAIT_S)
        board, wall = os.path.join(recording, "board.toml"), os.path.join(recording, "wall.toml")
        arguments = ("calibrate", "solve", recording, "--target", board, "--intrinsics",
                     os.path.join(recording, "calibration.toml"))
        sightline(*arguments, "--out", self.path("without"))
        sightline(*arguments, "--target", wall, "--out", self.path("with"))
        corners = read_text(self.path("with", "corners.csv"))
        self.assertIn("#other fixed = true", corners)
        rows = [row.split(",") for row in corners.split("\n") if row[:1].isdigit()]
        fixed = {(row[0], row[1]) for row in rows if int(row[3]) >= 35}
        self.assertEqual(len({row[0] for row in fixed}), 1, "one set for the whole recording")
        self.assertEqual({camera for _, camera in fixed}, {"left", "right"})
        true = self.calibration(os.path.join(recording, "calibration.toml"))["right"]["world_from_camera"]
        for folder in ("without", "with"):
            made = self.calibration(self.path(folder, "calibration.toml"))["right"]["world_from_camera"]
            self.assertLess(max(abs(made[i][3] - true[i][3]) for i in range(3)), 0.005, folder)
        again, _ = sightline("calibrate", "solve", self.path("with", "corners.csv"), "--intrinsics",
                             os.path.join(recording, "calibration.toml"), "--out", self.path("again"))
        self.assertIn("corners in the fit", again)
        _, error = sightline(*arguments, "--target", board, "--out", self.path("no"), status=2)
        self.assertIn("nothing tells it from the ChArUco board", error)

    def test_cameras_without_a_calibration_are_recorded_and_solved_from_that(self):
        out, config = self.path("recorded"), self.rig()
        _, said = sightline("record", "--config", config, out, "--seconds", "12")
        self.assertIn("no calibration yet: images are recorded, without poses", said)
        self.assertEqual(sorted(os.listdir(out)), ["frames.csv", "left.mkv", "recording.toml", "right.mkv"])
        rows = read_text(os.path.join(out, "frames.csv")).strip().split("\n")[1:]
        for camera in ("left", "right"):
            self.assertGreater(sum(row.startswith(camera + ",") for row in rows), 60, camera)
        # Each is played by a clock of its own, and the target moves between its poses.
        said, _ = sightline("calibrate", "solve", out, "--target", self.target(), "--time-offsets", "--out", self.path("solved"))
        self.assertEqual(set(self.calibration(os.path.join(self.path("solved"), "calibration.toml"))), {"left", "right"})
        # At once, not when each camera has sent something.
        _, error = sightline("record", "--config", config, out, "--seconds", "1", status=2)
        self.assertIn("recordings are never overwritten", error)
        # A camera that is not there is named, and no folder is left.
        config = self.write("rig.toml", '[[camera]]\nname = "gone"\nsource = "v4l2:/dev/video-none"\n')
        _, error = sightline("record", "--config", config, self.path("none"), "--seconds", "1", status=3)
        self.assertIn("nothing was recorded", error)
        self.assertFalse(os.path.exists(self.path("none")))

    def test_the_readout_of_rolling_shutters_is_recovered(self):
        """Every row of an image is drawn with the board where it is when that row is exposed."""
        readout_s = 0.03
        recording = self.path("rolling")
        subprocess.run([os.path.join(BIN, "make_board_recording"), recording, "--moving", "--poses", "24", "--readout",
                        str(readout_s)], check=True, timeout=8 * WAIT_S)
        arguments = ("calibrate", "solve", recording, "--target", os.path.join(recording, "board.toml"))
        said, _ = sightline(*arguments, "--time-offsets", "--out", self.path("global"))
        self.assertIn("have that solved for as well (--readouts)", said)
        sightline(*arguments, "--time-offsets", "--readouts", "--out", self.path("solved"))
        report = json.loads(read_text(self.path("solved", "report.json")))
        before = json.loads(read_text(self.path("global", "report.json")))
        made = self.calibration(self.path("solved", "calibration.toml"))
        print("held out", before["held_out_px"], report["held_out_px"], "px; read-outs",
              {name: camera["readout_s"] for name, camera in made.items()})
        self.assertLess(report["held_out_px"], 0.7 * before["held_out_px"])
        for name, camera in made.items():
            true = self.calibration(os.path.join(recording, "calibration.toml"))[name]["readout_s"]
            self.assertEqual(abs(true), readout_s if name == "right" else readout_s / 2)
            self.assertLess(abs(camera["readout_s"] - true), 0.0015, name)

    def test_late_stamps_of_a_moving_board_are_recovered(self):
        """A board that is never held still, before two cameras; the stamps of one are wrong by what is known."""
        late_s = 0.024
        recording = self.path("moved")
        subprocess.run([os.path.join(BIN, "make_board_recording"), recording, "--moving"], check=True, timeout=4 * WAIT_S)
        path = os.path.join(recording, "frames.csv")
        rows = [line.split(",") for line in read_text(path).strip().split("\n")]
        capture = rows[0].index("capture_ns")
        for row in rows[1:]:
            if row[0] == "right":  # its images were taken later than it says
                row[capture] = str(int(row[capture]) - round(late_s * 1e9))
        with open(path, "w", encoding="utf-8") as file:
            file.write("".join(",".join(row) + "\n" for row in rows))
        out = self.path("out")
        said, _ = sightline("calibrate", "capture", "--config", self.rig(recording=recording), "--target",
                            os.path.join(recording, "board.toml"), "--out", out, "--moving", "--json")
        report = json.loads(read_text(os.path.join(out, "report.json")))
        cameras = {camera["name"]: camera for camera in report["cameras"]}
        calibrated = self.calibration(os.path.join(out, "calibration.toml"))
        offset = calibrated["right"].get("time_offset_s", 0) - calibrated["left"].get("time_offset_s", 0)
        self.assertAlmostEqual(offset, late_s, delta=0.005)
        for name in ("left", "right"):
            self.assertLess(cameras[name]["held_out_px"], 1.0, said)
        # Corners carry their motion: that is what offsets are found by.
        with open(os.path.join(out, "corners.csv"), encoding="utf-8") as file:
            rows = [line.strip().split(",") for line in file if not line.startswith("#")]
        head = next(row for row in rows if "du" in row)
        motion = [math.hypot(float(row[head.index("du")]), float(row[head.index("dv")])) for row in rows if row[0].isdigit()]
        self.assertGreater(sorted(motion)[len(motion) // 2], 5)

    def test_a_moving_board_in_rendered_footage(self):
        recording = os.path.join(SHARED, "bench-calibration")
        if not os.path.exists(recording):
            self.skipTest(f"no {recording}")
        out = self.path("out")
        config = self.rig(recording=recording, cameras=("left", "right", "side"))
        sightline("calibrate", "capture", "--config", config, "--target", os.path.join(recording, "objects", "board.toml"),
                  "--out", out, "--moving", "--intrinsics", os.path.join(recording, "calibration.toml"), "--json")
        report = json.loads(read_text(os.path.join(out, "report.json")))
        self.assertEqual(len(report["cameras"]), 3)


if __name__ == "__main__":
    unittest.main()
