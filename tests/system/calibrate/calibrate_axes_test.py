#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline calibrate axes` on rendered recordings of a board before a camera on a head: finds the axes with which
they were rendered, within what it claims; and what it refuses, with nothing written."""
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import BIN, ROOT, WAIT_S, TemporaryFolder, read_text, sightline  # noqa: E402

IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
TAGS = """type = "tag_grid"
name = "tags"
columns = 2
rows = 2
marker = 0.12
gap = 0.03
dictionary = "tag36h11"
"""


def product(*matrices):
    out = IDENTITY
    for m in matrices:
        out = [[sum(out[i][k] * m[k][j] for k in range(4)) for j in range(4)] for i in range(4)]
    return out


def inverse(m):
    turned = [[m[j][i] for j in range(3)] for i in range(3)]
    return [row + [-sum(row[k] * m[k][3] for k in range(3))] for row in turned] + [[0, 0, 0, 1]]


def about_z(a):
    return [[math.cos(a), -math.sin(a), 0, 0], [math.sin(a), math.cos(a), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def about_x(a):
    return [[1, 0, 0, 0], [0, math.cos(a), -math.sin(a), 0], [0, math.sin(a), math.cos(a), 0], [0, 0, 0, 1]]


def place(axes, pan_deg, tilt_deg):
    """world_from_camera at these readings, as docs/turning.md has it."""
    pan, tilt = math.radians(pan_deg) * axes.get("pan_scale", 1), math.radians(tilt_deg) * axes.get("tilt_scale", 1)
    return product(axes["world_from_base"], about_z(pan), axes.get("pan_from_tilt", IDENTITY), about_x(tilt),
                   axes["tilt_from_camera"])


def apart(a, b):
    """Degrees and millimeters from one pose to another."""
    d = product(inverse(a), b)
    turn = math.acos(max(-1, min(1, (d[0][0] + d[1][1] + d[2][2] - 1) / 2)))
    return math.degrees(turn), 1e3 * math.sqrt(sum(d[i][3] ** 2 for i in range(3)))


def camera_of(path, name="head"):
    with open(path, "rb") as file:
        return next(c for c in tomllib.load(file)["camera"] if c["name"] == name)


class Recorded(TemporaryFolder):
    @classmethod
    def setUpClass(cls):
        cls.recordings = tempfile.mkdtemp(prefix="sightline_test.")
        cls.addClassCleanup(shutil.rmtree, cls.recordings, ignore_errors=True)

    def recording(self, name, *options):
        """Made once for all tests that name it."""
        folder = os.path.join(self.recordings, name)
        if not os.path.exists(folder):
            subprocess.run([os.path.join(BIN, "make_head_recording"), folder, *options], check=True, timeout=4 * WAIT_S)
        return folder

    def arguments(self, recordings, out, *more, camera="head"):
        return ("calibrate", "axes", *recordings, "--camera", camera, "--calibration",
                os.path.join(recordings[0], "before.toml"), "--target", os.path.join(recordings[0], "board.toml"),
                "--out", out, *more)

    def calibrate(self, recordings, *more, status=0):
        """What it says, its report, and the head's axes."""
        out = self.path("out")
        said, wrong = sightline(*self.arguments(recordings, out, *more), status=status)
        if status != 0:
            return wrong, None, None
        report = json.loads(read_text(os.path.join(out, "axes_report.json")))
        return said, report, camera_of(os.path.join(out, "calibration.toml"))["axes"]

    def expect_near(self, made, truth, report, pans, tilts):
        """Within four of the claimed sigmas of a direction and a place, over the range; and the turns from one reading
        to another, in which the place in the world has no part, to a few hundredths of a degree."""
        middle = [place(axes, 0, 0) for axes in (made, truth)]
        for pan in pans:
            for tilt in tilts:
                ours, theirs = place(made, pan, tilt), place(truth, pan, tilt)
                degrees, millimeters = apart(theirs, ours)
                self.assertLess(degrees, 4 * report["direction_sigma_worst_deg"] + 0.01)
                self.assertLess(millimeters, 4 * report["place_sigma_worst_mm"] + 0.2)
                turned = apart(product(inverse(middle[1]), theirs), product(inverse(middle[0]), ours))
                self.assertLess(turned[0], 0.12)


class Axes(Recorded):
    def test_it_finds_the_axes_that_the_board_was_recorded_with(self):
        one = self.recording("one", "--seed", "1")
        said, report, made = self.calibrate([one])
        truth = camera_of(os.path.join(one, "calibration.toml"))["axes"]
        self.assertEqual(report["grade"], "good", said)
        self.assertEqual(report["settings_at_rest"], 14)
        self.expect_near(made, truth, report, (-10, 0, 10), (-6, 6))
        # It counts pan the other way.
        self.assertAlmostEqual(made["pan_scale"], -1, delta=0.012)
        self.assertAlmostEqual(made["tilt_scale"], 1, delta=0.016)
        self.assertAlmostEqual(made["latency_s"], 0.06, delta=5e-4)
        self.assertLess(made["latency_sigma_s"], 1e-3)
        self.assertAlmostEqual(made["sigma_deg"], 0.05 / math.sqrt(12), delta=0.004)
        self.assertLess(report["held_out_deg"], 0.06)
        self.assertRegex(said, r"head: good at readings of pan from -9\.\d to 1\d\.\d")
        # The others are as they were.
        out = os.path.join(self.path("out"), "calibration.toml")
        left, before = camera_of(out, "left"), camera_of(os.path.join(one, "before.toml"), "left")
        self.assertLess(max(apart(before["world_from_camera"], left["world_from_camera"])), 1e-5)
        self.assertEqual([left[key] for key in ("fx", "cx", "distortion")],
                         [before[key] for key in ("fx", "cx", "distortion")])
        # One page that needs nothing beside it.
        html = read_text(os.path.join(self.path("out"), "axes_report.html"))
        self.assertEqual(html.count("<svg"), html.count("</svg>"))
        self.assertEqual(html.count("<svg"), 6)
        self.assertNotRegex(html, r"<script|https?://|nan")
        # What replays it has a head.
        rig = self.write("rig.toml", f'calibration = "{out}"\n' + "".join(
            f'[[camera]]\nname = "{c}"\nsource = "replay:{one}"\n' for c in ("head", "left")))
        sightline("check", rig)

    def test_play_and_a_board_at_two_places(self):
        two = [self.recording("play1", "--play", "0.3", "--seed", "2", "--settings", "18", "--moving", "0"),
               self.recording("play2", "--play", "0.3", "--seed", "3", "--aside-deg", "30", "--distance", "0.8")]
        _, report, made = self.calibrate(two)
        self.assertEqual(report["settings_at_rest"], 32)
        self.assertAlmostEqual(made["backlash_deg"], 0.3, delta=0.04)
        self.assertAlmostEqual(made["latency_s"], 0.06, delta=1e-3)
        self.assertIn("board in play2", report["world"])

    def test_a_zoom_table(self):
        zoomed = [self.recording("zoom1", "--zooms", "0,500", "--settings", "9", "--moving", "0", "--distance", "0.8"),
                  self.recording("zoom2", "--zooms", "0,500", "--settings", "9", "--moving", "0", "--distance", "1.2",
                                 "--aside-deg", "20", "--seed", "4")]
        wrong, _, _ = self.calibrate(zoomed, status=2)
        self.assertIn("its zoom changes from 0 to 500 between settings: ask for a zoom table (--zoom)", wrong)
        self.assertFalse(os.path.exists(self.path("out")))
        _, report, made = self.calibrate(zoomed, "--zoom")
        rows = made["zoom"]
        self.assertEqual([row["setting"] for row in rows], [0, 500])
        for row, focal in zip(rows, (420, 630)):
            self.assertLess(abs(row["fx"] - focal), 4 * row["sigma"] * focal)
            self.assertLess(row["sigma"], 0.003)
        self.assertEqual(len(report["zoom"]), 2)

    def test_tags_in_the_room_whose_place_is_known(self):
        """No camera beside it; the tags stand where the file says."""
        target = self.write("tags.toml", TAGS)
        room = self.recording("tags", "--board", target, "--seed", "5")
        _, _, free = self.calibrate([room])
        report = json.loads(read_text(os.path.join(self.path("out"), "axes_report.json")))
        self.assertIn("cameras that stand still", report["world"])
        # Said to stand elsewhere, a meter higher: the head is a meter higher, whatever the other camera sees.
        known = self.write("known.toml", TAGS + "fixed = true\nworld_from_target = "
                           "[[1, 0, 0, 0.2], [0, -1, 0, 0.1], [0, 0, -1, 1], [0, 0, 0, 1]]\n")
        out = self.path("known")
        sightline("calibrate", "axes", room, "--camera", "head", "--calibration", os.path.join(room, "before.toml"),
                  "--target", known, "--out", out, "--world", "target")
        lying = camera_of(os.path.join(out, "calibration.toml"))["axes"]
        alone = self.head_alone(os.path.join(room, "before.toml"), "alone.toml")
        sightline("calibrate", "axes", room, "--camera", "head", "--calibration", alone, "--target", known,
                  "--out", out)
        placed = camera_of(os.path.join(out, "calibration.toml"))["axes"]
        report = json.loads(read_text(os.path.join(out, "axes_report.json")))
        self.assertIn("the known place of tags", report["world"])
        moved = product([[1, 0, 0, 0.2], [0, 1, 0, 0.1], [0, 0, 1, 1], [0, 0, 0, 1]], place(lying, 5, -3))
        degrees, millimeters = apart(moved, place(placed, 5, -3))
        self.assertLess(degrees, 0.01)
        self.assertLess(millimeters, 0.2)
        turns = [apart(place(axes, 0, 0), place(axes, 0, 5))[0] for axes in (lying, free)]
        self.assertAlmostEqual(turns[0], turns[1], delta=0.02)

    def test_the_head_of_a_recording_is_calibrated_as_it_was_rendered(self):
        """The rig of recordings/turning: with the made axes its head looks where it looked."""
        target = self.write("tags.toml", TAGS)
        rig = os.path.join(ROOT, "recordings", "turning", "calibration.toml")
        made_of = [self.recording(f"turning{i}", "--calibration", rig, "--board", target, "--distance", "0.75",
                                  "--aside-deg", str(15 * i + 10), "--pan-range", "14", "--tilt-range", "9",
                                  "--rate", "15", "--seed", str(i)) for i in (1, 2)]
        _, report, made = self.calibrate(made_of)
        self.assertEqual(report["grade"], "good")
        self.expect_near(made, camera_of(rig)["axes"], report, (-14, 0, 14), (-4, 4))
        for pan in (-14, 14):
            degrees, millimeters = apart(place(camera_of(rig)["axes"], pan, 0), place(made, pan, 0))
            self.assertLess(degrees, 0.08)
            self.assertLess(millimeters, 2)


    def test_replayed_with_it_a_head_is_as_good_as_with_the_true_axes(self):
        """Alone before a board that is an object, turning to and fro; median position against the truth."""
        aside = self.recording("aside", "--seed", "2", "--aside-deg", "20", "--distance", "0.8")
        _, report, _ = self.calibrate([self.recording("one", "--seed", "1"), aside])
        truth = self.head_alone(os.path.join(self.recordings, "one", "calibration.toml"), "truth.toml")
        made = self.head_alone(os.path.join(self.path("out"), "calibration.toml"), "made.toml")
        shown = self.recording("object", "--calibration", truth, "--object", "--seed", "9", "--settings", "4",
                               "--moving", "8", "--rate", "15")
        medians = []
        for calibration in (truth, made):
            shutil.copy(calibration, os.path.join(shown, "calibration.toml"))
            poses = self.path("poses.csv")
            sightline("replay", shown, "--poses", poses)
            said, _ = sightline("evaluate", os.path.join(shown, "truth.csv"), poses, "--json")
            board = json.loads(said)["objects"][0]
            self.assertGreater(board["errors"]["count"], 100)
            medians.append(board["errors"]["median_mm"])
        claimed = math.hypot(report["place_sigma_worst_mm"], 1e3 * math.radians(report["direction_sigma_worst_deg"]))
        self.assertLess(medians[1], medians[0] + 3 * claimed, (medians, claimed))

    def head_alone(self, calibration, name):
        text = read_text(calibration)
        return self.write(name, text[:text.index("[[camera]]", text.index("[[camera]]") + 1)])


class Refusals(Recorded):
    def refused(self, recordings, *more, camera="head"):
        out = self.path("out")
        _, wrong = sightline(*self.arguments(recordings, out, *more, camera=camera), status=2)
        self.assertFalse(os.path.exists(out), "something was written")
        return wrong

    def altered(self, change):
        """A copy of a recording, its axes.csv changed; None: without."""
        folder = self.path("altered")
        shutil.copytree(self.recording("one", "--seed", "1"), folder)
        path = os.path.join(folder, "axes.csv")
        rows = read_text(path).split("\n")
        os.remove(path)
        if change is not None:
            self.write("altered/axes.csv", "\n".join(rows[:1] + [change(row) if row else row for row in rows[1:]]))
        return folder

    def test_by_name(self):
        one = self.recording("one", "--seed", "1")
        self.assertIn("camera other: is not in the calibration", self.refused([one], camera="other"))
        self.assertIn("has no angles of camera left (axes.csv)", self.refused([one], camera="left"))
        self.assertIn("--lens", self.refused([one], "--lens", "sharp"))
        self.assertIn("a zoom table is asked for, and the zoom stands at 0", self.refused([one], "--zoom"))

    def test_no_angles(self):
        self.assertIn("has no angles of camera head (axes.csv)", self.refused([self.altered(None)]))

    def test_angles_that_never_change(self):
        still = self.altered(lambda row: re.sub(r"^(head,\d+),[^,]*,[^,]*,", r"\1,1.0,2.0,", row))
        self.assertIn("its angles never change", self.refused([still]))

    def test_angles_that_are_no_numbers(self):
        self.assertIn("axes.csv:2", self.refused([self.altered(
            lambda row: re.sub(r"^(head,\d+),[^,]*,", r"\1,nan,", row))]))

    def test_one_axis_alone(self):
        level = self.recording("level", "--tilt-range", "0.4", "--moving", "0")
        self.assertIn("only one axis was turned", self.refused([level]))

    def test_too_few_settings(self):
        self.assertIn("is seen at 4 settings of the head at rest, 8 are needed",
                      self.refused([self.recording("few", "--settings", "4", "--moving", "0")]))

    def test_frozen_angles(self):
        self.assertIn("the angles are frozen while the picture turns",
                      self.refused([self.recording("frozen", "--frozen")]))

    def test_a_board_that_is_carried_away(self):
        wrong = self.refused([self.recording("carried", "--carried")])
        self.assertRegex(wrong, r"camera left: sees the board \d+\.\d px from where it was")

    def test_another_target(self):
        one = self.recording("one", "--seed", "1")
        target = self.write("tags.toml", TAGS)
        out = self.path("out")
        _, wrong = sightline("calibrate", "axes", one, "--camera", "head", "--calibration",
                             os.path.join(one, "before.toml"), "--target", target, "--out", out, status=2)
        self.assertRegex(wrong, r"camera head: the .* is in none of its \d+ images")
        self.assertIn("4X4_50", wrong)
        self.assertFalse(os.path.exists(out))


class InForce(Recorded):
    def test_the_calibration_that_is_read_is_never_written(self):
        one = self.recording("one", "--seed", "1")
        force = self.path("force")
        os.mkdir(force)
        shutil.copy(os.path.join(one, "before.toml"), os.path.join(force, "calibration.toml"))
        before = read_text(os.path.join(force, "calibration.toml"))
        _, wrong = sightline("calibrate", "axes", one, "--camera", "head", "--calibration",
                             os.path.join(force, "calibration.toml"), "--target", os.path.join(one, "board.toml"),
                             "--out", force, status=2)
        self.assertIn("has the calibration that is read: name another folder", wrong)
        self.assertEqual(read_text(os.path.join(force, "calibration.toml")), before)
        self.assertEqual(os.listdir(force), ["calibration.toml"])

    def test_interrupted_it_leaves_what_was_there(self):
        one = self.recording("one", "--seed", "1")
        out = self.path("out")
        os.mkdir(out)
        shutil.copy(os.path.join(one, "before.toml"), os.path.join(out, "calibration.toml"))
        before = read_text(os.path.join(out, "calibration.toml"))
        process = subprocess.Popen([os.path.join(BIN, "sightline"), *self.arguments([one], out)],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.kill)
        time.sleep(0.3)  # whatever it has come to
        process.send_signal(signal.SIGINT)
        process.wait(timeout=WAIT_S)
        text = read_text(os.path.join(out, "calibration.toml"))
        if process.returncode != 0:
            self.assertEqual(text, before)
            self.assertEqual(os.listdir(out), ["calibration.toml"])
        tomllib.loads(text)  # the old one or the new one


if __name__ == "__main__":
    unittest.main(verbosity=2)
