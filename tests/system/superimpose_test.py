#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline superimpose`: points known in the second camera's frame, in the third camera's image; against an
independent projection of the truth, and with everything a person may give wrong."""
import csv
import json
import os
import subprocess
import sys
import unittest

from support import BENCH, ROOT, TemporaryFolder, read_text, sightline

sys.path.insert(0, os.path.join(ROOT, "tests", "demo"))
import truth_view  # noqa: E402

FRAME = 89  # the carton stands free of the monitor, seen by all three cameras
CALIBRATION = os.path.join(BENCH, "calibration.toml")


def transposed_pose(camera):
    """camera_from_world as (rows of R, t) from the rows of world_from_camera."""
    rows = camera["pose"]
    rotation = [[rows[k][i] for k in range(3)] for i in range(3)]
    shift = [-sum(rotation[i][k] * rows[k][3] for k in range(3)) for i in range(3)]
    return rotation, shift


def into_camera(camera, point):
    rotation, shift = transposed_pose(camera)
    return [sum(rotation[i][k] * point[k] for k in range(3)) + shift[i] for i in range(3)]


def matrix(name, rows):
    numbers = ", ".join(repr(float(x)) for row in rows for x in row)
    return f"{name}: !!opencv-matrix\n   rows: {len(rows)}\n   cols: {len(rows[0])}\n   dt: d\n   data: [ {numbers} ]\n"


def opencv_yaml(camera, scale=1.0, size=(640, 480)):
    rotation, shift = transposed_pose(camera)
    text = "%YAML:1.0\n---\n"
    if size:
        text += f"image_width: {size[0]}\nimage_height: {size[1]}\n"
    text += matrix("camera_matrix", [[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    text += matrix("distortion_coefficients", [camera["distortion"]])
    text += matrix("R", rotation) + matrix("T", [[x * scale] for x in shift])
    return text


class Superimpose(TemporaryFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.shared = TemporaryFolder()
        cls.shared.setUp()
        cls.addClassCleanup(cls.shared.doCleanups)
        cls.image = cls.shared.path("side.png")
        subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-i", os.path.join(BENCH, "side.mkv"), "-vf",
                        f"select=eq(n\\,{FRAME})", "-frames:v", "1", "-y", cls.image], check=True, timeout=120)
        cls.left = truth_view.read_camera(CALIBRATION, "left")
        cls.side = truth_view.read_camera(CALIBRATION, "side")
        t_ns = truth_view.read_frames(os.path.join(BENCH, "frames.csv"), "side")[FRAME]
        cls.t_ns = t_ns
        cls.pose = truth_view.read_truth(os.path.join(BENCH, "truth.csv"))[t_ns]
        box = sorted(set(truth_view.read_vertices(os.path.join(BENCH, "objects", "carton.obj"))))
        cls.corners = [cls.in_world(p) for p in box]
        cls.edges = [cls.in_world([a[k] + (b[k] - a[k]) * s / 20 for k in range(3)])
                     for a in box for b in box if a < b and sum(x != y for x, y in zip(a, b)) == 1
                     for s in range(1, 20)]

    @classmethod
    def in_world(cls, point):
        turned = truth_view.rotate(cls.pose[1], point)
        return [turned[i] + cls.pose[0][i] for i in range(3)]

    def points(self, name, points, scale=1.0):
        return self.write(name, "# x y z\n" + "".join(" ".join(f"{x * scale:.9f}" for x in p) + "\n" for p in points))

    def in_left(self, points):
        return [into_camera(self.left, p) for p in points]

    def run_it(self, *arguments, status=0):
        return sightline("superimpose", "--image", self.image, "--out", self.path("out.png"), *arguments, status=status)

    def rows(self, table):
        return list(csv.DictReader(table.splitlines()))

    def check_pixels(self, rows, world):
        self.assertEqual(len(rows), len(world))
        worst = 0
        for row, point in zip(rows, world):
            u, v = truth_view.project(self.side, point)
            worst = max(worst, abs(float(row["u_px"]) - u), abs(float(row["v_px"]) - v))
        self.assertLess(worst, 0.01)
        return worst

    def test_points_of_the_second_camera_in_the_third_by_opencv_files(self):
        edges = self.points("edges.txt", self.in_left(self.edges))
        corners = self.points("corners.txt", self.in_left(self.corners))
        left, side = self.write("second.yml", opencv_yaml(self.left)), self.write("third.yml", opencv_yaml(self.side))
        table, _ = self.run_it("--points", edges, "--points", corners, "--from", left, "--to", side)
        rows = self.rows(table)
        print(f"largest difference from the independent projection: {self.check_pixels(rows, self.edges + self.corners):.4f} px")
        self.assertEqual({r["kind"] for r in rows}, {"edge", "corner"})
        self.assertEqual({r["state"] for r in rows}, {"visible"})
        self.assertGreater(os.path.getsize(self.path("out.png")), 100000)

    def test_millimeters_world_frame_and_calibration_toml_come_to_the_same(self):
        corners = self.points("mm.txt", self.corners, 1000)
        table, _ = self.run_it("--points", f"corners:{corners}", "--points-frame", "world", "--points-unit", "mm",
                               "--to", f"{CALIBRATION}#side", "--marker", "circle")
        self.check_pixels(self.rows(table), self.corners)
        left = self.write("mm.yml", opencv_yaml(self.left, 1000))
        side = self.write("side_mm.yml", opencv_yaml(self.side, 1000, None))
        second = self.points("left_mm.txt", self.in_left(self.corners), 1000)
        table, _ = self.run_it("--points", second, "--points-unit", "mm", "--camera-unit", "mm", "--from", left, "--to",
                               side, "--marker", "none")
        self.check_pixels(self.rows(table), self.corners)

    def test_points_already_in_the_third_frame_only_when_said_so(self):
        third = self.points("third.txt", [into_camera(self.side, p) for p in self.corners])
        side = f"{CALIBRATION}#side"
        self.assertIn("--points-frame", self.run_it("--points", third, "--to", side, status=2)[1])
        table, _ = self.run_it("--points", third, "--to", side, "--points-frame", "to")
        self.check_pixels(self.rows(table), self.corners)
        words = self.run_it("--points", third, "--to", side, "--from", side, "--points-frame", "to", status=2)[1]
        self.assertIn("--from", words)

    def test_mesh_hides_the_points_behind_it(self):
        corners = self.points("corners.txt", self.corners)
        mesh = os.path.join(BENCH, "objects", "carton.obj")
        pose = [*self.pose[0], *self.pose[1]]
        arguments = ["--points", corners, "--points-frame", "world", "--to", f"{CALIBRATION}#side", "--mesh", mesh,
                     "--pose", *pose]
        summary = json.loads(self.run_it(*arguments, "--table", self.path("t.csv"), "--json")[0])
        self.assertEqual(summary["states"], {"visible": 7, "hidden": 1})  # a box shows seven of its eight corners
        hidden = [r for r in self.rows(read_text(self.path("t.csv"))) if r["state"] == "hidden"]
        farthest = max(self.rows(read_text(self.path("t.csv"))), key=lambda r: float(r["z_camera"]))
        self.assertEqual(hidden[0]["line"], farthest["line"])

    def test_what_left_and_right_reconstruct_lies_right_in_side(self):
        """The experiment this grew from: points of the stereo pair, superimposed in the third camera."""
        cloud = self.path("points.ply")
        sightline("replay", BENCH, "--points", cloud)
        by_kind = {"edges": [], "corners": []}
        for line in read_text(cloud).split("end_header\n")[1].splitlines():
            x, y, z, _, _, _, kind, _, t = (float(w) for w in line.split())
            near = self.nearest_on_carton((x, y, z))
            if abs(t - self.t_ns * 1e-9) < 1e-4 and near[1] < 0.02:  # the rest is background
                by_kind["corners" if kind == 2 else "edges"].append((x, y, z))
        arguments = []
        for kind, points in by_kind.items():
            self.assertGreater(len(points), 20, kind)
            arguments += ["--points", f"{kind}:" + self.points(f"{kind}.txt", self.in_left(points))]
        table, _ = self.run_it(*arguments, "--from", f"{CALIBRATION}#left", "--to", f"{CALIBRATION}#side")
        errors = []
        for row in self.rows(table):
            true_place, _ = self.nearest_on_carton([float(row[k]) for k in ("x_world", "y_world", "z_world")])
            u, v = truth_view.project(self.side, true_place)
            errors.append(((float(row["u_px"]) - u) ** 2 + (float(row["v_px"]) - v) ** 2) ** 0.5)
        errors.sort()
        median, p95 = errors[len(errors) // 2], errors[int(0.95 * len(errors))]
        print(f"{len(errors)} points of left and right in side: off their place on the true carton by {median:.2f} px "
              f"(median), {p95:.2f} px (95 %)")
        self.assertLess(median, 1.5)
        self.assertLess(p95, 8)

    @classmethod
    def nearest_on_carton(cls, point):
        """The place on the true carton's surface nearest to a point of the world, and its distance."""
        w, x, y, z = cls.pose[1]
        inside = truth_view.rotate((w, -x, -y, -z), [point[i] - cls.pose[0][i] for i in range(3)])
        half = (0.08, 0.05, 0.11)
        place = [max(-h, min(h, p)) for p, h in zip(inside, half)]
        if place == list(inside):  # inside: to the nearest side
            axis = min(range(3), key=lambda i: half[i] - abs(inside[i]))
            place[axis] = half[axis] if inside[axis] > 0 else -half[axis]
        distance = sum((a - b) ** 2 for a, b in zip(place, inside)) ** 0.5
        return cls.in_world(place), distance

    def test_wrong_input_is_refused_by_name_and_leaves_no_image(self):
        left, side = f"{CALIBRATION}#left", f"{CALIBRATION}#side"
        good = self.points("corners.txt", self.in_left(self.corners))
        behind = self.write("behind.txt", "0 0 1\n# comment\n0 0 -1\n")
        text = opencv_yaml(self.left)
        start = text.index("R: ")
        twisted = self.write("twisted.yml", text[:start] + matrix("R", [[1, 0, 0], [0, 2, 0], [0, 0, 1]]) +
                             text[text.index("T: "):])
        cases = [
            (["--points", behind, "--points-frame", "to", "--to", side], ["behind.txt:3", "behind the camera"]),
            (["--points", self.write("empty.txt", "# nothing\n"), "--from", left, "--to", side], ["empty.txt", "no points"]),
            (["--points", self.write("two.txt", "1 2\n"), "--from", left, "--to", side], ["two.txt:1", "2 numbers"]),
            (["--points", self.write("nan.txt", "1 2 nan\n"), "--from", left, "--to", side], ["nan.txt:1", "finite"]),
            (["--points", good, "--from", twisted, "--to", side], ["twisted.yml: R", "rotation"]),
            (["--points", good, "--from", left, "--to", self.write("s.yml", opencv_yaml(self.side, 1, (1280, 720)))],
             ["640 x 480", "1280 x 720"]),
            (["--points", good, "--from", left, "--to", self.write("no.yml", "%YAML:1.0\n---\na: 1\n")], ["no.yml", "camera matrix"]),
            (["--points", good, "--from", left, "--to", self.write("bad.yml", "%YAML:1.0\n---\n[[[")], ["bad.yml"]),
            (["--points", good, "--from", CALIBRATION, "--to", side], ["several cameras", "right"]),
            (["--points", good, "--from", f"{CALIBRATION}#nobody", "--to", side], ["nobody"]),
            (["--points", "/nowhere.txt", "--from", left, "--to", side], ["/nowhere.txt"]),
            (["--to", side], ["nothing to superimpose"]),
            (["--mesh", self.image, "--pose", 0, 0, 1, 1, 0, 0, 0, "--from", left, "--to", side], ["side.png"]),
        ]
        for arguments, words in cases:
            with self.subTest(arguments=arguments):
                said = self.run_it(*arguments, status=2)[1]
                for word in words:
                    self.assertIn(word, said)
                self.assertFalse(os.path.exists(self.path("out.png")))

    def test_damaged_image_is_refused(self):
        with open(self.image, "rb") as file:
            content = file.read()
        cut = self.path("cut.png")
        with open(cut, "wb") as file:
            file.write(content[:5000])
        corners = self.points("c.txt", self.corners)
        said = sightline("superimpose", "--image", cut, "--out", self.path("o.png"), "--points", corners, "--points-frame",
                         "world", "--to", f"{CALIBRATION}#side", status=2)[1]
        self.assertIn("cut.png", said)


if __name__ == "__main__":
    unittest.main()
