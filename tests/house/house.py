#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks of the house: `house.py CHECK ROOT` prints what is wrong and exits 1, 0 or 77 (skipped)."""
import os
import re
import shutil
import subprocess
import sys

import cpp_text

PIPELINE = {"capture", "observe", "fuse", "render", "stream", "record", "calibrate", "publish", "control"}
ROOMS = {"base", "geometry", "image", "model", "config", "pipeline"} | PIPELINE
FLOOR = {"base", "geometry", "image", "model"}

# room -> rooms it may include besides itself (docs/architecture.md).
ARROWS = {"base": set(), "geometry": {"base"}, "image": {"base"}, "model": {"base", "geometry", "image"}}
ARROWS.update({room: FLOOR for room in PIPELINE})
ARROWS["config"] = FLOOR | PIPELINE
ARROWS["pipeline"] = ROOMS
ARROWS["daemon"] = ROOMS
ARROWS["cli"] = ROOMS

# room -> sub-room -> sub-rooms of the same room that it may include besides itself.
SUBROOM_ARROWS = {
    "observe": {"terms": set(), "shape": {"terms"},
                **{modality: {"terms", "shape"}
                   for modality in ("fiducial", "track", "detect", "features", "scene", "stereo", "turn")}},
    "capture": {"common": set(), "axes": {"v4l2"}, "decode": {"common"},
                **{source: {"common", "decode"} for source in ("v4l2", "aravis", "libcamera", "network")}},
    "render": {"mesh": set(), "raster": {"mesh"}, "gpu": {"mesh", "raster"},
               "overlay": {"mesh", "raster", "gpu"}},
}
# The command line runs the daemon's parts (`record`, `cameras --sync`, `calibrate capture`) through these headers alone.
DAEMON_FOR_CLI = {"daemon.hpp", "signals.hpp", "action_worker.hpp", "capture_session.hpp", "capture_files.hpp",
                  "capture_words.hpp", "image_recording.hpp", "servers.hpp"}

MAX_FILES_IN_FOLDER = 30
MAX_LINES_OF_FILE = {"product": 450, "test": 700}
MAX_LINES_OF_FUNCTION = {"product": 60, "test": 140}
# Files that may be longer, with the reason; three at most.
LONG_FILES = {}
# Rooms whose private headers are not in a namespace of their own yet.
SHARED_NAMESPACE = {"render"}

SOURCE = (".cpp", ".hpp", ".h", ".cc")
VENDOR = re.compile(r'#\s*include\s*[<"](opencv2|gst|glib|GL|EGL|GLES\d?|libav|libsw|assimp|apriltag|'
                    r'linux/videodev2|arv|libcamera|ft2build|freetype|microhttpd|prometheus|systemd|'
                    r'toml\+\+|nlohmann|libyuv|CLI|ceres|glog|yaml-cpp)[/.]?')
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"')
PROGRAM_SOURCE = re.compile(r"(?:^|[\s\"/}])(?:daemon|cli)/[\w/]+\.cpp")
# "GREY" is the name of a pixel format; capitals are left alone.
BRITISH = re.compile(r"\b\w*?(?:[Cc]olour|[Gg]rey|[Cc]entre|[Nn]eighbour|[Bb]ehaviour|[Ff]avour|[Hh]onour|"
                     r"[Rr]asteris|[Nn]ormalis|[Ii]nitialis|[Oo]ptimis|[Ll]inearis|[Ss]ynchronis|"
                     r"[Rr]ecognis|[Mm]inimis|[Mm]aximis|[Ss]erialis|[Qq]uantis|[Cc]atalogue|[Aa]rtefact|"
                     r"[Aa]nalyse|[Ss]ummaris|[Vv]ectoris|(?:[Mm]illi|[Kk]ilo|[Cc]enti)?[Mm]etres?\b)\w*")

# Controls of libcamera are spelled as it spells them.
LIBCAMERA_NAMES = {"ColourGains", "ColourCorrectionMatrix"}


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


def subroom_of(name):
    parts = name.split("/")
    place = 3 if parts[0] == "include" else 2
    return parts[place] if len(parts) > place + 1 else None


def includes(root, room_filter=lambda room: True):
    """(file, line, room, include) of every quoted include of the product."""
    for name in tracked(root):
        room = room_of(name)
        if room is None or not name.endswith(SOURCE) or not room_filter(room):
            continue
        for number, line in enumerate(lines(root, name), 1):
            match = INCLUDE.match(line)
            if match:
                yield name, number, room, match.group(1)


def arrows(root):
    for name in tracked(root):
        room = room_of(name)
        if room is not None and name.endswith(SOURCE) and room not in ARROWS:
            yield f"{name}: '{room}' is not a room of the house"
    for name, number, room, include in includes(root, ARROWS.__contains__):
        parts = include.split("/")
        if parts[0] == "sightline" and len(parts) > 2 and parts[1] != room and parts[1] not in ARROWS[room]:
            yield f"{name}:{number}: {room} may not include {parts[1]}"


def subroom_arrows(root):
    for name in tracked(root):
        room = room_of(name)
        if room in SUBROOM_ARROWS and name.endswith(SOURCE) and subroom_of(name) not in SUBROOM_ARROWS[room]:
            yield f"{name}: lies in no sub-room of {room}"
    for name, number, room, include in includes(root, SUBROOM_ARROWS.__contains__):
        parts = include.removeprefix("sightline/").split("/")
        subroom = subroom_of(name)
        known = SUBROOM_ARROWS[room]
        if parts[0] != room or len(parts) < 3 or subroom not in known or parts[1] == subroom:
            continue
        if parts[1] not in known[subroom]:
            yield f"{name}:{number}: {room}/{subroom} may not include {room}/{parts[1]}"


def private_headers(root):
    """Private headers are included by their path from src/, in their own room only."""
    for name, number, room, include in includes(root):
        if include.startswith("sightline/"):
            continue
        if name.startswith("include/"):
            yield f"{name}:{number}: a public header includes the private {include}"
        elif room in ("daemon", "cli"):
            folder = os.path.join(root, room)
            own = include == "version.hpp" or os.path.isfile(os.path.join(folder, include))
            lent = room == "cli" and os.path.basename(include) in DAEMON_FOR_CLI
            if not own and not lent:
                yield f"{name}:{number}: {room} may not include {include}"
        elif include.split("/")[0] != room:
            yield f"{name}:{number}: {include} is no path of a private header of {room}"


def private_namespaces(root):
    """What a private header declares is in the namespace of its room."""
    for name in tracked(root):
        room = room_of(name)
        if not name.startswith("src/") or not name.endswith(".hpp") or room in SHARED_NAMESPACE:
            continue
        own = re.compile(rf"^namespace sightline::{room}(?:::\w+)* {{")
        opened = [line for line in lines(root, name) if line.startswith("namespace ")]
        if opened and not any(own.match(line) for line in opened):
            yield f"{name}: not in namespace sightline::{room}"


NAMESPACE = re.compile(r"^namespace ?([\w:]*) ?\{|^\}  // namespace")
TYPE = re.compile(r"^(?:struct|class|enum class|enum|union) (\w+)(?: final)?(?: : [^;]*)?\s*\{")


def types(root, name):
    """(line, qualified name) of every type that other sources of the program could mean as well."""
    inside = []
    for number, line in enumerate(lines(root, name), 1):
        namespace = NAMESPACE.match(line)
        if namespace and line.startswith("}"):
            del inside[-1:]
        elif namespace:
            inside.append(namespace.group(1))
        elif (found := TYPE.match(line)) and "" not in inside:
            yield number, "::".join([*inside, found.group(1)])


def one_definition(root):
    """A name of a type means one type in the whole program: no linker complains if two of them differ."""
    first = {}
    for name in tracked(root):
        if name.startswith(("include/", "src/", "daemon/", "cli/")) and name.endswith(SOURCE):
            for number, qualified in types(root, name):
                if first.setdefault(qualified, name) != name:
                    yield f"{name}:{number}: {qualified} is defined in {first[qualified]}, too"


def program_sources(root):
    """No test and no bench compiles the sources of a program."""
    for name in tracked(root):
        if name.startswith(("tests/", "bench/")) and name.endswith(("CMakeLists.txt", ".cmake")):
            for number, line in enumerate(lines(root, name), 1):
                if PROGRAM_SOURCE.search(line):
                    yield f"{name}:{number}: compiles a program's source: {line.strip()}"


def folders(root):
    count = {}
    for name in tracked(root):
        if name.startswith(("src/", "include/", "daemon/", "cli/", "bench/", "scripts/", "docs/", "tests/")):
            folder = os.path.dirname(name)
            count[folder] = count.get(folder, 0) + 1
    for folder, files in sorted(count.items()):
        if files > MAX_FILES_IN_FOLDER and "/corpus" not in folder:
            yield f"{folder}: {files} files; at most {MAX_FILES_IN_FOLDER}"


def lengths(root):
    if len(LONG_FILES) > 3:
        yield "house.py: more than three long files"
    for name in tracked(root):
        if not name.endswith(SOURCE):
            continue
        content = lines(root, name)
        kind = "test" if name.startswith(("tests/", "bench/")) else "product"
        if len(content) - 1 > MAX_LINES_OF_FILE[kind] and name not in LONG_FILES:
            yield f"{name}: {len(content) - 1} lines; at most {MAX_LINES_OF_FILE[kind]}"
        for first, number, function in cpp_text.functions("\n".join(content)):
            if number > MAX_LINES_OF_FUNCTION[kind]:
                yield f"{name}:{first}: {function} has {number} lines; at most {MAX_LINES_OF_FUNCTION[kind]}"


def spelling(root):
    kinds = SOURCE + (".md", ".py", ".toml", ".cmake", ".txt", ".inl", ".sh", ".1", ".8", ".5")
    for name in tracked(root):
        if not name.endswith(kinds) or name.startswith(("tests/house/", "recordings/")) or "/corpus/" in name:
            continue
        for number, line in enumerate(lines(root, name), 1):
            for word in BRITISH.findall(line):
                if word in LIBCAMERA_NAMES:
                    continue
                yield f"{name}:{number}: {word}: spelled as in the US, please"


def license(root):
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


CHECKS = {f.__name__: f for f in (arrows, subroom_arrows, private_headers, private_namespaces, one_definition,
                                  program_sources, folders, lengths, spelling, license, vendor_headers, line_length,
                                  paths, format)}


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in CHECKS:
        print(f"usage: house.py {'|'.join(CHECKS)} ROOT", file=sys.stderr)
        return 2
    findings = list(CHECKS[sys.argv[1]](sys.argv[2]))
    print("\n".join(findings) if findings else f"{sys.argv[1]}: nothing found")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
