#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks of the house: `house.py CHECK ROOT` prints what is wrong and exits 1, 0 or 77 (skipped)."""
import os
import re
import shutil
import subprocess
import sys

PIPELINE = {"capture", "observe", "fuse", "render", "stream", "record", "calibrate", "publish", "control"}
ROOMS = {"base", "geometry", "image", "model", "config"} | PIPELINE
FLOOR = {"base", "geometry", "image", "model"}

# room -> rooms it may include besides itself (DESIGN: rooms and arrows).
ARROWS = {"base": set(), "geometry": {"base"}, "image": {"base"}, "model": {"base", "geometry", "image"}}
ARROWS.update({room: FLOOR for room in PIPELINE})
ARROWS["config"] = FLOOR | PIPELINE
ARROWS["daemon"] = ROOMS
ARROWS["cli"] = ROOMS

SOURCE = (".cpp", ".hpp", ".h", ".cc")
VENDOR = re.compile(r'#\s*include\s*[<"](opencv2|gst|glib|GL|EGL|GLES\d?|libav|libsw|assimp|apriltag|'
                    r'linux/videodev2|arv|libcamera|ft2build|freetype|microhttpd|prometheus|systemd|'
                    r'toml\+\+|nlohmann|libyuv|CLI)[/.]?')
INCLUDE = re.compile(r'^\s*#\s*include\s*"sightline/(\w+)/')


def tracked(root):
    try:
        out = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=root, check=True,
                             capture_output=True).stdout.decode()
        return [f for f in out.split("\0") if f and os.path.isfile(os.path.join(root, f))]
    except (OSError, subprocess.CalledProcessError):
        found = []
        for folder, folders, files in os.walk(root):
            folders[:] = [f for f in folders if f not in ("build", ".git")]
            found += [os.path.relpath(os.path.join(folder, f), root) for f in files]
        return found


def lines(root, name):
    with open(os.path.join(root, name), encoding="utf-8", errors="replace") as file:
        return file.read().split("\n")


def room_of(name):
    parts = name.split("/")
    if parts[0] == "include" and len(parts) > 3 and parts[1] == "sightline":
        return parts[2]
    if parts[0] == "src" and len(parts) > 2:
        return parts[1]
    if parts[0] in ("daemon", "cli"):
        return parts[0]
    return None


def arrows(root):
    for name in tracked(root):
        room = room_of(name)
        if room is None or not name.endswith(SOURCE):
            continue
        if room not in ARROWS:
            yield f"{name}: '{room}' is not a room of the house"
            continue
        for number, line in enumerate(lines(root, name), 1):
            match = INCLUDE.match(line)
            if match and match.group(1) != room and match.group(1) not in ARROWS[room]:
                yield f"{name}:{number}: {room} may not include {match.group(1)}"


def licence(root):
    kinds = SOURCE + (".py", ".cmake", ".md", ".toml", ".sh", ".service", "CMakeLists.txt")
    for name in tracked(root):
        if name.startswith("recordings/") or "/corpus/" in name or "/data/" in name:
            continue
        script = name.startswith("scripts/") or name.startswith(".ci/")
        if name.endswith(kinds) or script:
            if not any("SPDX-License-Identifier: Apache-2.0" in line for line in lines(root, name)[:3]):
                yield f"{name}:1: no SPDX line"


def vendor_headers(root):
    for name in tracked(root):
        if name.startswith("include/") and name.endswith(SOURCE):
            for number, line in enumerate(lines(root, name), 1):
                if VENDOR.search(line):
                    yield f"{name}:{number}: vendor header in a public header: {line.strip()}"


def line_length(root):
    for name in tracked(root):
        if name.endswith(SOURCE):
            content = lines(root, name)
            for number, line in enumerate(content, 1):
                if len(line) > 100 and "http" not in line:
                    yield f"{name}:{number}: {len(line)} columns"
            if name.startswith("include/") and len(content) > 220:
                yield f"{name}: {len(content)} lines; a public header has at most 220"


def paths(root):
    # Absolute paths of somebody's machine. The pattern is split so that it does not find itself.
    pattern = re.compile(r"(/wo" r"rk/|/ro" r"ot/|/ho" r"me/\w+/|/bash_" r"jobs)")
    for name in tracked(root):
        if name.endswith((".png", ".mkv", ".svg")) or name.startswith("tests/house/"):
            continue
        for number, line in enumerate(lines(root, name), 1):
            if pattern.search(line):
                yield f"{name}:{number}: path of a machine: {line.strip()[:80]}"


def format(root):
    tool = shutil.which("clang-format")
    if tool is None:
        print("skipped: no clang-format")
        sys.exit(77)
    files = [f for f in tracked(root) if f.endswith(SOURCE)]
    for start in range(0, len(files), 40):
        out = subprocess.run([tool, "--dry-run", "-Werror", *files[start:start + 40]], cwd=root,
                             capture_output=True, check=False).stderr.decode()
        yield from sorted({line.split(": error")[0] + ": not formatted" for line in out.split("\n")
                           if "error: code should be clang-formatted" in line})


CHECKS = {f.__name__: f for f in (arrows, licence, vendor_headers, line_length, paths, format)}


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in CHECKS:
        print(f"usage: house.py {'|'.join(CHECKS)} ROOT", file=sys.stderr)
        return 2
    findings = list(CHECKS[sys.argv[1]](sys.argv[2]))
    print("\n".join(findings) if findings else f"{sys.argv[1]}: nothing found")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
