#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A recording as other cameras, a world of another size, or a worse mesh would have given it:

    bench/live/vary.py [--pixels 2] [--every 2] [--world 4] [--look dim] [--mesh mixed] [--rig bumped]
                       [--quality 34] RECORDING FOLDER

Writes it to FOLDER, which must not exist; videos are encoded again, almost without loss.
--pixels: images so many times as wide and high (Lanczos; no more detail, as of a lens that is less sharp than the
sensor), with lenses and boxes of visibility.csv; --every: every so many images, at a rate that is less by that;
--world: the same images of a world so many times as large, that is meshes (.obj), places of cameras and of the truth
(markers stay as they are); --look: as bench/offsets.py; --mesh: what modellers, converters and scanners make of meshes
(.obj), one of the functions of mesh_faults.py; --rig: what goes wrong with cameras, one of rig_faults.py; --quality:
crf of the encoder (8).
What a search or a tracker makes of these should be what it makes of the recording. Needs ffmpeg. Exits 2 for bad input."""
import pathlib
import re
import shutil
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from mesh_faults import FAULTS  # noqa: E402
from offsets import LOOKS  # noqa: E402
from recording_tools import as_h264, load_object, load_recording, maker_parser, read_csv, write_csv  # noqa: E402
from rig_faults import RIG_FAULTS  # noqa: E402

ENCODE_S = 900
EDGES, AREA = ("xmin", "ymin", "xmax", "ymax"), "inimage_pixels"
NUMBER = r"[-+0-9.eE]+"


def of_more_pixels(text, factor):
    """Sizes, focal lengths and centers of a TOML file, in so many times as many pixels. (0, 0) is the middle of the first
    pixel, so that a coordinate x becomes factor (x + 1/2) - 1/2."""
    number = r"(?m)^(\s*(?:%s)\s*=\s*)(" + NUMBER + ")"
    text = re.sub(number % "width|height", lambda m: f"{m[1]}{round(int(m[2]) * factor)}", text)
    text = re.sub(number % "fx|fy", lambda m: f"{m[1]}{float(m[2]) * factor:.9g}", text)
    return re.sub(number % "cx|cy", lambda m: f"{m[1]}{factor * (float(m[2]) + 0.5) - 0.5:.9g}", text)


def enlarge_visibility(path, factor):
    rows = read_csv(path) if path.exists() else []
    for row in rows:
        for edge in EDGES:
            row[edge] = f"{factor * (float(row[edge]) + 0.5) - 0.5:.2f}"
        row[AREA] = round(int(row[AREA]) * factor * factor)
    if rows:
        write_csv(path, rows[0].keys(), rows)


def scale_pose(matrix, factor):
    """The text of a 4 x 4 matrix of a TOML file with its translation so many times as long."""
    rows = [[float(x) for x in re.findall(NUMBER, row)] for row in re.findall(r"\[([^\[\]]+)\]", matrix)]
    for row in rows[:3]:
        row[3] *= factor
    return "".join(f"  {row},\n" for row in rows)


def scale_world(folder, factor):
    path = folder / "calibration.toml"
    text = re.sub(r"(world_from_camera\s*=\s*\[\n)((?:\s*\[[^\]]*\],?\n){4})(\s*\])",
                  lambda m: m[1] + scale_pose(m[2], factor) + m[3], path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    for truth in ("truth.csv", "keyframes.csv"):
        rows = read_csv(folder / truth) if (folder / truth).exists() else []
        for row in rows:
            row.update({axis: repr(float(row[axis]) * factor) for axis in ("tx", "ty", "tz")})
        if rows:
            write_csv(folder / truth, rows[0].keys(), rows)
    for mesh in folder.rglob("*.obj"):
        mesh.write_text(re.sub(r"(?m)^v +(\S+) +(\S+) +(\S+)",
                               lambda m: "v " + " ".join(repr(float(m[i]) * factor) for i in (1, 2, 3)),
                               mesh.read_text(encoding="utf-8")), encoding="utf-8")


def thin_out(path, every):
    """Every so many rows of each camera in frames.csv."""
    rows, seen, kept = read_csv(path), {}, []
    for row in rows:
        number = seen.get(row["camera"], 0)
        seen[row["camera"]] = number + 1
        if number % every == 0:
            kept.append({**row, "sequence": number // every})
    write_csv(path, rows[0].keys(), kept)


def encode(source, target, options, fault):
    size = f"scale=trunc(iw*{options.pixels}+0.5):trunc(ih*{options.pixels}+0.5):flags=lanczos"
    chain = f"select='not(mod(n\\,{options.every}))',setpts=N/30/TB" + (f",{size}" if options.pixels != 1 else "")
    chain += LOOKS[options.look] + (f",{fault}" if fault else "")
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", source, "-vf", chain, "-vsync", "0", "-an", "-c:v", "libx264",
                    "-crf", str(options.quality), "-preset", "veryfast", "-g", "15", "-pix_fmt", "yuv420p",
                    "-color_range", "tv", target], check=True, timeout=ENCODE_S)


def vary(recording, folder, options):
    """The recording, varied, in a new folder."""
    left_out = ["*.mkv", "poses.csv"] + (["visibility.csv"] if options.every != 1 else [])
    shutil.copytree(recording.folder, folder, ignore=shutil.ignore_patterns(*left_out))
    for name in ("recording.toml", "calibration.toml"):
        path = folder / name
        text = as_h264(path.read_text(encoding="utf-8"))
        path.write_text(of_more_pixels(text, options.pixels) if options.pixels != 1 else text, encoding="utf-8")
    filters = RIG_FAULTS[options.rig](recording, folder) if options.rig else {}
    for camera, video in recording.videos.items():
        encode(recording.folder / video, folder / video, options, filters.get(camera))
    thin_out(folder / "frames.csv", options.every)
    if options.pixels != 1:
        enlarge_visibility(folder / "visibility.csv", options.pixels)
    if options.world != 1:
        scale_world(folder, options.world)
    for mesh in folder.rglob("*.obj") if options.mesh else ():
        FAULTS[options.mesh](mesh)
    return load_recording(folder)


def main():
    parser = maker_parser(__doc__)
    parser.add_argument("--pixels", type=float, default=1)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--world", type=float, default=1)
    parser.add_argument("--look", choices=LOOKS, default="as-is")
    parser.add_argument("--mesh", choices=FAULTS)
    parser.add_argument("--rig", choices=RIG_FAULTS)
    parser.add_argument("--quality", type=int, default=8)
    options = parser.parse_args()
    if not 0.25 <= options.pixels <= 4:
        parser.error("--pixels: 0.25 to 4")
    if not 1 <= options.every <= 30:
        parser.error("--every: 1 to 30")
    if not 0.01 <= options.world <= 100:
        parser.error("--world: 0.01 to 100")
    if options.every > 1 and options.rig:
        parser.error("--every and --rig: one of them")
    if options.every > 1 and (options.recording.folder / "axes.csv").exists():
        parser.error(f"{options.recording.folder}: cameras that stand still only (axes.csv)")
    meshes = [load_object(path)["mesh"] for path in options.recording.objects]
    if (options.world != 1 or options.mesh) and not all(mesh.endswith(".obj") for mesh in meshes):
        parser.error(f"{options.recording.folder}: --world and --mesh change .obj files only, its meshes are "
                     f"{', '.join(meshes)}")
    vary(options.recording, options.folder, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
