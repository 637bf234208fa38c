#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The watch over the cameras' places in a running daemon. The recording's calibration is exact, so a copy of it with one
camera turned is the same to the daemon as a camera that was turned the other way."""
import json
import math
import os
import re
import sys
import tomllib
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from api_test import Client  # noqa: E402
from support import BENCH, DaemonCase, installation, read_text, sightline, wait_until  # noqa: E402

TURN_DEG = 0.5


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def places(path):
    with open(path, "rb") as file:
        return {camera["name"]: camera["world_from_camera"] for camera in tomllib.load(file)["camera"]}


def direction(world_from_camera, point):
    """In which direction a camera there has a point, in its own axes."""
    way = [point[i] - world_from_camera[i][3] for i in range(3)]
    seen = [sum(world_from_camera[i][k] * way[i] for i in range(3)) for k in range(3)]
    return [value / math.hypot(*seen) for value in seen]


def error_deg(a, b):
    """By how much two places of a camera differ in where they have the carton: of what it sees at one place only, turn and
    shift cannot be told apart."""
    with open(f"{BENCH}/truth.csv", encoding="utf-8") as file:
        poses = [list(map(float, row.split(",")[2:5])) for row in file.readlines()[1:]]
    differences = [math.dist(direction(a, point), direction(b, point)) for point in poses]
    return math.degrees(sorted(differences)[len(differences) // 2])


class Watch(DaemonCase):
    def setUp(self):
        super().setUp()
        os.environ["XDG_STATE_HOME"] = self.folder  # of the daemon and of the command

    def installation_with(self, calibration, extra=""):
        return installation(extra=extra).replace(f"{BENCH}/calibration.toml", calibration)

    def turned_calibration(self, camera):
        """The calibration with this camera turned about its vertical axis."""
        angle = math.radians(TURN_DEG)
        turn = [[math.cos(angle), 0, math.sin(angle), 0], [0, 1, 0, 0], [-math.sin(angle), 0, math.cos(angle), 0],
                [0, 0, 0, 1]]
        text = read_text(f"{BENCH}/calibration.toml")
        before, rest = text.split(f'name = "{camera}"')
        matrix = product(places(f"{BENCH}/calibration.toml")[camera], turn)
        rest = re.sub(r"world_from_camera = \[\n(.*\n){4}\]", f"world_from_camera = {matrix}", rest, count=1)
        return self.write("calibration.toml", f'{before}name = "{camera}"{rest}')

    def verdict(self, daemon, camera):
        return next(c for c in daemon.state()["cameras"] if c["name"] == camera).get("calibration", {})

    def wait_for_state(self, daemon, camera, state):
        wait_until(lambda: self.verdict(daemon, camera).get("state") == state, f"{camera} is {state}")

    def wait_for_metric(self, daemon, name, value):
        wait_until(lambda: daemon.metric(name, camera="side") == value, f"{name} is {value}")

    def test_cameras_that_stand_where_they_should_are_in_order(self):
        daemon = self.start()
        for camera in ("left", "right", "side"):
            self.wait_for_state(daemon, camera, "in_order")
            self.assertEqual(daemon.metric("sightline_camera_vote_ratio", camera=camera), 1)
        self.wait_for_metric(daemon, "sightline_camera_calibration_state", 1)
        self.assertNotIn("knocked", daemon.log_text())

    def test_a_turned_camera_is_flagged_and_its_place_accepted(self):
        calibration = self.turned_calibration("side")
        before = read_text(calibration)
        daemon = self.start(self.installation_with(calibration))
        self.wait_for_state(daemon, "side", "knocked")
        verdict = self.verdict(daemon, "side")
        self.assertLess(verdict["vote"], 0.9)
        self.assertTrue(verdict["since_start"])
        self.assertEqual([len(row) for row in verdict["proposed"]["covariance"]], [6] * 6)
        self.assertEqual(self.verdict(daemon, "left")["state"] == "knocked", False)
        self.wait_for_metric(daemon, "sightline_camera_calibration_state", 2)
        self.assertEqual(daemon.log_text().count("camera side: knocked"), 1)
        wait_until(lambda: os.path.exists(verdict["proposed"]["file"]), "the proposal is written")
        truth = places(f"{BENCH}/calibration.toml")["side"]
        self.assertGreater(error_deg(places(calibration)["side"], truth), 0.9 * TURN_DEG)

        def is_good():
            return error_deg(places(verdict["proposed"]["file"])["side"], truth) < 0.2 * TURN_DEG

        wait_until(is_good, "the proposal is near the truth")
        out, _ = sightline("calibrate", "accept", "--config", self.config)
        self.assertIn("camera side: turned", out)
        self.assertLess(error_deg(places(calibration)["side"], truth), 0.2 * TURN_DEG)
        kept = [name for name in os.listdir(self.folder) if name.startswith("calibration.toml.")]
        self.assertEqual([read_text(self.path(name)) for name in kept], [before])
        self.assertTrue(self.reload(daemon, read_text(self.config)))
        self.wait_for_state(daemon, "side", "in_order")
        self.wait_for_metric(daemon, "sightline_camera_vote_ratio", 1)
        # What was proposed for the calibration before is none for this one.
        _, error = sightline("calibrate", "accept", "--config", self.config, status=2)
        self.assertIn("nothing is proposed", error)

    def test_an_operator_accepts_the_new_place_over_http(self):
        calibration = self.turned_calibration("side")
        daemon = self.start(self.installation_with(calibration))
        client = Client(daemon.http)
        self.wait_for_state(daemon, "side", "knocked")
        truth = places(f"{BENCH}/calibration.toml")["side"]
        proposal = lambda: json.loads(client.get("/api/v1/calibration")[2]).get("proposal", "")
        wait_until(lambda: os.path.exists(proposal()) and error_deg(places(proposal())["side"], truth) < 0.2 * TURN_DEG,
                   "the proposal is near the truth")
        status, answer = client.post("/api/v1/calibration/accept", {"cameras": ["left"]})
        self.assertEqual(status, 400)
        self.assertIn('no other place for camera "left"', answer["error"])
        status, answer = client.post("/api/v1/calibration/accept", {"cameras": ["side"]})
        self.assertEqual((status, [camera["name"] for camera in answer["cameras"]]), (202, ["side"]), answer)
        self.assertLess(error_deg(places(calibration)["side"], truth), 0.2 * TURN_DEG)
        self.assertTrue(os.path.exists(answer["kept"]))
        self.wait_for_state(daemon, "side", "in_order")
        self.assertNotIn("proposal", json.loads(client.get("/api/v1/calibration")[2]))

    def test_it_recovers_by_itself_if_asked(self):
        calibration = self.turned_calibration("side")
        daemon = self.start(self.installation_with(calibration, extra="[watch]\nauto_recover = true\n"))
        wait_until(lambda: "new place taken over" in daemon.log_text(), "it takes the new place over")
        self.wait_for_state(daemon, "side", "in_order")
        truth = places(f"{BENCH}/calibration.toml")["side"]
        self.assertLess(error_deg(places(calibration)["side"], truth), 0.2 * TURN_DEG)

    def test_it_can_be_turned_off(self):
        daemon = self.start(installation(extra="[watch]\nenabled = false\n"))
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the carton is tracked")
        self.assertEqual(self.verdict(daemon, "side"), {})
        self.assertIsNone(daemon.find_metric("sightline_camera_vote_ratio", camera="side"))


if __name__ == "__main__":
    unittest.main()
