#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A head that follows: fixed cameras see the carton of recordings/bench, and a simulated VISCA head is turned after it."""
import math
import os
import statistics
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import BENCH, DaemonCase, read_text, sightline, wait_until  # noqa: E402
from api_test import Client  # noqa: E402
from moving_head import MovingHead  # noqa: E402

PLACE = (0.9, -1.0, 0.6)  # of the head, which looks along (-1, 1, 0) at rest
AXES = """
[[camera]]
name = "head"
width = 640
height = 480
model = "brown_conrady"
fx = 600
fy = 600
cx = 319.5
cy = 239.5
distortion = []
[camera.axes]
world_from_base = [[{c}, {n}, 0, {x}], [{c}, {c}, 0, {y}], [0, 0, 1, {z}], [0, 0, 0, 1]]
tilt_from_camera = [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
sigma_deg = 0.03
""".format(c=math.sqrt(0.5), n=-math.sqrt(0.5), x=PLACE[0], y=PLACE[1], z=PLACE[2])
RATE, PAN, TILT = 60, (-50, 45), (-60, 20)
FOLLOW = f"""[camera.follow]
objects = ["carton"]
pan_range_deg = {list(PAN)}
tilt_range_deg = {list(TILT)}
rate_deg_s = {RATE}
acceleration_deg_s2 = 180
fastest_deg_s = {MovingHead.FASTEST}
latency = {MovingHead.LATENCY_S}
home_deg = [40, 10]
home_after = 1
yield = 3
"""


def direction(point):
    """Pan and tilt at which the head looks at a point, in degrees."""
    dx, dy, dz = (p - q for p, q in zip(point, PLACE))
    right, ahead = (dx + dy) * math.sqrt(0.5), (dy - dx) * math.sqrt(0.5)
    return math.degrees(math.atan2(-right, ahead)), math.degrees(math.atan2(dz, math.hypot(right, ahead)))


class Follow(DaemonCase):
    def setUp(self):
        super().setUp()
        self.simulator = MovingHead()
        self.addCleanup(self.simulator.close)

    def installation(self, follow=FOLLOW):
        calibration = self.write("calibration.toml", read_text(f"{BENCH}/calibration.toml") + AXES)
        text = f'calibration = "{calibration}"\n'
        for camera in ("left", "right", "side"):
            text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{BENCH}"\n'
        text += '[[camera]]\nname = "head"\nsource = "http://127.0.0.1:9/video"\nrole = "follow"\n'
        text += f'axes = "visca:127.0.0.1:{self.simulator.port}"\naxes_counts_per_degree = {MovingHead.COUNTS}\n{follow}'
        return text + f'[[object]]\nfile = "{BENCH}/objects/carton.toml"\n[rtsp]\nport = 0\n[http]\nport = 0\n'

    def head(self):
        return next(camera["head"] for camera in self.daemon.state()["cameras"] if camera["name"] == "head")

    def becomes(self, mode):
        wait_until(lambda: self.head().get("mode") == mode, f"the head is {mode}")

    def errors(self, count):
        """By how many degrees the head looked past the object, at the times of its newest poses."""
        found = {}
        def look():
            carton = self.daemon.state()["objects"][0]
            if "translation_m" in carton and self.head()["mode"] == "following":
                when = carton["t_ns"] / 1e9
                found[when] = math.dist(direction(carton["translation_m"]), self.simulator.at(when))
            return len(found) >= count
        wait_until(look, "the object is followed")
        return sorted(found.values())

    def check_limits(self):
        self.assertEqual(self.simulator.unknown, set())
        self.assertGreater(self.simulator.orders, 10)
        pans, tilts = zip(*self.simulator.goals)
        slack = 0.6 / MovingHead.COUNTS  # rounding
        self.assertTrue(PAN[0] - slack <= min(pans) and max(pans) <= PAN[1] + slack, (min(pans), max(pans)))
        self.assertTrue(TILT[0] - slack <= min(tilts) and max(tilts) <= TILT[1] + slack, (min(tilts), max(tilts)))
        fastest = max(max(pan * MovingHead.FASTEST / 24, tilt * MovingHead.FASTEST / 20) for pan, tilt in self.simulator.steps)
        self.assertLessEqual(fastest, max(RATE, MovingHead.FASTEST / 20))

    def test_it_keeps_the_object_in_view_and_gives_way(self):
        self.daemon = self.start(self.installation())
        self.becomes("following")
        errors = self.errors(60)
        self.assertLess(statistics.median(errors), 3, errors)
        self.assertEqual(self.head()["object"], "carton")
        wait_until(lambda: self.daemon.state()["objects"][0].get("followed_by") == ["head"], "the object says who follows it")
        client = Client(self.daemon.http)
        # An operator's order.
        self.assertEqual(client.post("/api/v1/cameras/head/turn", {"pan_deg": -30, "tilt_deg": 5, "seconds": 60}), (202, {}))
        self.becomes("held")
        wait_until(lambda: math.dist(self.simulator.angles, (-30, 5)) < 0.3, "it is there")
        self.assertGreater(self.head()["seconds_left"], 1)
        self.assertEqual(client.post("/api/v1/cameras/head/turn", {"pan_deg": -51, "tilt_deg": 5})[0], 400)
        self.assertEqual(client.post("/api/v1/cameras/head/turn", {"pan_deg": 5})[0], 400)
        self.assertEqual(client.post("/api/v1/cameras/left/turn")[0], 400)
        self.assertEqual(client.post("/api/v1/cameras/nobody/turn")[0], 404)
        self.assertEqual(client.post("/api/v1/cameras/head/follow"), (202, {}))
        self.becomes("following")
        # Somebody turns it by hand.
        self.simulator.pushed = -25.0
        self.becomes("yielding")
        self.simulator.pushed = 0.0
        self.assertIn("somebody else turns it", self.daemon.log_text())
        self.becomes("following")
        self.assertGreater(self.daemon.metric("sightline_follow_orders_total", camera="head"), 10)
        self.check_limits()
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_it_looks_around_for_what_it_lost(self):
        text = self.installation(FOLLOW + "scan = 60\n")
        self.daemon = self.start(text)
        self.becomes("following")
        # The fixed cameras go: nobody sees it any more.
        self.assertTrue(self.reload(self.daemon, text.replace(f"replay:{BENCH}", "http://127.0.0.1:9/video")))
        self.becomes("scanning")
        first = list(self.simulator.angles)
        wait_until(lambda: math.dist(first, self.simulator.angles) > 25, "it looks elsewhere")
        self.check_limits()
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_it_goes_home_without_an_object(self):
        text = self.installation().replace(f"replay:{BENCH}", "http://127.0.0.1:9/video")
        self.daemon = self.start(text)
        self.becomes("home")
        wait_until(lambda: math.dist(self.simulator.angles, (40, 10)) < 0.3, "it is at home")
        self.simulator.mode = "silent"
        self.becomes("blind")
        self.simulator.mode = "good"
        self.becomes("home")
        self.check_limits()
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_a_head_that_does_not_do_as_it_is_told_is_left_alone(self):
        self.simulator.mode = "backwards"
        self.daemon = self.start(self.installation())
        self.becomes("yielding")
        self.simulator.mode = "stuck"
        self.becomes("following")  # it is tried again
        wait_until(lambda: self.daemon.metric("sightline_follow_refused_total", camera="head") > 3, "it refuses")
        self.becomes("yielding")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.log_text())

    def test_what_does_not_fit_is_refused(self):
        good = self.installation()
        for old, new, word in [('role = "follow"', 'role = "observe"', 'goes with role = "follow"'),
                               ('axes = "visca:127.0.0.1:', 'axes = "freed:127.0.0.1:', "needs a head that can be turned"),
                               ('"carton"]', '"kettle"]', "there is no such object"),
                               ("home_deg = [40, 10]", "home_deg = [50, 10]", "lies outside"),
                               (f"pan_range_deg = {list(PAN)}", "pan_range_deg = [45, -50]", "the smaller angle"),
                               ("yield = 3", "yields = 3", "yield"), ("yield = 3", "scan = -1", "scan"),
                               ("yield = 3", 'orders = "relative"', "goes with axes"), ("yield = 3", 'orders = "fast"', "known: ")]:
            text = good.replace(old, new)
            self.assertNotEqual(text, good)
            if "freed" in new:
                text = text.replace(f"axes_counts_per_degree = {MovingHead.COUNTS}\n", "")
            _, errors = sightline("check", self.write("wrong.toml", text), status=2)
            self.assertRegex(errors, rf"wrong\.toml:\d+:\d+.*{word}")
        sightline("check", self.write("good.toml", good))


if __name__ == "__main__":
    unittest.main(verbosity=2)
