#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The clients that users copy, against a running daemon: Python, C++, and how the ROS bridge turns covariances; and
poses.mcap, read by a reader of ours and by @mcap/core where that is installed."""
import base64
import json
import os
import random
import shutil
import struct
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from api_test import Client  # noqa: E402
from support import BIN, ROOT, WAIT_S, DaemonCase, installation, wait_until  # noqa: E402

sys.path.insert(0, os.path.join(ROOT, "clients"))
import sightline_poses  # noqa: E402

# npm install --prefix build/npm @mcap/core
NODE_MODULES = os.environ.get("SIGHTLINE_NODE_MODULES", os.path.join(ROOT, "build", "npm", "node_modules"))
TOKENS = "anna operator 0123456789abcdef-anna\n"
READ_MCAP = """
const { McapStreamReader, McapIndexedReader } = require('@mcap/core');
const fs = require('fs');
(async () => {
  const bytes = new Uint8Array(fs.readFileSync(process.argv[1]));
  const out = { schemas: {}, topics: {}, bad: 0, indexed: null };
  const reader = new McapStreamReader();
  reader.append(bytes);
  const channels = new Map(), schemas = new Map();
  for (let r; (r = reader.nextRecord()); ) {
    if (r.type === 'Schema') { schemas.set(r.id, r.name); JSON.parse(new TextDecoder().decode(r.data)); }
    if (r.type === 'Channel') channels.set(r.id, r);
    if (r.type === 'Message') {
      const channel = channels.get(r.channelId);
      const data = JSON.parse(new TextDecoder().decode(r.data));
      const t = data.utc_ns ? null : BigInt(data.timestamp.sec) * 1000000000n + BigInt(data.timestamp.nsec);
      if (t !== null && t !== r.logTime) out.bad += 1;
      out.topics[channel.topic] = (out.topics[channel.topic] || 0) + 1;
      out.schemas[channel.topic] = schemas.get(channel.schemaId);
    }
  }
  if (process.argv[2] === 'whole') {
    const indexed = await McapIndexedReader.Initialize({ readable: {
      size: async () => BigInt(bytes.length),
      read: async (at, size) => bytes.subarray(Number(at), Number(at + size)) } });
    let count = 0, last = 0n;
    for await (const message of indexed.readMessages()) { count += 1; if (message.logTime < last) out.bad += 1; last = message.logTime; }
    out.indexed = count;
  }
  console.log(JSON.stringify(out));
})().catch((error) => { console.error(error); process.exit(1); });
"""


def mcap_records(data):
    """(opcode, content) of all whole records, chunks opened."""
    at = 0
    while at + 9 <= len(data):
        opcode, size = struct.unpack_from("<BQ", data, at)
        content = data[at + 9:at + 9 + size]
        if len(content) < size:
            return
        yield opcode, content
        if opcode == 6:
            compression, = struct.unpack_from("<I", content, 28)
            yield from mcap_records(content[32 + compression + 8:])
        at += 9 + size


class Clients(DaemonCase):
    def test_python_and_cpp_see_what_the_api_says(self):
        tokens = self.write("tokens", TOKENS)
        os.chmod(tokens, 0o600)
        daemon = self.start(installation(extra=f'[access]\ntokens = "{tokens}"\n'))
        token = TOKENS.split()[2]
        seen = {}
        for pose in sightline_poses.follow(f"http://127.0.0.1:{daemon.http}", token, again=False):
            if "translation_m" in pose:
                seen[pose["t_ns"]] = pose
            if len(seen) == 30:
                break
        self.assertTrue(all(len(pose["covariance"]) == 36 for pose in seen.values()))
        with self.assertRaises(OSError):
            next(sightline_poses.follow(f"http://127.0.0.1:{daemon.http}", "nonsense-nonsense"))
        program = os.path.join(BIN, "follow_poses")
        done = subprocess.run([program, str(daemon.http), "60", token], capture_output=True, text=True, timeout=WAIT_S, check=True)
        lines = [line.split() for line in done.stdout.split("\n")[:-1]]
        self.assertEqual(len(lines), 60)
        tracked = [line for line in lines if line[3] == "1"]
        self.assertTrue(all(line[0] == "carton" and float(line[5]) > 0 for line in tracked))
        self.assertGreater(len(tracked), 30)
        refused = subprocess.run([program, str(daemon.http), "1"], capture_output=True, text=True, timeout=WAIT_S, check=False)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("401", refused.stderr)
        self.assertEqual(daemon.stop(), 0)

    def test_the_bridge_turns_covariances_into_the_axes_of_the_world(self):
        rng = random.Random(1)
        q = [rng.gauss(0, 1) for _ in range(4)]
        q = [part / sum(p * p for p in q) ** 0.5 for part in q]
        turn = sightline_poses.rotation_matrix(*q)
        factor = [[rng.gauss(0, 1) for _ in range(6)] for _ in range(6)]
        covariance = [sum(factor[i][k] * factor[j][k] for k in range(6)) for i in range(6) for j in range(6)]
        got = sightline_poses.ros_covariance({"rotation_wxyz": q, "covariance": covariance})
        # By its meaning: columns of the factor are deviations, (turn, shift) in the object's axes.
        def to_world(column):
            parts = [[factor[3 * half + i][column] for i in range(3)] for half in (1, 0)]
            return [sum(turn[i][j] * part[j] for j in range(3)) for part in parts for i in range(3)]
        columns = [to_world(k) for k in range(6)]
        for i in range(6):
            for j in range(6):
                self.assertAlmostEqual(got[6 * i + j], sum(c[i] * c[j] for c in columns), places=9)


class Mcap(DaemonCase):
    def record(self, kill):
        os.mkdir(self.path("recordings"))
        daemon = self.start(installation(
            extra=f'[record]\nenabled = true\nkinds = ["poses"]\nposes = "both"\ndirectory = "{self.path("recordings")}"\n'))
        client = Client(daemon.http)
        written = lambda: json.loads(client.get("/api/v1/recordings")[2])["kinds"][2].get("written", 0)
        wait_until(lambda: written() > 200, "poses are written")
        if kill:
            daemon.process.kill()
            daemon.process.wait(timeout=WAIT_S)
        else:
            self.assertEqual(daemon.stop(), 0)
        folder = self.path("recordings", os.listdir(self.path("recordings"))[0])
        with open(os.path.join(folder, "poses.csv"), encoding="utf-8") as file:
            rows = [line.split(",") for line in file.read().split("\n")[1:-1]]
        return os.path.join(folder, "poses.mcap"), rows

    def by_node(self, path, whole):
        node = shutil.which("node")
        if node is None or not os.path.isdir(os.path.join(NODE_MODULES, "@mcap", "core")):
            return None
        done = subprocess.run([node, "-e", READ_MCAP, path, "whole" if whole else "cut"], capture_output=True, text=True,
                              timeout=WAIT_S, check=False, env=dict(os.environ, NODE_PATH=NODE_MODULES))
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_video_is_in_the_log_if_asked_for(self):
        os.mkdir(self.path("recordings"))
        daemon = self.start(installation(
            extra='[record]\nkinds = ["poses"]\nposes = "mcap"\nposes_video = true\n'
                  f'directory = "{self.path("recordings")}"\n'))
        client = Client(daemon.http)
        encoded = lambda: sum(daemon.find_metric("sightline_images_encoded_total", camera=c) or 0 for c in ("left", "right"))
        wait_until(lambda: "translation_m" in daemon.state()["objects"][0], "the carton is tracked")
        self.assertEqual(encoded(), 0)  # nobody watches, nothing is logged
        self.assertEqual(client.post("/api/v1/recordings/start", {"kinds": ["poses"]})[0], 202)
        wait_until(lambda: encoded() > 100, "the log has the streams encoded")
        self.assertEqual(client.post("/api/v1/recordings/stop", {})[0], 202)
        self.assertEqual(daemon.stop(), 0)
        path = self.path("recordings", os.listdir(self.path("recordings"))[0], "poses.mcap")
        with open(path, "rb") as file:
            data = file.read()
        messages = [json.loads(content[22:]) for opcode, content in mcap_records(data[8:-8]) if opcode == 5]
        for camera in ("left", "right", "side"):
            video = [m for m in messages if m.get("format") == "h264" and m["frame_id"] == camera]
            self.assertEqual(set(video[0]), {"timestamp", "frame_id", "format", "data"})
            stream = b"".join(base64.b64decode(m["data"], validate=True) for m in video)
            self.assertEqual(stream[:4], b"\0\0\0\1")
            # An independent decoder takes every packet for one image, from the first on.
            with open(self.path(f"{camera}.h264"), "wb") as file:
                file.write(stream)
            seen = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries",
                                   "stream=nb_read_frames,width,height", "-of", "csv=p=0", self.path(f"{camera}.h264")],
                                  capture_output=True, text=True, timeout=WAIT_S, check=True)
            self.assertEqual((seen.stdout.strip(), seen.stderr), (f"640,480,{len(video)}", ""))
        read = self.by_node(path, whole=True)
        if read is None:
            self.skipTest("no independent reader: npm install --prefix build/npm @mcap/core")
        self.assertEqual(read["bad"], 0)
        self.assertEqual(read["schemas"]["/cameras/left/video"], "foxglove.CompressedVideo")

    def test_a_finished_file_is_read_by_its_index(self):
        path, rows = self.record(kill=False)
        with open(path, "rb") as file:
            data = file.read()
        self.assertTrue(data.startswith(b"\x89MCAP0\r\n") and data.endswith(b"\x89MCAP0\r\n"))
        messages = [json.loads(content[22:]) for opcode, content in mcap_records(data[8:-8]) if opcode == 5]
        estimates = [m for m in messages if "state" in m]
        self.assertEqual(len(estimates), len(rows))
        self.assertEqual([m["t_ns"] for m in estimates], [int(row[0]) for row in rows])
        tracked = sum(row[3] != "" for row in rows)
        transforms = [m for m in messages if m.get("child_frame_id") == "carton"]
        self.assertEqual(len(transforms), tracked)
        self.assertEqual(set(transforms[0]), {"timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"})
        read = self.by_node(path, whole=True)
        if read is None:
            self.skipTest("no independent reader: npm install --prefix build/npm @mcap/core")
        self.assertEqual(read["bad"], 0)
        self.assertEqual(read["topics"], {"/objects/carton/estimate": len(rows), "/objects/carton/pose": tracked, "/tf": tracked})
        self.assertEqual(read["schemas"]["/tf"], "foxglove.FrameTransform")
        self.assertEqual(read["schemas"]["/objects/carton/pose"], "foxglove.PoseInFrame")
        self.assertEqual(read["indexed"], len(rows) + 2 * tracked)

    def test_a_file_that_was_cut_off_is_read_up_to_there(self):
        path, rows = self.record(kill=True)
        with open(path, "rb") as file:
            data = file.read()
        count = sum(1 for opcode, content in mcap_records(data[8:]) if opcode == 5 and b'"state"' in content)
        self.assertGreater(count, 100)
        self.assertGreaterEqual(count, len(rows) - 150)
        read = self.by_node(path, whole=False)
        if read is None:
            self.skipTest("no independent reader: npm install --prefix build/npm @mcap/core")
        self.assertEqual(read["topics"]["/objects/carton/estimate"], count)


if __name__ == "__main__":
    unittest.main(verbosity=2)
