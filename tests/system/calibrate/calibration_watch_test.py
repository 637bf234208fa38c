#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The watch over the cameras' places in a running daemon. The recording's calibration is exact, so a copy of it with one
camera turned is the same to the daemon as a camera that was turned the other way."""
import http.server
import json
import math
import os
import re
import subprocess
import sys
import threading
import time
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


def still(camera):
    """The first image of a camera of the recording as JPEG."""
    done = subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-i", f"{BENCH}/{camera}.mkv", "-frames:v", "1",
                           "-q:v", "2", "-f", "mjpeg", "-"], capture_output=True, check=True, timeout=60)
    return done.stdout


class StillCamera:
    """A network camera that sends the same image ten times a second, until it is given another."""

    def __init__(self, image):
        self.image, owner = image, self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=cut")
                self.end_headers()
                try:
                    while True:
                        image = owner.image
                        self.wfile.write(b"--cut\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n%s\r\n"
                                         % (len(image), image))
                        time.sleep(0.1)
                except OSError:
                    pass  # nobody listens any more

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self):
        self.server.shutdown()
        self.server.server_close()


class Watch(DaemonCase):
    def setUp(self):
        super().setUp()
        os.environ["XDG_STATE_HOME"] = self.folder  # of the daemon and of the command

    def installation_with(self, calibration, extra=""):
        return installation(extra=extra).replace(f"{BENCH}/calibration.toml", calibration)

    def turned_calibration(self, camera, name="calibration.toml"):
        """The calibration with this camera turned about its vertical axis."""
        angle = math.radians(TURN_DEG)
        turn = [[math.cos(angle), 0, math.sin(angle), 0], [0, 1, 0, 0], [-math.sin(angle), 0, math.cos(angle), 0],
                [0, 0, 0, 1]]
        text = read_text(f"{BENCH}/calibration.toml")
        before, rest = text.split(f'name = "{camera}"')
        matrix = product(places(f"{BENCH}/calibration.toml")[camera], turn)
        rest = re.sub(r"world_from_camera = \[\n(.*\n){4}\]", f"world_from_camera = {matrix}", rest, count=1)
        return self.write(name, f'{before}name = "{camera}"{rest}')

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

    def proposal_of(self, calibration):
        """The file of a proposal for this calibration: named by the FNV-1a hash of its text."""
        value = 14695981039346656037
        for byte in read_text(calibration).encode():
            value = (value ^ byte) * 1099511628211 % 2**64
        return self.path("sightline", f"proposed_calibration_{value:016x}.toml")

    def test_what_an_earlier_run_has_proposed_is_not_accepted_when_the_camera_is_back(self):
        calibration = self.write("calibration.toml", read_text(f"{BENCH}/calibration.toml"))
        left_over = self.proposal_of(calibration)
        os.makedirs(os.path.dirname(left_over))
        with open(self.turned_calibration("side", "turned.toml"), encoding="utf-8") as turned, \
                open(left_over, "w", encoding="utf-8") as file:
            file.write(turned.read())
        daemon = self.start(self.installation_with(calibration))
        status, answer = Client(daemon.http).post("/api/v1/calibration/accept")
        self.assertEqual(status, 404, answer)
        for camera in ("left", "right", "side"):
            self.wait_for_state(daemon, camera, "in_order")
        wait_until(lambda: not os.path.exists(left_over), "what does not hold any more is taken away")
        self.assertEqual(read_text(calibration), read_text(f"{BENCH}/calibration.toml"))

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

    def rooms(self):
        folder = self.path("sightline")
        names = [name for name in os.listdir(folder) if name.startswith("rooms_")] if os.path.exists(folder) else []
        return os.path.join(folder, names[0]) if names else ""

    def exchanged(self):
        swapped = {"left": "right", "right": "left"}
        text = installation()
        for camera, other in swapped.items():
            text = text.replace(f'name = "{camera}"\n', f'name = "{camera}"\nrecorded_as = "{other}"\n')
        return text

    def test_exchanged_cameras_are_named_also_after_a_restart(self):
        daemon = self.start()
        for camera in ("left", "right", "side"):
            wait_until(lambda: (daemon.find_metric("sightline_camera_room_patches", camera=camera) or 0) > 8,
                       f"{camera} knows its room")
        wait_until(lambda: self.rooms() and os.path.getsize(self.rooms()) > 20000, "the rooms are kept")
        self.assertNotIn("does not fit", daemon.log_text())
        self.assertEqual(daemon.stop(), 0)
        daemon = self.start(self.exchanged())
        for camera, other in (("left", "right"), ("right", "left")):
            self.wait_for_state(daemon, camera, "unfit")
            wait_until(lambda: f"camera {camera}: its picture does not fit its calibration: {camera} and {other} look exchanged"
                       in daemon.log_text(), "both are named")
            self.assertEqual(self.verdict(daemon, camera)["looks_like"], other)
            self.assertEqual(self.verdict(daemon, camera)["vote"], 0)
            self.assertEqual(daemon.metric("sightline_camera_calibration_state", camera=camera), 5)
        self.assertNotEqual(self.verdict(daemon, "side")["state"], "unfit")
        # Plugged in as they were.
        self.assertTrue(self.reload(daemon, installation()))
        for camera in ("left", "right"):
            self.wait_for_state(daemon, camera, "in_order")

    def test_a_camera_whose_picture_is_back_is_said_to_be_in_order_again(self):
        cameras = {name: StillCamera(still(name)) for name in ("left", "right")}
        for camera in cameras.values():
            self.addCleanup(camera.close)
        text = f'calibration = "{BENCH}/calibration.toml"\n[rtsp]\nport = 0\n[http]\nport = 0\n'
        text += f'[[object]]\nfile = "{BENCH}/objects/carton.toml"\n'
        for name, camera in cameras.items():
            text += f'[[camera]]\nname = "{name}"\nsource = "http://127.0.0.1:{camera.port}/video"\n'
        daemon = self.start(text)
        for name in cameras:
            wait_until(lambda: (daemon.find_metric("sightline_camera_room_patches", camera=name) or 0) > 8,
                       f"{name} knows its room")
            self.wait_for_state(daemon, name, "in_order")
        cameras["right"].image = cameras["left"].image
        self.wait_for_state(daemon, "right", "unfit")
        wait_until(lambda: "camera right: its picture does not fit" in daemon.log_text(), "it is said")
        self.assertNotIn("agrees with its calibration again", daemon.log_text())
        cameras["right"].image = still("right")
        wait_until(lambda: "camera right: agrees with its calibration again" in daemon.log_text(), "that is said, too")
        self.assertEqual(daemon.log_text().count("agrees with its calibration again"), 1)

    def test_a_damaged_file_of_rooms_is_made_anew(self):
        os.makedirs(self.path("sightline"), exist_ok=True)
        daemon = self.start()
        wait_until(self.rooms, "the rooms are kept")
        self.assertEqual(daemon.stop(), 0)
        with open(self.rooms(), "wb") as file:
            file.write(b"SLSCENE1 and nothing that follows from it")
        daemon = self.start()
        self.assertIn("is damaged: what the cameras saw of their room is learned anew", daemon.log_text())
        wait_until(lambda: os.path.getsize(self.rooms()) > 10000, "it is made anew")

    def test_it_can_be_turned_off(self):
        daemon = self.start(installation(extra="[watch]\nenabled = false\n"))
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the carton is tracked")
        self.assertEqual(self.verdict(daemon, "side"), {})
        self.assertIsNone(daemon.find_metric("sightline_camera_vote_ratio", camera="side"))


if __name__ == "__main__":
    unittest.main()
