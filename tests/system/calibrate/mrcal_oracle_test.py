#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline calibrate solve` against mrcal, an independent solver with derivatives of its own: OpenCV's stereo pairs, the
same corners. Skipped (77) where mrcal or the pictures (opencv-doc) are not installed."""
import csv
import json
import os
import sys
import tempfile
import tomllib

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import sightline  # noqa: E402

PICTURES = "/usr/share/doc/opencv-doc/examples/data"
try:
    import mrcal
    import numpy as np
except ImportError as missing:
    # Debian's package is for Debian's Python.
    if sys.executable != "/usr/bin/python3" and os.path.exists("/usr/bin/python3"):
        os.execv("/usr/bin/python3", ["/usr/bin/python3", *sys.argv])
    print(f"skipped: {missing}; Debian has it as python3-mrcal")
    sys.exit(77)
if not os.path.exists(f"{PICTURES}/left01.jpg"):
    print(f"skipped: no {PICTURES} (opencv-doc)")
    sys.exit(77)

COLUMNS, ROWS = 9, 6
WITHIN = 0.05


def solve(folder):
    target = os.path.join(folder, "chess.toml")
    with open(target, "w", encoding="utf-8") as file:
        file.write('type = "chessboard"\ncolumns = 10\nrows = 7\nsquare = 1\n')
    sightline("calibrate", "solve", "--images", f"left={PICTURES}/left[01][0-9].jpg", "--images",
              f"right={PICTURES}/right[01][0-9].jpg", "--target", target, "--corner-window", 5, "--reject", 0, "--out", folder)
    with open(os.path.join(folder, "calibration.toml"), "rb") as file:
        cameras = tomllib.load(file)["camera"]
    with open(os.path.join(folder, "report.json"), encoding="utf-8") as file:
        return cameras, json.load(file)


def observations(folder):
    """Pixels by view [rows, columns, 3 (u, v, weight)] and their (frame, camera, extrinsics or -1)."""
    views = {}
    with open(os.path.join(folder, "corners.csv"), encoding="utf-8") as file:
        rows = [line for line in file if not line.startswith("#")]
    for row in csv.DictReader(rows):
        camera = {"left": 0, "right": 1}[row["camera"]]
        view = views.setdefault((int(row["set"]), camera), -np.ones((ROWS, COLUMNS, 3)))
        corner = int(row["corner"])
        view[corner // COLUMNS, corner % COLUMNS] = float(row["u"]), float(row["v"]), 1
    keys = sorted(views)
    frames = {frame: i for i, frame in enumerate(sorted({key[0] for key in keys}))}
    indices = np.array([(frames[frame], camera, camera - 1) for frame, camera in keys], dtype=np.int32)
    return np.array([views[key] for key in keys]), indices


def start(cameras, seen, indices):
    """mrcal's problem, begun beside our solution so that it has something to do."""
    intrinsics = np.array([[c["fx"], c["fy"], c["cx"], c["cy"], *c["distortion"]] for c in cameras])
    intrinsics[:, :4] *= 1.01
    left, right = (np.array(c["world_from_camera"]) for c in cameras)
    right_from_left = np.linalg.inv(right) @ left
    extrinsics = mrcal.rt_from_Rt(np.vstack((right_from_left[:3, :3], right_from_left[:3, 3:].T)))[None, :]
    size = np.array([[c["width"], c["height"]] for c in cameras], dtype=np.int32)
    models = [mrcal.cameramodel(intrinsics=("LENSMODEL_OPENCV5", intrinsics[i]), imagersize=size[i]) for i in range(2)]
    poses = mrcal.estimate_monocular_calobject_poses_Rt_tocam(np.ascontiguousarray(indices[:, :2]), seen, 1.0, models)
    frames = np.zeros((indices[:, 0].max() + 1, 6))
    for (frame, camera, _), pose in zip(indices, poses):
        if camera == 0:
            frames[frame] = mrcal.rt_from_Rt(pose)
    return dict(intrinsics=intrinsics, extrinsics_rt_fromref=extrinsics + 0.01, frames_rt_toref=frames, points=None,
                observations_board=seen, indices_frame_camintrinsics_camextrinsics=indices, observations_point=None,
                indices_point_camintrinsics_camextrinsics=None, lensmodel="LENSMODEL_OPENCV5", imagersizes=size,
                calobject_warp=None, do_optimize_calobject_warp=False, calibration_object_spacing=1.0,
                do_apply_regularization=False, do_apply_outlier_rejection=False, verbose=False)


def covariance(problem):
    """Of intrinsics and extrinsics, by mrcal's derivatives at its optimum; and sigma of a coordinate."""
    _, x, jacobian, _ = mrcal.optimizer_callback(**problem, no_factorization=True)
    slopes = np.array(jacobian.todense())
    mrcal.pack_state(slopes, **problem)  # by the packed state as it comes; by the state itself then
    used = np.any(slopes != 0, axis=1)
    sigma = np.sqrt(np.sum(x[used] ** 2) / (np.count_nonzero(used) - slopes.shape[1]))
    return sigma ** 2 * np.linalg.inv(slopes.T @ slopes), sigma


def slopes_at(problem, camera, point):
    """Derivatives of a projection by the lens and by (turn, shift) of the camera."""
    _, by_point, by_lens = mrcal.project(point, problem["lensmodel"], problem["intrinsics"][camera], get_gradients=True)
    x, y, z = point
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return by_lens, np.hstack((by_point @ cross, -by_point))


def projection_sigma(problem, lens_covariance, camera, distance):
    """One sigma over the image, the pose taking up what it can where corners were seen."""
    frames = problem["indices_frame_camintrinsics_camextrinsics"]
    board = np.array([(i % COLUMNS, i // COLUMNS, 0.0) for i in range(COLUMNS * ROWS)])
    normal, right = 1e-9 * np.eye(6), np.zeros((6, 9))
    for frame, seen_by, extrinsics in frames:
        if seen_by != camera:
            continue
        points = mrcal.transform_point_rt(problem["frames_rt_toref"][frame], board)
        if extrinsics >= 0:
            points = mrcal.transform_point_rt(problem["extrinsics_rt_fromref"][extrinsics], points)
        for point in points:
            by_lens, by_pose = slopes_at(problem, camera, point)
            normal += by_pose.T @ by_pose
            right += by_pose.T @ by_lens
    taken_up = -np.linalg.solve(normal, right)
    width, height = problem["imagersizes"][camera] - 1.0
    out = []
    for row in range(12):
        for column in range(16):
            pixel = np.array([width * column / 15, height * row / 11])
            ray = mrcal.unproject(pixel, problem["lensmodel"], problem["intrinsics"][camera], normalize=True)
            by_lens, by_pose = slopes_at(problem, camera, ray * distance)
            j = by_lens + by_pose @ taken_up
            out.append(np.sqrt(np.linalg.eigvalsh(j @ lens_covariance @ j.T)[-1]))
    return np.array(out)


def compare(what, ours, theirs, tolerance):
    worst = np.max(np.abs(np.asarray(ours) - np.asarray(theirs)) / tolerance)
    print(f"{what}: largest difference {worst:.2e} of what is allowed")
    assert worst <= 1, f"{what}: {ours} and {theirs}"


def main():
    with tempfile.TemporaryDirectory(prefix="sightline_test.") as folder:
        cameras, report = solve(folder)
        seen, indices = observations(folder)
        problem = start(cameras, seen, indices)
        result = mrcal.optimize(**problem)
        rms = np.sqrt(2) * result["rms_reproj_error__pixels"]
        print(f"RMS: {report['rms_px']:.6f} px, mrcal {rms:.6f} px")
        assert abs(report["rms_px"] - rms) < 1e-4
        known, sigma = covariance(problem)
        print(f"sigma of a coordinate: {report['sigma_px']:.6f} px, mrcal {sigma:.6f} px")
        assert abs(report["sigma_px"] / sigma - 1) < WITHIN
        for c, camera in enumerate(report["cameras"]):
            at = mrcal.state_index_intrinsics(c, **problem)
            lens = known[at:at + 9, at:at + 9]
            theirs = np.sqrt(np.diag(lens))
            ours = np.array([p["sigma"] for p in camera["parameters"]])
            compare(f"{camera['name']}: parameters", [p["value"] for p in camera["parameters"]], problem["intrinsics"][c],
                    WITHIN * theirs)
            compare(f"{camera['name']}: sigmas of parameters", ours, theirs, WITHIN * theirs)
            map_of_ours = np.array(camera["projection_sigma"]["px"])
            map_of_theirs = projection_sigma(problem, lens, c, camera["working_distance_m"])
            compare(f"{camera['name']}: one sigma of projection, {map_of_theirs.min():.3f} to {map_of_theirs.max():.3f} px",
                    map_of_ours, map_of_theirs, WITHIN * map_of_theirs)
        at = mrcal.state_index_extrinsics(0, **problem)
        place = np.sqrt(np.diag(known)[at:at + 6])
        pose = np.linalg.inv(np.array(cameras[1]["world_from_camera"]))
        rt = mrcal.rt_from_Rt(np.vstack((pose[:3, :3], pose[:3, 3:].T)))
        compare("place", rt, problem["extrinsics_rt_fromref"][0], WITHIN * place)


if __name__ == "__main__":
    main()
