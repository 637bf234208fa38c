#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the daemon on the demo's recording and judges its streams from outside: ffmpeg is the client, the data in the
video is read as docs/sei.md says, and the truth comes from the recording. Prints what was checked; exits 0 or 1."""
import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import h264_sei  # noqa: E402
import truth_view  # noqa: E402

CAMERAS = ("left", "right", "side")
FRAMES = 100
WIDTH, HEIGHT = 640, 480
HIDDEN_BELOW = 0.001    # share of the object that is visible in `side` when we call it hidden
CHROMA_RAISED = 8       # a pixel with so much more U and V was drawn over; encoding noise stays below
AROUND_PX = 14          # looked at beyond the true box: further off would show as this much
BOX_WITHIN_PX = 6       # the drawn part against the true one, each side of the box
WAIT_S = 90             # bound of every wait


def write_config(root, folder):
    """The demo's installation with ports that the daemon chooses; it names them in its log."""
    with open(os.path.join(root, "config", "demo.toml"), encoding="utf-8") as file:
        text = file.read()
    text = text.replace("../recordings", os.path.join(root, "recordings"))
    for port in ("port = 8554", "port = 9754"):
        assert port in text, f"config/demo.toml has no '{port}'"
        text = text.replace(port, "port = 0")
    path = os.path.join(folder, "demo.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def wait_for_rtsp_port(daemon, log):
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if daemon.poll() is not None:
            raise RuntimeError(f"the daemon ended with status {daemon.returncode}")
        with open(log, encoding="utf-8") as file:
            found = re.search(r"info\s+rtsp://127\.0\.0\.1:(\d+)/\S+$", file.read(), re.MULTILINE)
        if found:
            return int(found.group(1))
        time.sleep(0.1)
    raise RuntimeError("the daemon names no address")


def pull_streams(folder, port):
    """FRAMES access units of every stream, as an ordinary RTSP client receives them, all at once."""
    pulls = {}
    for camera in CAMERAS:
        path = os.path.join(folder, camera + ".h264")
        pulls[camera] = (path, subprocess.Popen(
            ["ffmpeg", "-nostdin", "-loglevel", "error", "-rtsp_transport", "tcp", "-i",
             f"rtsp://127.0.0.1:{port}/{camera}", "-c", "copy", "-frames:v", str(FRAMES), "-f", "h264", "-y", path]))
    for camera, (path, process) in pulls.items():
        if process.wait(timeout=WAIT_S) != 0:
            raise RuntimeError(f"ffmpeg could not pull {camera}")
    return {camera: path for camera, (path, _) in pulls.items()}


def decode(path):
    """All images of a video as (Y, U, V) bytes."""
    raw = subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-i", path, "-f", "rawvideo", "-pix_fmt",
                          "yuv420p", "-fps_mode", "passthrough", "-"], check=True, capture_output=True,
                         timeout=WAIT_S).stdout
    luma, chroma = WIDTH * HEIGHT, WIDTH * HEIGHT // 4
    size = luma + 2 * chroma
    return [(raw[i:i + luma], raw[i + luma:i + luma + chroma], raw[i + luma + chroma:i + size])
            for i in range(0, len(raw) - size + 1, size)]


def hidden_part_box(drawn, original, true_box):
    """Box (xmin, ymin, xmax, ymax) of what is drawn in the hidden part's hue (more blue and more red than the image
    under it) in and around the true box; the label above stays out. None if next to nothing is drawn there."""
    half = WIDTH // 2
    columns = range(max(0, int(true_box[0] - AROUND_PX) // 2), min(half, int(true_box[2] + AROUND_PX) // 2))
    rows = range(max(0, int(true_box[1] - AROUND_PX) // 2), min(HEIGHT // 2, int(true_box[3] + AROUND_PX) // 2))
    found = [(2 * x + 0.5, 2 * y + 0.5) for y in rows for x in columns
             if drawn[1][y * half + x] - original[1][y * half + x] > CHROMA_RAISED
             and drawn[2][y * half + x] - original[2][y * half + x] > CHROMA_RAISED]
    if len(found) < 100:
        return None
    xs, ys = sorted(p[0] for p in found), sorted(p[1] for p in found)
    cut = len(found) // 200  # single pixels of noise do not widen the box
    return xs[cut], ys[cut], xs[-1 - cut], ys[-1 - cut]


class Truth:
    def __init__(self, recording):
        self.times = {c: truth_view.read_frames(os.path.join(recording, "frames.csv"), c) for c in CAMERAS}
        self.poses = truth_view.read_truth(os.path.join(recording, "truth.csv"))
        self.visible = truth_view.read_visibility(os.path.join(recording, "visibility.csv"), "side")
        self.vertices = truth_view.read_vertices(os.path.join(recording, "objects", "carton.obj"))
        self.side = truth_view.read_camera(os.path.join(recording, "calibration.toml"), "side")

    def box_in_side(self, index):
        pose = self.poses[self.times["side"][index]]
        pixels = truth_view.project_object(self.side, pose, self.vertices)
        xs, ys = [p[0] for p in pixels], [p[1] for p in pixels]
        return min(xs), min(ys), max(xs), max(ys)


def check_messages(camera, messages, truth):
    """What the data inside the video says, against the truth. Returns the median position error [mm]."""
    missing = sum(1 for m in messages if m is None)
    assert len(messages) >= FRAMES and missing == 0, f"{camera}: {missing} of {len(messages)} without a message"
    sequences = [m["sequence"] for m in messages]
    assert all(m["camera"] == camera for m in messages), f"{camera}: wrong camera name"
    assert sequences == sorted(set(sequences)), f"{camera}: frame numbers do not grow"
    assert all(a["capture_ns"] < b["capture_ns"] for a, b in zip(messages, messages[1:])), f"{camera}: times"
    errors = []
    for m in messages:
        pose = m["objects"][0]["pose"]
        if pose is None:
            continue
        index = m["sequence"] % len(truth.times[camera])
        true = truth.poses[truth.times[camera][index]][0]
        errors.append(1e3 * sum((a - b) ** 2 for a, b in zip(pose[0], true)) ** 0.5)
    assert len(errors) > 0.9 * len(messages), f"{camera}: only {len(errors)} of {len(messages)} carry a pose"
    return sorted(errors)[len(errors) // 2]


def check_hidden(messages, drawn, originals, truth):
    """In `side`, while the object is hidden: what is drawn covers the true silhouette's box and nothing else."""
    tested = 0
    worst = 0.0
    for message, image in zip(messages, drawn):
        index = message["sequence"] % len(originals)
        if truth.visible[index] >= HIDDEN_BELOW or message["objects"][0]["state"] not in ("tracking", "degraded"):
            continue
        true = truth.box_in_side(index)
        seen = hidden_part_box(image, originals[index], true)
        assert seen is not None, f"side, frame {index}: nothing is drawn while the object is hidden"
        off = max(abs(a - b) for a, b in zip(seen, true))
        assert off <= BOX_WITHIN_PX, f"side, frame {index}: drawn at {seen}, truly at {true}"
        worst = max(worst, off)
        tested += 1
    assert tested >= 5, f"only {tested} frames with the object hidden"
    return tested, worst


def run(options, root, folder):
    config = write_config(root, folder)
    log_path = os.path.join(folder, "daemon.log")
    truth = Truth(options.recording)
    with open(log_path, "w", encoding="utf-8") as log:
        daemon = subprocess.Popen([options.daemon, "--config", config], stderr=log)
    try:
        paths = pull_streams(folder, wait_for_rtsp_port(daemon, log_path))
    finally:
        daemon.send_signal(signal.SIGTERM)
        status = daemon.wait(timeout=WAIT_S)
    assert status == 0, f"the daemon ended with status {status}"
    for camera, path in paths.items():
        with open(path, "rb") as file:
            messages = h264_sei.images(file.read())
        drawn = decode(path)
        assert len(drawn) >= FRAMES, f"{camera}: {len(drawn)} images decoded"
        error = check_messages(camera, messages, truth)
        assert error < 10, f"{camera}: median position error {error:.1f} mm"
        print(f"{camera}: {len(drawn)} images decoded, a message in each, median position error {error:.2f} mm")
        if camera == "side":
            originals = decode(os.path.join(options.recording, "side.mkv"))
            tested, worst = check_hidden(messages, drawn, originals, truth)
            print(f"side: drawn over the true position in all {tested} frames that hide the object, "
                  f"sides of the box within {worst:.1f} px")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--daemon", required=True)
    parser.add_argument("--recording", required=True)
    parser.add_argument("--keep", help="folder for the pulled streams (default: a temporary one)")
    options = parser.parse_args()
    options.daemon, options.recording = os.path.abspath(options.daemon), os.path.abspath(options.recording)
    root = os.path.dirname(os.path.dirname(options.recording))
    try:
        if options.keep:
            os.makedirs(options.keep, exist_ok=True)
            run(options, root, options.keep)
        else:
            with tempfile.TemporaryDirectory() as folder:
                run(options, root, folder)
    except (AssertionError, RuntimeError, subprocess.SubprocessError) as problem:
        print(f"check_demo: {problem}", file=sys.stderr)
        return 1
    print("demo check passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
