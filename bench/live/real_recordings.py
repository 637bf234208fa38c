#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Recordings of real footage that Debian packages carry, with poses to judge by:

    bench/live/real_recordings.py FOLDER        # apt install opencv-doc visp-images-data python3-opencv python3-scipy

FOLDER/box: a printed box of 25.8 x 18.9 x 7.5 cm in a hand before one camera, itself in a hand (OpenCV's tutorial
"Real Time pose estimation"), 15 s; the mesh has no print. FOLDER/printed_box: the same with a print, as the footage
shows it. FOLDER/cube: a printed cube of 84 mm that is moved over a desk before one gray camera (ViSP's images of its
model-based tracker), 7 s; the mesh has no print. FOLDER/bottle: a black bottle in a hand, 8 s, without poses, to look
for other objects in (bench/false_alarms.py --footage). Nothing of it is kept in the repository.

Poses (keyframes.csv: `sightline evaluate` and bench/live/live.py judge up to the symmetries of the mesh) are those of
SIFT features on the faces, by PnP, so that they know nothing of outlines: where the faces are in the first key frame
was marked by hand (box) or comes with the images (cube). Focal length, center and distortion of the box's camera are
not known; they are estimated with the poses of every sixth frame and the places of the features (bundle adjustment,
minutes). Its corners, marked to some 2 px, alone tell how large it is, so that all depths may be off together by 2 to
3 % (16 mm from one set of marks to another)."""
import argparse
import gzip
import itertools
import pathlib
import subprocess
import sys
import tempfile

try:
    import cv2
    import numpy as np
    from scipy.optimize import least_squares
    from scipy.sparse import lil_matrix
    from scipy.spatial.transform import Rotation
except ImportError as missing:
    print(f"error: {missing}: apt install python3-opencv python3-numpy python3-scipy", file=sys.stderr)
    sys.exit(2)

OPENCV_VIDEOS = pathlib.Path("/usr/share/doc/opencv-doc/opencv4/html")
CUBE_IMAGES = pathlib.Path("/usr/share/visp-images-data/ViSP-images/mbt")
BOX = np.array([0.258, 0.189, 0.075])  # [m], OpenCV's box.ply; long edge, depth, height
BOX_RATE, BOTTLE_RATE, CUBE_RATE = 29.97, 26.78, 30.0
BOX_FIRST = 100  # its corners there [px]: top left front, top left back, top right back, top right front, bottom ...
BOX_CORNERS = np.array([(218.8, 104.2), (328.1, 29.0), (550.2, 87.1), (486.2, 195.4), (227.3, 174.9), (468.8, 266.4)])
BOX_PLACES = np.array([(0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1), (0, 0, 0), (1, 0, 0)]) * BOX


class Lens:
    """Brown-Conrady with one term."""

    def __init__(self, fx, fy, cx, cy, k1=0.0):
        self.matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], float)
        self.distortion = np.array([k1, 0, 0, 0, 0], float)

    def project(self, points, pose):
        return cv2.projectPoints(points, pose[:3], pose[3:], self.matrix, self.distortion)[0][:, 0]

    def solve(self, points, pixels, reach=6):
        """Pose by PnP, and which of the features agree; None unless 15 do within `reach` pixels."""
        if len(points) < 15:
            return None
        ok, r, t, inliers = cv2.solvePnPRansac(points, pixels, self.matrix, self.distortion,
                                               iterationsCount=500, reprojectionError=reach)
        if not ok or inliers is None or len(inliers) < 15:
            return None
        kept = inliers.ravel()
        ok, r, t = cv2.solvePnP(points[kept], pixels[kept], self.matrix, self.distortion, r, t, True)
        pose = np.concatenate([r.ravel(), t.ravel()])
        error = np.linalg.norm(self.project(points[kept], pose) - pixels[kept], axis=1)
        return (pose, kept) if 0.1 < pose[5] < 5 and np.median(error) < reach / 2 else None


class Features:
    """SIFT features on the faces of a box [0, size]."""

    def __init__(self, size):
        self.size, self.sift = np.asarray(size, float), cv2.SIFT_create(3000, contrastThreshold=0.02)
        self.points, self.axes, self.descriptors = np.empty((0, 3)), np.empty(0, int), np.empty((0, 128), np.float32)

    def detect(self, image):
        gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        keypoints, descriptors = self.sift.detectAndCompute(gray, None)
        return np.array([k.pt for k in keypoints]), descriptors

    def add(self, image, lens, pose):
        """Those of an image, where the rays through them meet the nearest face."""
        pixels, descriptors = self.detect(image)
        turn = Rotation.from_rotvec(pose[:3]).as_matrix()
        eye = -turn.T @ pose[3:]
        rays = cv2.undistortPoints(pixels[:, None].astype(np.float64), lens.matrix, lens.distortion)[:, 0]
        for ray, descriptor in zip(np.column_stack([rays, np.ones(len(rays))]) @ turn, descriptors):
            best = (np.inf, None, 0)
            for axis, end in itertools.product(range(3), (0, 1)):
                along = (end * self.size[axis] - eye[axis]) / ray[axis]
                place = eye + along * ray
                others = [k for k in range(3) if k != axis]
                inside = all(0.003 < place[k] < self.size[k] - 0.003 for k in others)
                if 0 < along < best[0] and inside:
                    best = (along, place, axis)
            if best[1] is not None:
                self.points = np.vstack([self.points, best[1]])
                self.axes = np.append(self.axes, best[2])
                self.descriptors = np.vstack([self.descriptors, descriptor])

    def match(self, image):
        """Indices of features and where they are."""
        pixels, descriptors = self.detect(image)
        pairs = cv2.BFMatcher().knnMatch(self.descriptors, descriptors, k=2)
        good = [a for a, b in pairs if a.distance < 0.8 * b.distance]
        return np.array([m.queryIdx for m in good], int), pixels[[m.trainIdx for m in good]]


def follow(images, features, lens, first, pose, key_frames=()):
    """Poses of all images that could be solved, and what was seen in them; features are added at key frames."""
    poses, seen = {first: pose}, {}
    for i, image in enumerate(images):
        which, pixels = features.match(image)
        solved = lens.solve(features.points[which], pixels)
        if solved is None:
            continue
        poses[i], seen[i] = solved[0], (which[solved[1]], pixels[solved[1]])
        if i in key_frames and i != first:
            features.add(image, lens, poses[i])
    return poses, seen


def adjust(features, lens, poses, seen, corners, places, first):
    """Lens, poses and places of the features on their faces for the least reprojection error."""
    frames = sorted(set(sorted(seen)[::6]) | {first})
    free = np.array([[k for k in range(3) if k != axis] for axis in features.axes])
    rows = [(f, q, *pixel) for f, i in enumerate(frames) for q, pixel in zip(*seen[i])]
    frame, index = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    pixels, count = np.array([r[2:] for r in rows]), len(features.points)
    at_first, head = frames.index(first), 4 + 6 * len(frames)

    def parts(x):
        placed = features.points.copy()
        placed[np.arange(count)[:, None], free] = x[head:].reshape(-1, 2)
        return Lens(x[0], x[0], x[1], x[2], x[3]), x[4:head].reshape(-1, 6), placed

    def residuals(x):
        camera, at, placed = parts(x)
        out = np.empty_like(pixels)
        for f in range(len(frames)):
            out[frame == f] = camera.project(placed[index[frame == f]], at[f]) - pixels[frame == f]
        # Nothing else tells how large the features' box is.
        marked = 10 * (camera.project(places, at[at_first]) - corners)
        usual = [(x[1] - lens.matrix[0, 2]) / 30, (x[2] - lens.matrix[1, 2]) / 30, x[3] / 0.2]
        return np.concatenate([out.ravel(), marked.ravel(), usual])

    start = np.concatenate([[lens.matrix[0, 0], lens.matrix[0, 2], lens.matrix[1, 2], 0],
                            *[poses[i] for i in frames],
                            features.points[np.arange(count)[:, None], free].ravel()])
    filled = lil_matrix((2 * len(pixels) + 2 * len(corners) + 3, len(start)), dtype=np.int8)
    filled[:, :4] = 1
    for k in range(len(pixels)):
        for row in (2 * k, 2 * k + 1):
            filled[row, 4 + 6 * frame[k]:10 + 6 * frame[k]] = 1
            filled[row, head + 2 * index[k]:head + 2 * index[k] + 2] = 1
    filled[2 * len(pixels):-3, 4 + 6 * at_first:10 + 6 * at_first] = 1
    x = least_squares(residuals, start, jac_sparsity=filled, loss="soft_l1", x_scale="jac", max_nfev=60).x
    camera, _, features.points = parts(x)
    error = np.linalg.norm(residuals(x)[:2 * len(pixels)].reshape(-1, 2), axis=1)
    print(f"f = {x[0]:.1f} px, center {x[1]:.1f} {x[2]:.1f}, k1 {x[3]:.3f}; median {np.median(error):.2f} px")
    return camera


def video_images(name):
    with tempfile.NamedTemporaryFile(suffix=".mp4") as video:
        video.write(gzip.decompress((OPENCV_VIDEOS / f"{name}.mp4.gz").read_bytes()))
        video.flush()
        capture, images = cv2.VideoCapture(video.name), []
        while (read := capture.read())[0]:
            images.append(read[1])
        return images


def box_poses(images):
    """Lens and poses."""
    guesses = []
    for f in range(400, 1400, 20):
        lens = Lens(f, f, 319.5, 239.5)
        _, r, t = cv2.solvePnP(BOX_PLACES, BOX_CORNERS, lens.matrix, None)
        pose = np.concatenate([r.ravel(), t.ravel()])
        guesses.append((np.linalg.norm(lens.project(BOX_PLACES, pose) - BOX_CORNERS, axis=1).mean(), f, pose))
    _, f, pose = min(guesses, key=lambda g: g[0])
    lens, features = Lens(f, f, 319.5, 239.5), Features(BOX)
    features.add(images[BOX_FIRST], lens, pose)
    poses, seen = follow(images, features, lens, BOX_FIRST, pose)
    lens = adjust(features, lens, poses, seen, BOX_CORNERS, BOX_PLACES, BOX_FIRST)
    solved = {i: lens.solve(features.points[which], pixels) for i, (which, pixels) in seen.items()}
    return lens, {i: found[0] for i, found in solved.items() if found is not None}


def cube_poses(images):
    """The cube lies at x from -0.084 m to 0 in the package's frame; here from 0."""
    vector = np.loadtxt(CUBE_IMAGES / "cube.0.pos", comments="#", max_rows=6)
    turn = Rotation.from_rotvec(vector[3:])
    pose = np.concatenate([vector[3:], vector[:3] + turn.apply([-0.084, 0, 0])])
    lens, features = Lens(547.7367575, 542.0744058, 338.7036994, 234.5083345), Features([0.084] * 3)
    features.add(images[0], lens, pose)
    return lens, follow(images, features, lens, 0, pose, range(40, len(images), 40))[0]


def write_video(images, rate, path):
    height, width = images[0].shape[:2]
    gray = images[0].ndim == 2
    subprocess.run(["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "gray" if gray else "bgr24",
                    "-s", f"{width}x{height}", "-r", str(rate), "-i", "-", "-c:v", "libx264", "-pix_fmt", "yuv420p",
                    "-crf", "8", path], input=b"".join(image.tobytes() for image in images), check=True)


def faces_of(size):
    """Of a box [0, size]: the corner at the top left of a face, seen from outside, and its sides to the right and
    down."""
    x, y, z = np.diag(np.asarray(size, float))
    return {"top": (y + z, x, -y), "front": (z, x, -z), "right": (x + z, y, -z), "left": (y + z, -y, -z),
            "back": (x + y + z, -x, -z), "bottom": (0 * x, x, y)}


def prints_of(images, lens, poses, size):
    """An image of each face; those that the footage does not show are plain."""
    shown = {"top": (130, 170, 260), "front": (350, 400, 430), "right": (130, 150)}
    out = {}
    for name, (corner, right, down) in faces_of(size).items():
        width, height = (int(2000 * np.linalg.norm(side)) for side in (right, down))
        out[name] = np.full((height, width, 3), (40, 160, 220), np.uint8)
        if name not in shown:
            continue
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        places = (corner + u[..., None] * right + v[..., None] * down).reshape(-1, 3)
        looks = []
        for i in shown[name]:
            at = lens.project(places, poses[i]).reshape(height, width, 2).astype(np.float32)
            looks.append(cv2.remap(images[i], at[..., 0], at[..., 1], cv2.INTER_LINEAR))
        out[name] = np.median(looks, axis=0).astype(np.uint8)
    return out


def write_mesh(folder, name, size, prints=None):
    """OBJ about the middle of the box; with a material of its own for each printed face."""
    lines, materials = ([f"mtllib {name}.mtl"] if prints else []), []
    for k, (face, (corner, right, down)) in enumerate(faces_of(size).items()):
        corner = corner - np.asarray(size) / 2
        for point in (corner, corner + right, corner + right + down, corner + down):
            lines.append("v %.5f %.5f %.5f" % tuple(point))
        if prints:
            cv2.imwrite(str(folder / f"{face}.png"), prints[face])
            materials.append(f"newmtl {face}\nKd 1 1 1\nmap_Kd {face}.png\n")
            lines += ["vt 0 1", "vt 1 1", "vt 1 0", "vt 0 0", f"usemtl {face}"]
        for triangle in ((4, 3, 2), (4, 2, 1)):  # counterclockwise from outside
            corners = [4 * k + i for i in triangle]
            lines.append("f " + " ".join(f"{i}/{i}" if prints else str(i) for i in corners))
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
    if materials:
        (folder / f"{name}.mtl").write_text("\n".join(materials))
    (folder / f"{name}.toml").write_text(f'name = "{name}"\nmesh = "{name}.obj"\nunit = "m"\n')


def write_recording(folder, name, images, rate, lens, poses, size, prints=None):
    (folder / "objects").mkdir(parents=True, exist_ok=True)
    height, width = images[0].shape[:2]
    write_video(images, rate, folder / "cam.mkv")
    write_mesh(folder / "objects", name, size, prints)
    camera = f'[[camera]]\nname = "cam"\nwidth = {width}\nheight = {height}\n'
    (folder / "recording.toml").write_text(
        f'format = 1\nname = "{folder.name}"\nobjects = ["objects/{name}.toml"]\n\n{camera}'
        'file = "cam.mkv"\ncodec = "h264"\n')
    matrix, unit = lens.matrix, np.eye(4).tolist()
    (folder / "calibration.toml").write_text(
        f'{camera}model = "brown_conrady"\nfx = {matrix[0, 0]}\nfy = {matrix[1, 1]}\ncx = {matrix[0, 2]}\n'
        f'cy = {matrix[1, 2]}\ndistortion = {lens.distortion.tolist()}\nworld_from_camera = {unit}\n')
    time = [1_000_000_000 + int(i * 1e9 / rate) for i in range(len(images))]
    (folder / "frames.csv").write_text("camera,sequence,capture_ns,arrival_ns,dropped_before\n" + "".join(
        f"cam,{i},{t},{t},0\n" for i, t in enumerate(time)))
    if not poses:
        return
    with open(folder / "keyframes.csv", "w") as file:
        file.write("t_ns,object,tx,ty,tz,qw,qx,qy,qz\n")
        for i in sorted(poses):
            turn = Rotation.from_rotvec(poses[i][:3])
            place = poses[i][3:] + turn.apply(np.asarray(size) / 2)
            x, y, z, w = turn.as_quat()
            file.write("%d,%s" % (time[i], name) + ",%.9g" * 7 % (*place, w, x, y, z) + "\n")
    print(f"{folder}: {len(images)} frames, poses of {len(poses)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_args().folder
    for path, package in ((OPENCV_VIDEOS / "box.mp4.gz", "opencv-doc"), (CUBE_IMAGES, "visp-images-data")):
        if not path.exists():
            print(f"error: there is no {path}: apt install {package}", file=sys.stderr)
            return 2
    images = video_images("box")
    lens, poses = box_poses(images)
    write_recording(folder / "box", "box", images, BOX_RATE, lens, poses, BOX)
    write_recording(folder / "printed_box", "box", images, BOX_RATE, lens, poses, BOX,
                    prints_of(images, lens, poses, BOX))
    # No pose is known of the bottle, nor its camera; the object is one that is not there.
    write_recording(folder / "bottle", "box", video_images("cup"), BOTTLE_RATE, Lens(608, 608, 319.5, 239.5), {}, BOX)
    images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted((CUBE_IMAGES / "cube").glob("*.pgm"))]
    lens, poses = cube_poses(images)
    write_recording(folder / "cube", "cube", images, CUBE_RATE, lens, poses, [0.084] * 3)
    return 0


if __name__ == "__main__":
    sys.exit(main())
