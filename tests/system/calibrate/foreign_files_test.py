#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline calibrate import` of files that other programs wrote, and their reading of ours: OpenCV, mrcal, COLMAP,
aniposelib, ROS' camera_calibration_parsers. Where one of them puts points is where the imported calibration has to put them.
Each is left out by name where it is not installed; skipped (77) where none is."""
import math
import os
import shutil
import subprocess
import sys
import tomllib
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import TemporaryFolder, read_text, sightline  # noqa: E402

try:
    import cv2
    import numpy as np
except ImportError as missing:
    # Debian's packages are for Debian's Python.
    if sys.executable != "/usr/bin/python3" and os.path.exists("/usr/bin/python3"):
        os.execv("/usr/bin/python3", ["/usr/bin/python3", *sys.argv])
    print(f"skipped: {missing}; Debian has it as python3-opencv")
    sys.exit(77)


def module(name):
    try:
        return __import__(name)
    except ImportError:
        return None


SIZE = (1280, 720)
MATRIX = np.array([[901.25, 0, 641.75], [0, 899.5, 352.125], [0, 0, 1]])
FIVE = [-0.11, 0.06, 0.0005, -0.0004, -0.01]
EIGHT = [0.3, -0.05, 0.0005, -0.0004, 0.002, 0.4, -0.02, 0.003]
# camera_from_world: rotation vector and translation.
PLACES = {"left": ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), "right": ([0.1, -0.45, 0.2], [-0.7, 0.05, 0.2])}
POINTS = np.array([[x, y, z] for x in (-0.3, 0.1, 0.5) for y in (-0.2, 0.15) for z in (1.4, 2.0)])


def project(camera):
    """Where a camera of a calibration.toml has the points."""
    world_from_camera = np.array(camera["world_from_camera"]).reshape(4, 4)
    inverse = np.linalg.inv(world_from_camera)
    matrix = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    rotation, _ = cv2.Rodrigues(inverse[:3, :3])
    return cv2.projectPoints(POINTS, rotation, inverse[:3, 3], matrix, np.array(camera["distortion"], dtype=float))[0].reshape(-1, 2)


def projected(name, distortion):
    rotation, translation = PLACES[name]
    return cv2.projectPoints(POINTS, np.array(rotation), np.array(translation), MATRIX, np.array(distortion))[0].reshape(-1, 2)


class Foreign(TemporaryFolder):
    def imported(self, kind, *files):
        out = self.path(f"{kind}.toml")
        sightline("calibrate", "import", *files, "--format", kind, "--out", out)
        with open(out, "rb") as file:
            return {camera["name"]: camera for camera in tomllib.load(file)["camera"]}

    def compare(self, cameras, expected, within=1e-6):
        self.assertEqual(sorted(cameras), sorted(expected))
        for name, pixels in expected.items():
            self.assertEqual((cameras[name]["width"], cameras[name]["height"]), SIZE)
            self.assertLess(np.abs(project(cameras[name]) - pixels).max(), within, name)

    def ours(self, distortion=FIVE):
        """A calibration of ours, of the same cameras."""
        text = ""
        for name, (rotation, translation) in PLACES.items():
            camera_from_world = np.eye(4)
            camera_from_world[:3, :3] = cv2.Rodrigues(np.array(rotation))[0]
            camera_from_world[:3, 3] = translation
            text += (f'[[camera]]\nname = "{name}"\nwidth = {SIZE[0]}\nheight = {SIZE[1]}\nmodel = "brown_conrady"\n'
                     f"fx = {MATRIX[0, 0]}\nfy = {MATRIX[1, 1]}\ncx = {MATRIX[0, 2]}\ncy = {MATRIX[1, 2]}\n"
                     f"distortion = {distortion}\nworld_from_camera = {np.linalg.inv(camera_from_world).tolist()}\n")
        return self.write("ours.toml", text)

    def exported(self, kind, **options):
        out = self.path(kind)
        sightline("calibrate", "export", self.ours(**options), "--format", kind, "--out", out)
        return {name: os.path.join(out, name) for name in os.listdir(out)}

    def test_opencv(self):
        for ending, distortion in (("yml", FIVE), ("xml", EIGHT)):
            files = []
            for name, (rotation, translation) in PLACES.items():
                files.append(self.path(f"{name}.{ending}"))
                storage = cv2.FileStorage(files[-1], cv2.FILE_STORAGE_WRITE)
                storage.write("image_width", SIZE[0])
                storage.write("image_height", SIZE[1])
                storage.write("camera_matrix", MATRIX)
                storage.write("distortion_coefficients", np.array([distortion]))
                storage.write("rvec", np.array(rotation).reshape(3, 1))
                storage.write("tvec", np.array(translation).reshape(3, 1))
                storage.release()
            self.compare(self.imported("opencv", *files), {name: projected(name, distortion) for name in PLACES})
        for name, path in self.exported("opencv").items():
            storage = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)
            pixels = cv2.projectPoints(POINTS, storage.getNode("rvec").mat(), storage.getNode("tvec").mat(),
                                       storage.getNode("camera_matrix").mat(),
                                       storage.getNode("distortion_coefficients").mat())[0].reshape(-1, 2)
            self.assertLess(np.abs(pixels - projected(name.split(".")[0], FIVE)).max(), 1e-6, name)

    def test_mrcal(self):
        mrcal = module("mrcal")
        if not mrcal:
            self.skipTest("no mrcal (python3-mrcal)")

        def pixels_of(model):
            rt = model.extrinsics_rt_fromref()
            return mrcal.project(mrcal.transform_point_rt(rt, POINTS), *model.intrinsics())

        files, expected = [], {}
        for name, (rotation, translation) in PLACES.items():
            model = mrcal.cameramodel(intrinsics=("LENSMODEL_OPENCV8", np.array([*MATRIX[[0, 1, 0, 1], [0, 1, 2, 2]], *EIGHT])),
                                      extrinsics_rt_fromref=np.array(rotation + translation), imagersize=np.array(SIZE))
            files.append(self.path(f"{name}.cameramodel"))
            model.write(files[-1])
            expected[name] = pixels_of(mrcal.cameramodel(files[-1]))
        self.compare(self.imported("mrcal", *files), expected)
        for name, path in self.exported("mrcal").items():
            self.assertLess(np.abs(pixels_of(mrcal.cameramodel(path)) - projected(name.split(".")[0], FIVE)).max(), 1e-6, name)

    def test_colmap(self):
        if not shutil.which("colmap"):
            self.skipTest("no colmap (Debian: colmap)")
        four = FIVE[:4]
        self.exported("colmap", distortion=four)
        folder = self.path("colmap")
        if not os.path.exists(os.path.join(folder, "points3D.txt")):
            self.write(os.path.join("colmap", "points3D.txt"), "")
        # Through COLMAP's own types, and written by it.
        for kind, source in (("BIN", folder), ("TXT", self.path("bin"))):
            out = self.path(kind.lower())
            os.makedirs(out)
            done = subprocess.run(["colmap", "model_converter", "--input_path", source, "--output_path", out, "--output_type", kind],
                                  env=dict(os.environ, QT_QPA_PLATFORM="offscreen"), capture_output=True, text=True, timeout=120,
                                  check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("Number of cameras: 2", read_text(self.path("txt", "cameras.txt")))
        cameras = self.imported("colmap", self.path("txt", "cameras.txt"), self.path("txt", "images.txt"))
        self.compare(cameras, {name: projected(name, four) for name in PLACES})

    def test_aniposelib(self):
        if not module("aniposelib"):
            self.skipTest("no aniposelib (PyPI)")
        from aniposelib.cameras import Camera, CameraGroup
        group = CameraGroup([Camera(matrix=MATRIX, dist=np.array(FIVE), size=SIZE, rvec=np.array(rotation), tvec=np.array(translation),
                                    name=name) for name, (rotation, translation) in PLACES.items()])
        path = self.path("camera_array_aniposelib.toml")
        group.dump(path)
        expected = dict(zip(PLACES, group.project(POINTS).reshape(len(PLACES), -1, 2)))
        self.compare(self.imported("anipose", path), expected)
        (path,) = self.exported("anipose").values()
        for camera in CameraGroup.load(path).cameras:
            self.assertLess(np.abs(camera.project(POINTS).reshape(-1, 2) - projected(camera.get_name(), FIVE)).max(), 1e-6)

    def test_ros(self):
        parsers = module("camera_calibration_parsers")
        if not parsers:
            self.skipTest("no camera_calibration_parsers (Debian: python3-camera-calibration-parsers)")
        files = self.exported("ros")
        for name in PLACES:
            read_name, info = parsers.readCalibration(files[f"{name}.yaml"])
            self.assertEqual((read_name, info.width, info.height, info.distortion_model), (name, *SIZE, "plumb_bob"))
            self.assertTrue(all(math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) for a, b in zip(info.D, FIVE)), info.D)
            self.assertTrue(np.allclose(np.reshape(info.K, (3, 3)), MATRIX, atol=1e-9), info.K)


if __name__ == "__main__":
    unittest.main()
