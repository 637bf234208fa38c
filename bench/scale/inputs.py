# SPDX-License-Identifier: Apache-2.0
"""What the bench of scale runs on: the bundled recording, enlarged where asked, and the carton with as many faces as asked."""
import math
import os
import re
import shutil
import subprocess

from support import BENCH, read_text

RECORDED = ("left", "right", "side")
SIZE = (0.16, 0.10, 0.22)  # of the carton [m]


def recording(folder, height):
    """The bundled recording with images of this height, in a folder that may be played; the lens with it."""
    if height == 480:
        return BENCH
    target, scale = os.path.join(folder, f"bench{height}"), height / 480
    if os.path.isdir(target):
        return target
    shutil.copytree(BENCH, target)
    for name in RECORDED:
        subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-y", "-i", os.path.join(BENCH, f"{name}.mkv"), "-vf",
                        f"scale={round(640 * scale)}:{height}:flags=lanczos", "-c:v", "libx264", "-preset", "veryfast", "-bf", "0", "-crf", "18",
                        "-vsync", "passthrough", os.path.join(target, f"{name}.mkv")], check=True)

    def scaled(match):
        value = float(match[2])
        new = (value + 0.5) * scale - 0.5 if match[1].startswith("c") else value * scale
        return f"{match[1]} = {new}"
    for name in ("calibration.toml", "recording.toml"):
        text = re.sub(r"\b(fx|fy|cx|cy) = ([0-9.]+)", scaled, read_text(os.path.join(target, name)))
        text = text.replace("width = 640", f"width = {round(640 * scale)}").replace("height = 480", f"height = {height}")
        with open(os.path.join(target, name), "w", encoding="utf-8") as file:
            file.write(text)
    return target


def box_side(axis, sign, steps):
    """Points of one side of the carton, row by row, pushed out by waves of half a millimeter."""
    u, v = [i for i in range(3) if i != axis]
    for i in range(steps + 1):
        for j in range(steps + 1):
            point = [0.0, 0.0, 0.0]
            point[u], point[v] = SIZE[u] * (i / steps - 0.5), SIZE[v] * (j / steps - 0.5)
            inside = math.sin(math.pi * i / steps) * math.sin(math.pi * j / steps)
            point[axis] = sign * (SIZE[axis] / 2 + 0.0005 * inside * math.sin(0.7 * i) * math.sin(0.9 * j))
            yield point


def carton(folder, faces):
    """A carton mesh of about so many faces."""
    path = os.path.join(folder, f"carton{faces}.obj")
    if os.path.exists(path):
        return path
    steps = max(1, round(math.sqrt(faces / 12)))
    with open(path, "w", encoding="utf-8") as file:
        first = 1
        for axis in range(3):
            for sign in (-1, 1):
                file.writelines(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in box_side(axis, sign, steps))
                flip = (sign > 0) == (axis == 1)
                for i in range(steps):
                    for j in range(steps):
                        a = first + i * (steps + 1) + j
                        b, c, d = a + steps + 1, a + steps + 2, a + 1
                        corners = (a, d, c, b) if flip else (a, b, c, d)
                        file.write(f"f {corners[0]} {corners[1]} {corners[2]}\nf {corners[0]} {corners[2]} {corners[3]}\n")
                first += (steps + 1) ** 2
    return path


def installation(folder, run):
    """The installation file of one run; each camera and object as often as asked."""
    played = recording(folder, run["height"])
    calibration = read_text(os.path.join(played, "calibration.toml"))
    tables = {name: next(t for t in calibration.split("[[camera]]")[1:] if f'name = "{name}"' in t) for name in RECORDED}
    lenses, text = "", 'calibration = "calibration.toml"\n'
    for i in range(run["cameras"]):
        wanted = RECORDED[i % 3]
        lenses += "[[camera]]" + tables[wanted].replace(f'"{wanted}"', f'"cam{i}"') + "\n"
        text += f'[[camera]]\nname = "cam{i}"\nsource = "replay:{played}"\nrecorded_as = "{wanted}"\n'
    described = read_text(os.path.join(BENCH, "objects", "carton.toml"))
    mesh = carton(folder, run["faces"])
    for i in range(run["objects"]):
        # A marker stands once in an installation: the first object has them, the others are found by their mesh.
        own = (described if i == 0 else described.split("[[fiducial]]")[0]).replace('name = "carton"', f'name = "carton{i}"').replace('"carton.obj"', f'"{os.path.basename(mesh)}"')
        with open(os.path.join(folder, f"carton{i}.toml"), "w", encoding="utf-8") as file:
            file.write(own)
        text += f'[[object]]\nfile = "carton{i}.toml"\n'
    text += f'[scene]\nmeshes = ["{BENCH}/scene.obj"]\n[overlay]\nstyles = ["circle", "outline", "fill", "label"]\n'
    text += "[rtsp]\nport = 0\nmax_clients = 128\n[http]\nport = 0\n"
    for name, content in (("calibration.toml", lenses), ("scale.toml", text)):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(content)
    return os.path.join(folder, "scale.toml")
