# SPDX-License-Identifier: Apache-2.0
"""What goes wrong with cameras, put into a folder of a recording: files are changed, and what is to be done with each
camera's images is returned as filters of ffmpeg."""
import math
import random
import re

from recording_tools import read_csv, write_csv

NUMBER = r"[-+0-9.eE]+"


def change_cameras(folder, change):
    """Writes calibration.toml with change(index, text) for the text of each camera."""
    path = folder / "calibration.toml"
    head, *cameras = path.read_text(encoding="utf-8").split("[[camera]]")
    path.write_text("[[camera]]".join([head] + [change(i, text) for i, text in enumerate(cameras)]), encoding="utf-8")


def scale_number(text, key, factor):
    return re.sub(rf"(?m)^(\s*{key}\s*=\s*)({NUMBER})", lambda m: f"{m[1]}{float(m[2]) * factor:.9g}", text)


def change_frames(folder, change):
    """Writes frames.csv with the rows that change(rows) returns, in the order of their capture."""
    rows = read_csv(folder / "frames.csv")
    rows = sorted(change(rows), key=lambda row: int(row["capture_ns"]))
    write_csv(folder / "frames.csv", rows[0].keys(), rows)


def turned(rotation, axis, angle):
    """The rotation (three rows) after a turn about an axis of the camera (unit, three numbers)."""
    x, y, z = axis
    c, s, d = math.cos(angle), math.sin(angle), 1 - math.cos(angle)
    turn = [[c + x * x * d, x * y * d - z * s, x * z * d + y * s], [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
            [z * x * d - y * s, z * y * d + x * s, c + z * z * d]]
    return [[sum(row[k] * turn[k][j] for k in range(3)) for j in range(3)] for row in rotation]


def bumped(recording, folder):
    """Every camera is turned by two pixels."""
    chance = random.Random(3)

    def change(_, text):
        match = re.search(r"world_from_camera\s*=\s*\[\n(.*?)\n\]", text, re.S)
        rows = [[float(x) for x in re.findall(NUMBER, row)] for row in re.findall(r"\[([^\[\]]+)\]", match[1])]
        focal = float(re.search(rf"(?m)^\s*fx\s*=\s*({NUMBER})", text)[1])
        angle = chance.uniform(0, 2 * math.pi)
        rotation = turned([row[:3] for row in rows[:3]], (math.cos(angle), math.sin(angle), 0), 2 / focal)
        rows[:3] = [new + [old[3]] for new, old in zip(rotation, rows)]
        matrix = "".join("  [%s],\n" % ", ".join(f"{x:.12g}" for x in row) for row in rows)
        return text[:match.start()] + "world_from_camera = [\n" + matrix + "]" + text[match.end():]

    change_cameras(folder, change)
    return {}


def zoomed(recording, folder):
    """Focal lengths are off by 0.7 %, in turn too long and too short."""
    def change(i, text):
        factor = 1.007 if i % 2 == 0 else 0.993
        return scale_number(scale_number(text, "fx", factor), "fy", factor)

    change_cameras(folder, change)
    return {}


def swapped(recording, folder):
    """The two first cameras are plugged in the wrong way round."""
    names = recording.cameras[:2]
    text = (folder / "calibration.toml").read_text(encoding="utf-8")
    other = dict(zip(names, reversed(names)))
    text = re.sub(r'(?m)^(name\s*=\s*")([^"]*)"', lambda m: f'{m[1]}{other.get(m[2], m[2])}"', text)
    (folder / "calibration.toml").write_text(text, encoding="utf-8")
    return {}


def late(recording, folder):
    """The last camera's stamps are 15 ms late."""
    def change(rows):
        for row in rows:
            if row["camera"] == recording.cameras[-1]:
                row["capture_ns"] = int(row["capture_ns"]) + 15_000_000
                row["arrival_ns"] = max(int(row["arrival_ns"]), row["capture_ns"])
        return rows

    change_frames(folder, change)
    return {}


def jitter(recording, folder):
    """Stamps are off by up to 6 ms, each by another time."""
    chance = random.Random(3)

    def change(rows):
        newest = {}
        for row in rows:
            stamp = int(row["capture_ns"]) + int(chance.uniform(-6e6, 6e6))
            newest[row["camera"]] = row["capture_ns"] = max(stamp, newest.get(row["camera"], 0) + 1_000_000)
            row["arrival_ns"] = max(int(row["arrival_ns"]), row["capture_ns"])
        return rows

    change_frames(folder, change)
    return {}


def without(recording, folder, lost):
    """Without the frames for which lost(camera, sequence) says so; the first one of each camera stays."""
    gone = {camera: [] for camera in recording.cameras}

    def change(rows):
        kept, seen = [], dict.fromkeys(gone, 0)
        for row in rows:
            camera = row["camera"]
            number = seen[camera]
            seen[camera] += 1
            if number > 0 and lost(camera, number):
                gone[camera].append(number)
                continue
            row["sequence"] = number - len(gone[camera])
            kept.append(row)
        return kept

    change_frames(folder, change)
    return {camera: "select='not(%s)',setpts=N/30/TB" % ("+".join(f"eq(n\\,{i})" for i in numbers) or "0")
            for camera, numbers in gone.items()}


def lossy(recording, folder):
    """A fifth of all frames is lost, by chance."""
    chance = random.Random(3)
    return without(recording, folder, lambda *_: chance.random() < 0.2)


def slow(recording, folder):
    """The last camera takes a third of the images that it took."""
    return without(recording, folder, lambda camera, number: camera == recording.cameras[-1] and number % 3 != 0)


def frozen(recording, folder):
    """The first camera shows the same image from a third of the recording on, with new stamps."""
    camera = recording.cameras[0]
    count = len(recording.capture_times(camera))
    shown = count // 3
    return {camera: f"select='lt(n\\,{shown})',tpad=stop={count - shown}:stop_mode=clone,setpts=N/30/TB"}


def mirrored(recording, folder):
    """The first camera's driver mirrors its images."""
    return {recording.cameras[0]: "hflip"}


def shaking(recording, folder):
    """Cameras shake by two pixels."""
    shake = "pad=iw+8:ih+8:4:4:color=gray,crop=iw-8:ih-8:x='4+2*sin(n*1.3)':y='4+1.5*sin(n*0.9+1)'"
    return dict.fromkeys(recording.cameras, shake)


RIG_FAULTS = {"bumped": bumped, "zoomed": zoomed, "swapped": swapped, "late": late, "jitter": jitter, "lossy": lossy,
              "slow": slow, "frozen": frozen, "mirrored": mirrored, "shaking": shaking}
