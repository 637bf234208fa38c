#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Cameras that turn, live: what the daemon makes of FreeD senders and VISCA cameras, sound and faulty. A head whose angles
are not to be believed is said to be so, and comes back by itself."""
import glob
import math
import os
import re
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import ROOT, DaemonCase, fixed_port, read_text, sightline, wait_until  # noqa: E402
from api_test import Client  # noqa: E402
from heads import FreedSender, JpegCamera, ViscaCamera  # noqa: E402
from onvif_camera import DEGREES, GENERIC, OnvifCamera  # noqa: E402
from opentrackio_sender import OpenTrackIoSender  # noqa: E402
from visca_line import ViscaLine  # noqa: E402

TURNING = os.path.join(ROOT, "recordings", "turning")


def installation(axes, source, extra=""):
    text = f'calibration = "{TURNING}/calibration.toml"\n'
    text += f'[[camera]]\nname = "head"\nsource = "{source}"\naxes = "{axes}"\n{extra}'
    text += f'[[object]]\nfile = "{TURNING}/objects/kettle.toml"\n'
    return text + "[rtsp]\nport = 0\n[http]\nport = 0\n"


class Turning(DaemonCase):
    def known(self, value):
        # Its camera need not be there for a head to be heard.
        wait_until(lambda: self.daemon.metric("sightline_axes_known", camera="head") == value, f"angles known: {value}")

    def count(self, name):
        return self.daemon.metric(f"sightline_axes_{name}_total", camera="head")

    def grows(self, name):
        before = self.count(name)
        wait_until(lambda: self.count(name) > before + 5, f"{name} grow")

    def faults(self, head, modes):
        self.known(1)
        for mode, bad, word in modes:
            readings, wrong = self.count("readings"), self.count("bad")
            head.mode = mode
            self.known(0)
            self.assertRegex(self.daemon.log_text(), rf"head: its angles are {word}: it is not measured in")
            if bad == "some":  # what is given up and opened anew counts no more
                wait_until(lambda: self.count("bad") > wrong, "bad answers are counted")
            elif bad:
                self.grows("bad")
            if bad:
                self.assertLessEqual(self.count("readings"), readings + 30)
            head.mode = "good"
            self.known(1)
            self.grows("readings")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_freed(self):
        port = fixed_port()
        self.daemon = self.start(installation(f"freed:127.0.0.1:{port}/1", "http://127.0.0.1:9/video"))
        self.assertEqual(self.daemon.metric("sightline_axes_known", camera="head"), 0)
        sender = FreedSender(port)
        self.addCleanup(sender.close)
        self.faults(sender, [("silent", False, "silent"), ("checksum", True, "silent"), ("device", True, "silent"),
                             ("short", True, "silent"), ("jumps", False, "unsettled")])

    def test_visca(self):
        camera = ViscaCamera()
        self.addCleanup(camera.close)
        self.daemon = self.start(installation(f"visca:127.0.0.1:{camera.port}", "http://127.0.0.1:9/video",
                                              "axes_counts_per_degree = 14.4\n"))
        self.faults(camera, [("silent", False, "silent"), ("late", True, "silent"), ("nonsense", True, "silent"),
                             ("cut", True, "silent")])
        self.assertEqual(len(camera.asked), 2)

    def line(self, heads=1):
        line = ViscaLine(self.path("tty"), heads)
        self.addCleanup(line.close)
        return line

    def test_visca_over_a_serial_line(self):
        line = self.line()
        self.daemon = self.start(installation(f"visca:{line.link}", "http://127.0.0.1:9/video",
                                              "axes_counts_per_degree = 14.4\naxes_baud = 38400\n"))
        self.faults(line, [("silent", "some", "silent"), ("garbage", "some", "silent"), ("halves", "some", "silent")])

    def test_a_serial_line_on_which_nobody_answers(self):
        line = self.line()
        line.mode = "silent"
        self.daemon = self.start(installation(f"visca:{line.link}#2", "http://127.0.0.1:9/video", "axes_counts_per_degree = 14.4\n"))
        wait_until(lambda: f"camera 2 on the serial line {line.link} does not answer" in self.daemon.log_text(), "the fault is named")
        self.assertEqual(self.count("readings"), 0)
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_a_serial_line_that_is_unplugged(self):
        line = self.line()
        self.daemon = self.start(installation(f"visca:{line.link}", "http://127.0.0.1:9/video", "axes_counts_per_degree = 14.4\n"))
        self.known(1)
        line.unplug()
        self.known(0)
        wait_until(lambda: f"cannot open the serial line {line.link}" in self.daemon.log_text(), "the fault is named")
        line.plug()
        self.known(1)
        self.grows("readings")
        addressed = line.addressed
        line.restart(0)
        wait_until(lambda: line.addressed > addressed, "addresses are given anew")
        self.known(1)
        self.grows("readings")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_two_heads_on_one_serial_line(self):
        line = self.line(3)
        calibration = read_text(os.path.join(TURNING, "calibration.toml"))
        turning = next(part for part in ("[[camera]]" + text for text in calibration.split("[[camera]]")[1:]) if '"head"' in part)
        path = self.write("two.toml", calibration + turning.replace('"head"', '"other"'))
        extra = 'axes_counts_per_degree = 14.4\naxes_baud = 38400\nrole = "follow"\n[camera.follow]\nfastest_deg_s = 120\n'
        text = installation(f"visca:{line.link}#1", "http://127.0.0.1:9/video", extra).replace(f"{TURNING}/calibration.toml", path)
        second = f'[[camera]]\nname = "other"\nsource = "http://127.0.0.1:9/video"\naxes = "visca:{line.link}#3"\n{extra}'
        self.daemon = self.start(text.replace("[[object]]", second + "[[object]]"))
        for name in ("head", "other"):
            wait_until(lambda name=name: self.daemon.metric("sightline_axes_known", camera=name) == 1, f"{name} is known")
        client = Client(self.daemon.http)
        for name, pan, tilt in (("head", 35, -12), ("other", -20, 15)):
            status, _ = client.post(f"/api/v1/cameras/{name}/turn", {"pan_deg": pan, "tilt_deg": tilt, "seconds": 60})
            self.assertEqual(status, 202)
        wait_until(lambda: math.dist(line.heads[0].angles, (35, -12)) < 0.3, "the first is there")
        wait_until(lambda: math.dist(line.heads[2].angles, (-20, 15)) < 0.3, "the third is there")
        self.assertEqual(line.heads[1].orders, 0)
        self.assertEqual(line.addressed, 1)
        self.assertEqual(set().union(*(head.unknown for head in line.heads)), set())
        self.assertEqual(self.daemon.metric("sightline_follow_refused_total", camera="head"), 0)
        line.heads[0].mode = "stuck"
        client.post("/api/v1/cameras/head/turn", {"pan_deg": 0, "tilt_deg": 0, "seconds": 60})
        wait_until(lambda: self.daemon.metric("sightline_follow_refused_total", camera="head") > 0, "it refuses")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_opentrackio(self):
        port = fixed_port()
        self.daemon = self.start(installation(f"opentrackio:127.0.0.1:{port}/3", "http://127.0.0.1:9/video"))
        sender = OpenTrackIoSender(port)
        self.addCleanup(sender.close)
        self.faults(sender, [("silent", False, "silent"), ("checksum", True, "silent"), ("source", True, "silent"),
                             ("cbor", True, "silent"), ("other", True, "silent"), ("torn", True, "silent"), ("swapped", True, "silent"),
                             ("text", True, "silent"), ("frozen", True, "silent"), ("jumps", False, "unsettled")])

    def test_opentrackio_as_cbor_to_a_group(self):
        port = fixed_port()
        self.daemon = self.start(installation(f"opentrackio:239.135.1.3%lo:{port}/3", "http://127.0.0.1:9/video"))
        beside = OpenTrackIoSender(port, encoding=2)  # to the same port, and not to the group
        self.addCleanup(beside.close)
        wait_until(lambda: "239.135.1.3 has said nothing" in self.daemon.log_text(), "a group without a sender is named")
        self.assertEqual(self.count("readings"), 0)
        sender = OpenTrackIoSender(port, "239.135.1.3", 2)
        self.addCleanup(sender.close)
        self.faults(sender, [("silent", False, "silent"), ("damaged", True, "silent"), ("deep", True, "silent"), ("mixed", True, "silent")])

    def test_freed_to_a_group(self):
        port = fixed_port()
        self.daemon = self.start(installation(f"freed:239.135.1.4%lo:{port}", "http://127.0.0.1:9/video"))
        sender = FreedSender(port, "239.135.1.4")
        self.addCleanup(sender.close)
        self.known(1)
        self.grows("readings")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())
        self.daemon = self.start(installation(f"freed:239.135.1.4%none0:{port}", "http://127.0.0.1:9/video"))
        wait_until(lambda: "there is no network interface none0" in self.daemon.log_text(), "the fault is named")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_opentrackio_without_a_header(self):
        port = fixed_port()
        self.daemon = self.start(installation(f"opentrackio:{port}", "http://127.0.0.1:9/video"))
        sender = OpenTrackIoSender(port)
        self.addCleanup(sender.close)
        sender.mode = "bare"
        self.known(1)
        self.grows("readings")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def onvif(self, camera, extra=""):
        self.write("head.password", camera.PASSWORD + "\n")
        return installation(f"onvif:127.0.0.1:{camera.http_port}", "http://127.0.0.1:9/video",
                            f'axes_user = "{camera.USER}"\naxes_password_file = "head.password"\naxes_degrees_per_unit = {camera.PER_UNIT}\n{extra}')

    def test_onvif(self):
        camera = OnvifCamera(GENERIC)
        self.addCleanup(camera.close)
        self.daemon = self.start(self.onvif(camera))
        self.faults(camera, [("silent", "some", "silent"), ("nonsense", "some", "silent"), ("cut", "some", "silent"),
                             ("frozen", False, "frozen"), ("jumps", False, "unsettled")])
        self.assertNotIn(camera.PASSWORD, self.daemon.log_text())

    def test_an_onvif_camera_that_follows_an_order(self):
        for space in (GENERIC, DEGREES):
            camera = OnvifCamera(space)
            self.addCleanup(camera.close)
            self.daemon = self.start(self.onvif(camera, f'role = "follow"\n[camera.follow]\nfastest_deg_s = {camera.FASTEST}\n'))
            self.known(1)
            status, _ = Client(self.daemon.http).post("/api/v1/cameras/head/turn", {"pan_deg": 35, "tilt_deg": -12, "seconds": 60})
            self.assertEqual(status, 202)
            wait_until(lambda: math.dist(camera.angles, (35, -12)) < 0.3, "it is there")
            head = self.daemon.state()["cameras"][0]["head"]
            self.assertEqual((head["mode"], head["angles"]), ("held", "known"))
            self.assertAlmostEqual(head["pan_deg"], 35, delta=0.5)
            self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_onvif_cameras_that_take_no_places(self):
        # What it can do, whether it says so, and what it is told.
        for moves, tells, expected in ((("Continuous", "Relative"), True, "ContinuousMove"), (("Relative",), True, "RelativeMove"),
                                       (("Continuous",), False, "ContinuousMove")):
            camera = OnvifCamera(GENERIC, moves, tells)
            self.addCleanup(camera.close)
            self.daemon = self.start(self.onvif(camera, f'role = "follow"\n[camera.follow]\nfastest_deg_s = {camera.FASTEST}\n'
                                                        "latency = 0.15\n"))
            self.known(1)
            client = Client(self.daemon.http)
            for place in ((35, -12), (-20, 10)):
                status, _ = client.post("/api/v1/cameras/head/turn", {"pan_deg": place[0], "tilt_deg": place[1], "seconds": 60})
                self.assertEqual(status, 202)
                wait_until(lambda place=place: math.dist(camera.angles, place) < 1, f"it is there by {expected}")
                wait_until(lambda place=place: max(map(abs, camera.rates)) < 0.01 and math.dist(camera.angles, place) < 1, "it stands")
            self.assertGreater(camera.requests[expected], 5)
            self.assertEqual(camera.requests["AbsoluteMove"], 0 if tells else 3)
            self.assertEqual(camera.requests["Stop"] > 0, expected == "ContinuousMove")
            if not tells:
                self.assertIn("its head takes no places", self.daemon.log_text())
            client.post("/api/v1/cameras/head/turn", {"pan_deg": 150, "tilt_deg": 0, "seconds": 60})
            wait_until(lambda: camera.rates[0] > 10, "it turns")
            self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())
            wait_until(lambda: max(map(abs, camera.rates)) < 0.01, "it stops with the daemon")
            self.assertLess(camera.angles[0], 150)

    def test_an_onvif_camera_that_wants_another_password(self):
        camera = OnvifCamera()
        self.addCleanup(camera.close)
        self.daemon = self.start(self.onvif(camera).replace(camera.USER, "guest"))
        wait_until(lambda: "axes_user and axes_password_file" in self.daemon.log_text(), "the fault is named")
        self.assertEqual(self.daemon.metric("sightline_axes_known", camera="head"), 0)
        self.assertEqual(self.daemon.stop(), 0)

    def test_a_visca_camera_that_is_not_there_yet(self):
        port = fixed_port()
        self.daemon = self.start(installation(f"visca:127.0.0.1:{port}", "http://127.0.0.1:9/video"))
        wait_until(lambda: "it is tried again" in self.daemon.log_text(), "the fault is named")
        self.assertEqual(self.daemon.metric("sightline_axes_known", camera="head"), 0)
        self.assertEqual(self.daemon.stop(), 0)

    def test_what_is_read_is_recorded_and_replayed(self):
        out = subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-i", os.path.join(TURNING, "head.mkv"), "-q:v", "3",
                              self.path("%03d.jpg")], check=False, timeout=120)
        self.assertEqual(out.returncode, 0)
        images = []
        for name in sorted(glob.glob(self.path("*.jpg"))):
            with open(name, "rb") as file:
                images.append(file.read())
        camera = JpegCamera(images)
        self.addCleanup(camera.close)
        port = fixed_port()
        sender = FreedSender(port)
        self.addCleanup(sender.close)
        config = self.write("record.toml", installation(f"freed:{port}", f"http://127.0.0.1:{camera.port}/video"))
        recording = self.path("recording")
        sightline("record", "--config", config, "--seconds", "3", recording)
        rows = read_text(os.path.join(recording, "axes.csv")).split("\n")
        self.assertEqual(rows[0], "camera,t_ns,pan_deg,tilt_deg,zoom,moving")
        self.assertGreater(len(rows), 40)
        pans = [float(row.split(",")[2]) for row in rows[1:] if row]
        self.assertTrue(all(abs(pan) <= 20.01 for pan in pans), pans)
        self.assertGreater(max(pans) - min(pans), 5)
        frames = [row.split(",") for row in read_text(os.path.join(recording, "frames.csv")).split("\n")[1:] if row]
        stamps = [int(row.split(",")[1]) for row in rows[1:] if row]
        covered = [frame for frame in frames if stamps[0] < int(frame[2]) < stamps[-1]]
        self.assertGreater(len(covered), 20)  # one clock
        text, _ = sightline("replay", recording, "--poses", self.path("poses.csv"))
        self.assertTrue(re.search(r"kettle", text + read_text(self.path("poses.csv"))))

    def test_the_picture_finds_the_latency(self):
        calibration = read_text(os.path.join(TURNING, "calibration.toml")).replace("latency_s = 0.04", "latency_s = 0.0")
        self.write("late.toml", calibration)
        text = installation("", f"replay:{TURNING}").replace('axes = ""\n', "")
        text = text.replace(f"{TURNING}/calibration.toml", "late.toml")
        self.daemon = self.start(text)
        by_picture = lambda: self.daemon.state()["cameras"][0]["angles_by_picture"]  # noqa: E731
        wait_until(lambda: by_picture()["latency"] == "contradicted", "the latency is found")
        wait_until(lambda: by_picture()["latency_sigma_s"] < 0.001, "and better")
        self.assertAlmostEqual(by_picture()["latency_s"], 0.040, delta=0.003)
        self.assertAlmostEqual(self.daemon.metric("sightline_axes_latency_seconds", camera="head"), 0.040, delta=0.003)
        self.assertEqual(self.daemon.metric("sightline_axes_latency_contradicted", camera="head"), 1)
        self.assertGreater(self.daemon.metric("sightline_axes_picture_frames_total", camera="head", picture="used"), 10)
        self.assertRegex(self.daemon.log_text(), r"head: by its picture the angles are .* ms late")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())
        self.daemon = self.start(text.replace('name = "head"\n', 'name = "head"\naxes_by_picture = false\n'))
        wait_until(lambda: self.daemon.state()["cameras"][0]["frames"] > 5, "frames come")
        self.assertNotIn("angles_by_picture", self.daemon.state()["cameras"][0])
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_what_does_not_fit_is_refused(self):
        for axes, source, word in [("freed:x", "http://127.0.0.1:9/v", "tells no angles"),
                                   ("onvif:head.example", "http://127.0.0.1:9/v", "tells no angles"),
                                   ("opentrackio:1/x", "http://127.0.0.1:9/v", "tells no angles"),
                                   ("visca:", "http://127.0.0.1:9/v", "tells no angles"),
                                   ("visca:/dev/ttyUSB0#8", "http://127.0.0.1:9/v", "tells no angles"),
                                   ("v4l2", "http://127.0.0.1:9/v", "the images do not come from V4L2"),
                                   ("freed:70000", "http://127.0.0.1:9/v", "tells no angles"),
                                   ("freed:4000", f"replay:{TURNING}", "brings its own angles")]:
            config = self.write("wrong.toml", installation(axes, source))
            _, errors = sightline("check", config, status=2)
            self.assertRegex(errors, rf"wrong\.toml:\d+:\d+.*{word}")
        odd = installation("visca:/dev/ttyUSB0", "http://127.0.0.1:9/v", "axes_baud = 9000\n")
        _, errors = sightline("check", self.write("odd.toml", odd), status=2)
        self.assertRegex(errors, r"odd\.toml:\d+:\d+.*axes_baud.*9600")
        for good in (odd.replace("9000", "38400"), installation("v4l2", "v4l2:/dev/video7")):
            sightline("check", self.write("good.toml", good))
        config = self.write("none.toml", installation("freed:4000", "http://127.0.0.1:9/v").replace('axes = "freed:4000"\n', ""))
        _, errors = sightline("check", config, status=2)
        self.assertIn("'axes' must say who tells its angles", errors)
        still = installation("freed:4000", "http://127.0.0.1:9/v", "axes_by_picture = false\n").replace('axes = "freed:4000"\n', "")
        _, errors = sightline("check", self.write("still.toml", still.replace('"head"', '"left"')), status=2)
        self.assertRegex(errors, r"still\.toml:\d+:\d+.*axes_by_picture.*it stands still")


if __name__ == "__main__":
    unittest.main(verbosity=2)
