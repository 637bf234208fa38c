#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a running daemon: started by configuration, by order and by an event; what they hold plays and replays,
also after kill -9; a full disk, a missing folder and the quota are kept to and said, and nothing live suffers."""
import csv
import json
import os
import shutil
import signal
import subprocess
import time
import unittest

from api_test import Client
from support import BENCH, WAIT_S, DaemonCase, installation, sightline, wait_until


def frames_of(path):
    """Images that a decoder makes of the file, without an error."""
    done = subprocess.run(["ffmpeg", "-nostdin", "-v", "error", "-xerror", "-i", path, "-f", "null", "-", "-progress", "-"],
                          capture_output=True, text=True, timeout=WAIT_S, check=False)
    assert done.returncode == 0 and not done.stderr, f"{path}: {done.stderr}"
    return int([line for line in done.stdout.split("\n") if line.startswith("frame=")][-1][6:])


def seconds_of(path):
    """From the first to the last packet, by the container."""
    done = subprocess.run(["ffprobe", "-v", "error", "-show_entries", "packet=pts_time", "-of", "csv=p=0", path],
                          capture_output=True, text=True, timeout=WAIT_S, check=True)
    times = [float(line.split(",")[0]) for line in done.stdout.split()]
    return times[-1] - times[0]


class Recordings(DaemonCase):
    def setUp(self):
        super().setUp()
        self.directory = self.path("recordings")
        os.mkdir(self.directory)

    def text(self, record="", **options):
        return installation(extra=f'[record]\ndirectory = "{self.directory}"\n{record}', **options)

    def names(self, ending=""):
        return sorted(name for name in os.listdir(self.directory) if name.endswith(ending))

    def kind(self, client, kind):
        return next(k for k in json.loads(client.get("/api/v1/recordings")[2])["kinds"] if k["kind"] == kind)

    def wait_written(self, client, kind, least):
        wait_until(lambda: self.kind(client, kind).get("written", 0) >= least, f"{least} are written of {kind}")


class Orders(Recordings):
    def test_the_three_kinds_are_started_marked_listed_fetched_and_stopped(self):
        daemon = self.start(self.text('poses = "both"\n'))
        client = Client(daemon.http)
        self.assertEqual(self.names(), [])
        self.assertEqual(daemon.metric("sightline_images_encoded_total", camera="left"), 0)
        self.assertEqual(client.post("/api/v1/recordings/mark", {"text": "early"})[0], 503)
        self.assertEqual(client.post("/api/v1/recordings/start", {"kinds": ["everything"]})[0], 400)
        self.assertEqual(client.post("/api/v1/recordings/start", {"kinds": "viewing"})[0], 400)
        self.assertEqual(client.post("/api/v1/recordings/stop", {"seconds": 1})[0], 400)
        kinds = ["viewing", "source", "poses"]
        self.assertEqual(client.post("/api/v1/recordings/start", {"kinds": kinds})[0], 202)
        for kind in kinds:
            self.wait_written(client, kind, 60)
        self.assertEqual(daemon.metric("sightline_recording_running", kind="viewing"), 1)
        self.assertEqual(client.post("/api/v1/recordings/mark", {"text": 'a "door", opened'})[0], 202)
        wait_until(lambda: all(os.path.exists(os.path.join(self.directory, name, "marks.csv")) for name in self.names()),
                   "the mark is written")
        self.assertEqual(client.post("/api/v1/recordings/stop", {"kinds": ["viewing"]})[0], 202)
        wait_until(lambda: self.kind(client, "viewing")["state"] == "off", "it ends")
        self.assertEqual(self.kind(client, "poses")["state"], "recording")
        self.assertEqual(client.post("/api/v1/recordings/stop")[0], 202)
        wait_until(lambda: all(self.kind(client, kind)["state"] == "off" for kind in kinds), "all end")
        # Nothing is encoded any more.
        wait_until(lambda: self.encoded_in_a_second(daemon) == 0, "the encoder rests")
        self.check_files(client)
        self.assertEqual(daemon.stop(), 0)

    def encoded_in_a_second(self, daemon):
        before = daemon.metric("sightline_images_encoded_total", camera="left")
        time.sleep(1)
        return daemon.metric("sightline_images_encoded_total", camera="left") - before

    def check_files(self, client):
        names = self.names()
        self.assertEqual(len(names), 3)
        viewing, poses = self.names("-viewing")[0], self.names("-poses")[0]
        with open(os.path.join(self.directory, viewing, "marks.csv"), encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["text"] for row in rows], ['a "door", opened'])
        for camera in ("left", "right", "side"):
            path = os.path.join(self.directory, viewing, f"{camera}-0001.mp4")
            self.assertGreaterEqual(frames_of(path), 15)
        with open(os.path.join(self.directory, poses, "poses.csv"), encoding="utf-8") as file:
            self.assertGreaterEqual(sum(1 for _ in file), 60)
        source = next(name for name in names if name.endswith("Z"))
        sightline("check", os.path.join(self.directory, source))
        # As listed, whole and in part.
        path = f"{viewing}/left-0001.mp4"
        with open(os.path.join(self.directory, path), "rb") as file:
            content = file.read()
        wait_until(lambda: client.get(f"/api/v1/recordings/{path}")[2] == content, "the whole file comes")
        for header, first, last in (("bytes=10-19", 10, 19), (f"bytes={len(content) - 5}-", len(content) - 5, len(content) - 1),
                                    ("bytes=-7", len(content) - 7, len(content) - 1)):
            connection, answer = client.open("GET", f"/api/v1/recordings/{path}", headers={"Range": header})
            self.assertEqual(answer.status, 206)
            self.assertEqual(answer.headers["Content-Range"], f"bytes {first}-{last}/{len(content)}")
            self.assertEqual(answer.headers["Content-Type"], "video/mp4")
            self.assertEqual(answer.read(), content[first:last + 1])
            connection.close()
        connection, answer = client.open("GET", f"/api/v1/recordings/{path}", headers={"Range": f"bytes={len(content)}-"})
        self.assertEqual(answer.status, 416)
        connection.close()
        for nothing in ("..%2F..%2Fetc/passwd", f"{viewing}/nothing.mp4", "../recordings", f"{viewing}/..", "etc/passwd"):
            self.assertEqual(client.get(f"/api/v1/recordings/{nothing}")[0], 404, nothing)

    def test_a_recording_may_end_by_itself(self):
        daemon = self.start(self.text())
        client = Client(daemon.http)
        self.assertEqual(client.post("/api/v1/recordings/start", {"kinds": ["viewing"], "seconds": 2})[0], 202)
        wait_until(lambda: self.kind(client, "viewing")["state"] == "recording", "it begins")
        wait_until(lambda: self.kind(client, "viewing")["state"] == "off", "it ends")
        self.assertEqual(len(self.names("-viewing")), 1)

    def test_without_a_directory_nothing_is_recorded(self):
        client = Client(self.start().http)
        status, answer = client.post("/api/v1/recordings/start")
        self.assertEqual(status, 503)
        self.assertIn("[record] directory", answer["error"])

    def test_only_an_operator_starts(self):
        tokens = self.write("tokens", "anna operator 0123456789abcdef-anna\nwall viewer 0123456789abcdef-wall\n")
        os.chmod(tokens, 0o600)
        text = self.text() + f'[access]\ntokens = "{tokens}"\n'
        daemon = self.start(text)
        wall = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-wall"})
        anna = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-anna"})
        for order in ("start", "stop", "mark"):
            self.assertEqual(wall.post(f"/api/v1/recordings/{order}")[0], 403)
        self.assertEqual(wall.get("/api/v1/recordings")[0], 200)
        self.assertEqual(anna.post("/api/v1/recordings/start", {"kinds": ["poses"]})[0], 202)


class Crash(Recordings):
    def test_after_kill_9_everything_up_to_the_last_second_plays_and_replays(self):
        daemon = self.start(self.text('enabled = true\nkinds = ["viewing", "source", "poses"]\nposes = "both"\n'))
        client = Client(daemon.http)
        self.wait_written(client, "viewing", 400)
        written = {kind: self.kind(client, kind)["written"] for kind in ("viewing", "source", "poses")}
        # What was written when we asked is more than a second old once it is killed.
        time.sleep(1.5)
        daemon.process.send_signal(signal.SIGKILL)
        daemon.process.wait(timeout=WAIT_S)
        viewing = os.path.join(self.directory, self.names("-viewing")[0])
        files = [os.path.join(viewing, name) for name in os.listdir(viewing)]
        self.assertGreaterEqual(sum(map(frames_of, files)), written["viewing"])
        with open(os.path.join(self.directory, self.names("-poses")[0], "poses.csv"), encoding="utf-8") as file:
            self.assertGreaterEqual(sum(1 for _ in file), written["poses"])
        source = os.path.join(self.directory, self.names("Z")[0])
        sightline("replay", source, "--poses", self.path("poses.csv"))
        with open(os.path.join(source, "frames.csv"), encoding="utf-8") as file:
            self.assertGreaterEqual(sum(1 for _ in file), written["source"])


class Replay(Recordings):
    def test_a_source_recording_replays_to_the_poses_that_were_estimated_live(self):
        daemon = self.start(self.text("enabled = true\n"))
        client = Client(daemon.http)
        self.wait_written(client, "source", 400)
        self.assertEqual(client.post("/api/v1/recordings/stop")[0], 202)
        wait_until(lambda: self.kind(client, "source")["state"] == "off", "it ends")
        self.assertEqual(daemon.stop(), 0)
        source = os.path.join(self.directory, self.names("Z")[0])
        sightline("replay", source, "--poses", self.path("poses.csv"))
        replayed = self.rows(self.path("poses.csv"))
        live = self.rows(os.path.join(source, "poses.csv"))
        both = sorted(set(live) & set(replayed))
        self.assertGreater(len(both), 100)
        # The first second has no history in the replay.
        both = [t for t in both if t > both[0] + 1_000_000_000]
        # A live estimate is of the cameras heard by then; late ones correct only what follows.
        apart = sorted(max(abs(a - b) for a, b in zip(live[t], replayed[t])) for t in both)
        self.assertLess(apart[len(apart) // 2], 0.5e-3)
        self.assertLess(apart[int(0.95 * len(apart))], 3e-3)

    @staticmethod
    def rows(path):
        """Positions [m] of the tracked object by capture time."""
        with open(path, encoding="utf-8") as file:
            return {int(row["t_ns"]): tuple(float(row[k]) for k in ("tx", "ty", "tz")) for row in csv.DictReader(file)
                    if row["state"] == "tracking"}


class Room(Recordings):
    def test_segments_and_the_quota(self):
        # About 100 kB each; those of other people stay whatever the quota says.
        foreign = os.path.join(self.directory, "holiday")
        os.mkdir(foreign)
        with open(os.path.join(foreign, "film.mp4"), "wb") as file:
            file.truncate(30_000_000)
        old = os.path.join(self.directory, "20200101T000000Z-viewing")
        os.mkdir(old)
        with open(os.path.join(old, "left-0001.mp4"), "wb") as file:
            file.truncate(20_000_000)
        os.utime(os.path.join(old, "left-0001.mp4"), (1.6e9, 1.6e9))
        daemon = self.start(self.text('enabled = true\nkinds = ["viewing"]\nsegment = 2\nquota_gb = 0.012\n'))
        client = Client(daemon.http)
        wait_until(lambda: not os.path.exists(old), "the oldest goes")
        wait_until(lambda: len(self.names("Z-viewing")) == 1, "it records")
        folder = os.path.join(self.directory, self.names("Z-viewing")[0])
        first = os.path.join(folder, "left-0001.mp4")
        wait_until(lambda: os.path.exists(os.path.join(folder, "left-0002.mp4")), "there is another segment")
        if os.path.exists(first):
            self.assertLess(seconds_of(first), 5)  # the next key frame after two seconds
        wait_until(lambda: not os.path.exists(first), "its own oldest segments go")
        self.assertTrue(os.path.exists(os.path.join(foreign, "film.mp4")))
        self.assertLess(json.loads(client.get("/api/v1/recordings")[2])["bytes"], 30_000_000)
        self.assertGreater(daemon.metric("sightline_recordings_deleted_bytes_total"), 20_000_000)
        self.assertEqual(daemon.stop(), 0)

    def test_a_log_with_video_is_divided_for_the_quota(self):
        daemon = self.start(self.text('enabled = true\nkinds = ["poses"]\nposes = "mcap"\nposes_video = true\nsegment = 2\n'
                                      'quota_gb = 0.004\n'))
        wait_until(lambda: self.names("-poses"), "it records")
        folder = os.path.join(self.directory, self.names("-poses")[0])
        third = os.path.join(folder, "poses-0003.mcap")
        wait_until(lambda: os.path.exists(third), "there are three files")
        wait_until(lambda: not os.path.exists(os.path.join(folder, "poses.mcap")), "its oldest goes")
        self.assertTrue(os.path.exists(third) or os.path.exists(os.path.join(folder, "poses-0004.mcap")))
        self.assertEqual(len(self.names("-poses")), 1)
        self.assertEqual(daemon.stop(), 0)

    def test_a_missing_folder_is_reported_and_taken_once_it_is_there(self):
        text = self.text('enabled = true\nkinds = ["viewing", "poses"]\n')
        daemon = self.start(text)
        client = Client(daemon.http)
        self.wait_written(client, "viewing", 5)
        shutil.rmtree(self.directory)
        client.post("/api/v1/recordings/stop")
        wait_until(lambda: self.kind(client, "viewing")["state"] == "off", "it ends")
        client.post("/api/v1/recordings/start")
        wait_until(lambda: self.kind(client, "viewing").get("problem"), "it says why not")
        self.assertIn(self.directory, self.kind(client, "viewing")["problem"])
        self.assertEqual(daemon.metric("sightline_recording_failing", kind="viewing"), 1)
        self.assertIn("recording viewing stopped", daemon.log_text())
        frames = daemon.state()["cameras"][0]["frames"]
        os.mkdir(self.directory)
        wait_until(lambda: self.kind(client, "viewing")["state"] == "recording", "it records again")
        self.assertGreater(daemon.state()["cameras"][0]["frames"], frames)
        self.assertEqual(daemon.log_text().count("recording viewing stopped"), 1)
        self.assertEqual(daemon.stop(), 0)


class FullDisk(Recordings):
    """The directory is a tmpfs of 160 MiB, of which a recording needs 64 for its start."""

    def test_a_full_disk_ends_recordings_and_nothing_else(self):
        daemon = self.start(self.text('kinds = ["viewing", "poses"]\n'))
        client = Client(daemon.http)
        probe = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=160m", "tmpfs", self.directory], check=False,
                               capture_output=True, text=True)
        if probe.returncode != 0:
            self.skipTest(f"no tmpfs can be mounted here: {probe.stderr.strip()}")
        self.addCleanup(subprocess.run, ["umount", "-l", self.directory], check=False)
        self.assertEqual(client.post("/api/v1/recordings/start")[0], 202)
        self.wait_written(client, "viewing", 300)
        filler = os.path.join(self.directory, "filler")
        with open(filler, "wb") as file:
            try:
                while file.write(bytes(1 << 16)):
                    file.flush()
            except OSError:
                pass
        wait_until(lambda: self.kind(client, "viewing").get("problem"), "the viewing recording says why it stopped")
        wait_until(lambda: self.kind(client, "poses").get("problem"), "so does that of poses")
        self.assertRegex(self.kind(client, "viewing")["problem"], "No space left|disk is full")
        self.assertEqual(daemon.metric("sightline_recording_failing", kind="viewing"), 1)
        frames = daemon.state()["cameras"][0]["frames"]
        wait_until(lambda: daemon.state()["cameras"][0]["frames"] > frames + 30, "the cameras go on")
        self.assertEqual(daemon.get("/healthz")[:1], "3")
        for name in self.names("-viewing"):  # and what there is plays
            for file in os.listdir(os.path.join(self.directory, name)):
                if os.path.getsize(os.path.join(self.directory, name, file)) > 10_000:
                    self.assertGreater(frames_of(os.path.join(self.directory, name, file)), 5)
        os.unlink(filler)
        wait_until(lambda: self.kind(client, "viewing")["state"] == "recording", "it records again")
        self.assertEqual(daemon.stop(), 0)


class Events(Recordings):
    def test_a_lost_object_is_recorded_from_before_it(self):
        daemon = self.start(self.text('on_lost = ["viewing", "poses"]\nbefore = 3\nafter = 2\n'))
        client = Client(daemon.http)
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the object is found")
        time.sleep(6)  # for the time before
        self.assertEqual(self.names(), [])
        self.assertEqual(client.post("/api/v1/objects/carton/forget")[0], 202)
        wait_until(lambda: self.kind(client, "viewing")["state"] == "recording", "it begins")
        wait_until(lambda: self.kind(client, "viewing")["state"] == "off", "it ends by itself")
        self.assertIn("carton is lost", daemon.log_text())
        folder = os.path.join(self.directory, self.names("-viewing")[0])
        self.assertGreater(seconds_of(os.path.join(folder, "left-0001.mp4")), 4)
        with open(os.path.join(self.directory, self.names("-poses")[0], "poses.csv"), encoding="utf-8") as file:
            times = [int(row["t_ns"]) for row in csv.DictReader(file)]
        self.assertGreater((times[-1] - times[0]) / 1e9, 4)
        self.assertEqual(daemon.stop(), 0)


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    unittest.main(verbosity=2)
