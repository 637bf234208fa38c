# SPDX-License-Identifier: Apache-2.0
"""Where the object of a recording truly is in a camera's image, from truth.csv and calibration.toml.
Standard library only, and no code shared with the product: this is the independent judge."""
import csv
import re


def read_truth(path):
    """{t_ns: (translation, quaternion wxyz)}"""
    with open(path, newline="", encoding="utf-8") as file:
        return {int(r["t_ns"]): (tuple(float(r[k]) for k in ("tx", "ty", "tz")),
                                 tuple(float(r[k]) for k in ("qw", "qx", "qy", "qz")))
                for r in csv.DictReader(file)}


def read_frames(path, camera):
    """Capture times of one camera, by position in its video."""
    with open(path, newline="", encoding="utf-8") as file:
        return [int(r["capture_ns"]) for r in csv.DictReader(file) if r["camera"] == camera]


def read_visibility(path, camera):
    with open(path, newline="", encoding="utf-8") as file:
        return {int(r["index"]): float(r["visible_fraction"]) for r in csv.DictReader(file)
                if r["camera"] == camera}


def read_camera(path, name):
    """fx fy cx cy, distortion, world_from_camera rows of one camera of calibration.toml (the subset of TOML
    that the bundled recordings use; Debian 12's Python has a full reader, this runs on older ones too)."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    for block in text.split("[[camera]]")[1:]:
        if re.search(r'^name\s*=\s*"(.*)"', block, re.M).group(1) != name:
            continue
        number = lambda key: float(re.search(rf"^{key}\s*=\s*(\S+)", block, re.M).group(1))
        listed = lambda key: [float(x) for x in re.findall(
            r"[-+0-9.eE]+", re.search(rf"^{key}\s*=\s*\[(.*?)\](?:\s*#.*)?$", block, re.M | re.S).group(1))]
        matrix = listed("world_from_camera")
        return {"fx": number("fx"), "fy": number("fy"), "cx": number("cx"), "cy": number("cy"),
                "distortion": listed("distortion"), "pose": [matrix[i:i + 4] for i in range(0, 12, 4)]}
    raise ValueError(f"{path}: no camera {name}")


def read_vertices(path):
    with open(path, encoding="utf-8") as file:
        return [tuple(float(x) for x in line.split()[1:4]) for line in file if line.startswith("v ")]


def rotate(q, p):
    w, x, y, z = q
    px, py, pz = p
    tx, ty, tz = 2 * (y * pz - z * py), 2 * (z * px - x * pz), 2 * (x * py - y * px)
    return (px + w * tx + y * tz - z * ty, py + w * ty + z * tx - x * tz, pz + w * tz + x * ty - y * tx)


def project(camera, point_in_world):
    pose = camera["pose"]
    d = [point_in_world[i] - pose[i][3] for i in range(3)]
    x, y, z = (sum(pose[i][k] * d[i] for i in range(3)) for k in range(3))
    x, y = x / z, y / z
    k1, k2, p1, p2, k3 = camera["distortion"]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return camera["fx"] * u + camera["cx"], camera["fy"] * v + camera["cy"]


def project_object(camera, pose, vertices):
    """Pixels of all vertices of the object at a true pose."""
    translation, quaternion = pose
    out = []
    for vertex in vertices:
        r = rotate(quaternion, vertex)
        out.append(project(camera, tuple(r[i] + translation[i] for i in range(3))))
    return out
