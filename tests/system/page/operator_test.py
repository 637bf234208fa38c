#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What operators order beside recordings: another overlay while the cameras go on, seen in the pictures and forgotten by no
reload; zones that objects enter; and what the scene is drawn from: meshes and places as the files have them."""
import json
import os
import struct
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from api_test import Client, fault  # noqa: E402
from support import BENCH, WAIT_S, DaemonCase, installation, read_text, wait_until  # noqa: E402

RED = {"styles": ["fill"], "status": False, "color": "#ff0000", "degraded_color": "#ff0000", "coasting_color": "#ff0000",
       "hidden_color": "#ff0000", "fill_opacity": 1, "shading": "flat"}


def red_pixels(jpeg):
    """Those that nothing but a red fill makes."""
    raw = subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-f", "mjpeg", "-i", "-", "-f", "rawvideo", "-pix_fmt",
                          "rgb24", "-"], input=jpeg, capture_output=True, timeout=WAIT_S, check=True).stdout
    return sum(1 for i in range(0, len(raw), 3) if raw[i] > 120 and raw[i + 1] < 40 and raw[i + 2] < 40)


def read_mesh(data):
    """Vertices and triangles of what docs/api.md describes under "Meshes"."""
    magic, vertices, faces, *box = struct.unpack_from("<4sII6f", data)
    assert magic == b"SLM1"
    shares = struct.unpack_from(f"<{3 * vertices}H", data, 36)
    at = 36 + (6 * vertices + 3) // 4 * 4
    indices = struct.unpack_from(f"<{3 * faces}{'H' if vertices <= 65536 else 'I'}", data, at)
    assert len(data) == at + len(indices) * (2 if vertices <= 65536 else 4)
    low, high = box[:3], box[3:]
    places = [tuple(low[k] + shares[3 * i + k] / 65535 * (high[k] - low[k]) for k in range(3)) for i in range(vertices)]
    return places, [indices[i:i + 3] for i in range(0, len(indices), 3)]


def obj_vertices(path):
    return [tuple(map(float, line.split()[1:4])) for line in read_text(path).splitlines() if line.startswith("v ")]


class Overlay(DaemonCase):
    def looks(self, client):
        return {camera["name"]: camera for camera in json.loads(client.get("/api/v1/overlay")[2])["cameras"]}

    def red(self, client, camera):
        return red_pixels(client.get(f"/cameras/{camera}/snapshot.jpg")[2])

    def test_another_overlay_is_in_force_at_once_and_in_no_file(self):
        daemon = self.start()
        client = Client(daemon.http)
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the object is found")
        self.assertLess(self.red(client, "left"), 50)
        before = self.looks(client)
        self.assertTrue(all(look["as_in_file"] for look in before.values()))
        viewer = client.open("GET", "/cameras/left/stream.mjpeg")[1]
        status, answer = client.post("/api/v1/overlay", {"camera": "left", **RED}, method="PUT")
        self.assertEqual(status, 200, answer)
        description = json.loads(client.get("/api/v1/openapi.json")[2])
        self.assertIsNone(fault(answer, {"$ref": "/Overlay"}, description))
        self.assertFalse(self.looks(client)["left"]["as_in_file"])
        self.assertEqual(self.looks(client)["left"]["overlay"]["styles"], ["fill"])
        self.assertEqual(self.looks(client)["right"], before["right"])
        wait_until(lambda: self.red(client, "left") > 1000, "it is red")
        self.assertLess(self.red(client, "right"), 50)
        self.assertEqual(client.post("/api/v1/overlay", RED, method="PUT")[0], 200)
        wait_until(lambda: self.red(client, "right") > 1000, "all are red")
        self.assertTrue(viewer.read(1 << 16))  # who watched goes on
        for camera in ("left", "right", "side"):
            self.assertEqual(daemon.metric("sightline_source_opened_total", camera=camera), 1)
        self.assertEqual(read_text(self.config), installation())
        connection, answer = client.open("DELETE", "/api/v1/overlay")
        self.assertEqual((answer.status, json.loads(answer.read())["cameras"][0]), (200, before["left"]))
        connection.close()
        wait_until(lambda: self.red(client, "left") < 50, "as in the file")
        self.assertEqual(daemon.stop(), 0)

    def test_it_outlasts_a_reload_that_is_about_something_else(self):
        daemon = self.start()
        client = Client(daemon.http)
        self.assertEqual(client.post("/api/v1/overlay", {"theme": "minimal"}, method="PUT")[0], 200)
        chosen = self.looks(client)
        self.assertTrue(self.reload(daemon, installation().replace('"test"', '"other"')))
        self.assertEqual(self.looks(client), chosen)
        self.assertTrue(self.reload(daemon, installation(styles='["cross"]').replace('"test"', '"other"')))
        self.assertTrue(all(look["as_in_file"] and look["overlay"]["styles"] == ["cross"] for look in self.looks(client).values()))
        self.assertEqual(daemon.stop(), 0)

    def test_what_a_file_could_not_say_is_refused(self):
        daemon = self.start()
        client = Client(daemon.http)
        before = self.looks(client)
        for body, status, text in (({"theme": "minimla"}, 400, 'did you mean "minimal"'), ({"styles": ["circel"]}, 400, "circle"),
                                   ({"fill_opacity": 2}, 400, "fill_opacity"), ({"color": "red"}, 400, "#rrggbb"),
                                   ({"font_file": "/etc/passwd"}, 400, "unknown key"), ({}, 400, "say what"),
                                   ({"styles": [{}]}, 400, "styles"), ({"x = 1\ny": 2}, 400, "unknown key"),
                                   ({"camera": "nobody", "theme": "minimal"}, 404, "no camera"),
                                   ({"camera": 3, "theme": "minimal"}, 400, "camera")):
            got, answer = client.post("/api/v1/overlay", body, method="PUT")
            self.assertEqual(got, status, (body, answer))
            self.assertIn(text, answer["error"])
        connection, answer = client.open("PUT", "/api/v1/overlay", "x" * 70000, {"Content-Type": "application/json"})
        self.assertEqual(answer.status, 413)
        connection.close()
        self.assertEqual(self.looks(client), before)
        self.assertEqual(daemon.stop(), 0)

    def test_it_takes_an_operator(self):
        path = self.write("tokens", "anna operator 0123456789abcdef-anna\nwall viewer 0123456789abcdef-wall\n")
        os.chmod(path, 0o600)
        daemon = self.start(installation(extra=f'[access]\ntokens = "{path}"\n'))
        wall = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-wall"})
        anna = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-anna"})
        self.assertEqual(wall.get("/api/v1/overlay")[0], 200)
        self.assertEqual(wall.post("/api/v1/overlay", {"theme": "minimal"}, method="PUT")[0], 403)
        self.assertEqual(wall.open("DELETE", "/api/v1/overlay")[1].status, 403)
        self.assertEqual(wall.post("/api/v1/calibration/accept")[0], 403)
        self.assertEqual(anna.post("/api/v1/overlay", {"theme": "minimal"}, method="PUT")[0], 200)
        self.assertEqual(anna.post("/api/v1/calibration/accept")[0], 404)  # nothing is proposed
        self.assertRegex(daemon.log_text(), "/api/v1/overlay by anna")


class Scene(DaemonCase):
    def test_meshes_and_places_are_those_of_the_files(self):
        daemon = self.start(installation(extra=f'[scene]\nmeshes = ["{BENCH}/scene.obj"]\n'))
        client = Client(daemon.http)
        scene = json.loads(client.get("/api/v1/scene")[2])
        self.assertEqual([camera["name"] for camera in scene["cameras"]], ["left", "right", "side"])
        for path, file in (("/api/v1/objects/carton/mesh", "objects/carton.obj"), ("/api/v1/scene/mesh", "scene.obj")):
            places, faces = read_mesh(client.get(path)[2])
            expected = obj_vertices(os.path.join(BENCH, file))
            for k in range(3):
                for edge in (min, max):
                    self.assertAlmostEqual(edge(p[k] for p in places), edge(p[k] for p in expected), places=5)
            self.assertTrue(all(i < len(places) for face in faces for i in face))
            wanted = scene["objects"][0]["triangles"] if "carton" in path else scene["scene_triangles"]
            self.assertEqual(len(faces), wanted)
        self.assertEqual(client.get("/api/v1/objects/nobody/mesh")[0], 404)
        wait_until(lambda: json.loads(client.get("/api/v1/points")[2])["points_m"], "there are points")
        points = json.loads(client.get("/api/v1/points")[2])
        self.assertEqual(len(points["points_m"]), len(points["kinds"]))
        self.assertEqual(daemon.stop(), 0)

    def test_without_a_scene_there_is_none(self):
        daemon = self.start()
        client = Client(daemon.http)
        self.assertEqual(client.get("/api/v1/scene/mesh")[0], 404)
        self.assertEqual(client.get("/api/v1/calibration/report")[0], 404)
        self.assertFalse(json.loads(client.get("/api/v1/calibration")[2])["report"])


class Report(DaemonCase):
    def test_the_report_may_do_nothing_but_show_itself(self):
        self.write("report.html", "<!doctype html><p>good</p>")
        path = self.write("calibration.toml", read_text(f"{BENCH}/calibration.toml"))
        daemon = self.start(installation().replace(f"{BENCH}/calibration.toml", path))
        client = Client(daemon.http)
        self.assertTrue(json.loads(client.get("/api/v1/calibration")[2])["report"])
        status, headers, body = client.get("/api/v1/calibration/report")
        self.assertEqual((status, body), (200, b"<!doctype html><p>good</p>"))
        self.assertIn("sandbox", headers["Content-Security-Policy"])
        self.assertNotIn("script-src", headers["Content-Security-Policy"])


class Zones(DaemonCase):
    # The carton goes to and fro along x.
    ZONE = '[[zone]]\nname = "{}"\nmin = [{}, -2, -2]\nmax = [2, 2, 2]\n{}'

    def test_who_enters_is_told_and_recorded(self):
        os.mkdir(self.path("recordings"))
        record = f'[record]\ndirectory = "{self.path("recordings")}"\nbefore = 1\nafter = 2\n'
        daemon = self.start(installation(extra=record + self.ZONE.format("here", -2, 'record = ["poses"]\n') +
                                         self.ZONE.format("elsewhere", 1.9, "")))
        zones = lambda: daemon.state()["objects"][0].get("zones")
        wait_until(lambda: zones() == ["here"], "it is in")
        self.assertEqual(daemon.metric("sightline_object_in_zone", object="carton", zone="here"), 1)
        self.assertIsNone(daemon.find_metric("sightline_object_in_zone", object="carton", zone="elsewhere"))
        self.assertRegex(daemon.log_text(), "carton: entered here")
        wait_until(lambda: os.listdir(self.path("recordings")), "it is recorded")
        self.assertRegex(daemon.log_text(), "carton entered here")
        wait_until(lambda: json.loads(daemon.get("/api/v1/recordings"))["kinds"][2]["state"] == "off", "and not for ever")
        # Another file: the zone is elsewhere, and the carton in none.
        self.assertTrue(self.reload(daemon, installation(extra=self.ZONE.format("elsewhere", 1.9, ""))))
        wait_until(lambda: zones() == [], "it is in none")
        self.assertIsNone(daemon.find_metric("sightline_object_in_zone", object="carton", zone="here"))
        self.assertTrue(self.reload(daemon, installation()))
        wait_until(lambda: "zones" not in daemon.state()["objects"][0], "there are none")
        self.assertEqual(daemon.stop(), 0)

    def test_who_comes_and_goes_is_told_each_time_and_not_more_often(self):
        daemon = self.start(installation(extra='[[zone]]\nname = "half"\nobjects = ["carton"]\nmin = [0, -2, -2]\nmax = [2, 2, 2]\n'))
        count = lambda word: daemon.log_text().count(f"carton: {word} half")
        wait_until(lambda: count("left") >= 3, "it has gone three times")
        self.assertIn(count("entered") - count("left"), (0, 1))
        self.assertEqual(daemon.stop(), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
