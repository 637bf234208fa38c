#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The HTTP interface of a running daemon: what it answers is what its description says, pictures and events flow while
they are watched and cost nothing otherwise, hints and roles reach the daemon."""
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import time
import unittest

from support import BENCH, WAIT_S, DaemonCase, fixed_port, installation, read_text, wait_until

TYPES = {"object": dict, "array": list, "string": str, "boolean": bool}


def fault(value, schema, root):
    """Why the value is not of the schema (what OpenAPI 3.0 has of JSON Schema and our description uses), or None."""
    if "$ref" in schema:
        return fault(value, root["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]], root)
    if "oneOf" in schema:
        return None if sum(fault(value, one, root) is None for one in schema["oneOf"]) == 1 else f"{value}: not one of"
    kind = schema["type"]
    if kind in ("number", "integer"):
        if isinstance(value, bool) or not isinstance(value, (int, float) if kind == "number" else int):
            return f"{value!r} is no {kind}"
    elif not isinstance(value, TYPES[kind]):
        return f"{value!r} is no {kind}"
    if "enum" in schema and value not in schema["enum"]:
        return f"{value!r} is none of {schema['enum']}"
    if kind == "array":
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            return f"{len(value)} items"
        return next((f for f in (fault(item, schema["items"], root) for item in value) if f), None)
    if kind != "object":
        return None
    properties = schema.get("properties", {})
    for key in schema.get("required", ()):
        if key not in value:
            return f"{key} is missing"
    for key, item in value.items():
        if key not in properties:
            if schema.get("additionalProperties", True) is False:
                return f"{key} is not described"
            continue
        if found := fault(item, properties[key], root):
            return f"{key}: {found}"
    return None


class Client:
    """Requests to one daemon."""

    def __init__(self, port, headers=None):
        self.port, self.headers = port, headers or {}

    def open(self, method, path, body=None, headers=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        connection.request(method, path, body, {**self.headers, **(headers or {})})
        return connection, connection.getresponse()

    def get(self, path):
        connection, answer = self.open("GET", path)
        try:
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def post(self, path, value=None, method="POST"):
        connection, answer = self.open(method, path, json.dumps(value or {}), {"Content-Type": "application/json"})
        try:
            return answer.status, json.loads(answer.read())
        finally:
            connection.close()


def events(answer):
    """(event, data) as they come."""
    event = None
    while line := answer.readline():
        line = line.decode().rstrip("\n")
        if line.startswith("event: "):
            event = line[7:]
        elif line.startswith("data: "):
            yield event, json.loads(line[6:])


def parts(answer):
    """(headers, JPEG) as they come."""
    while True:
        headers = {}
        while line := answer.readline().strip():
            if not line.startswith(b"--"):
                key, value = line.decode().split(": ", 1)
                headers[key] = value
        if not headers:
            return
        yield headers, answer.read(int(headers["Content-Length"]))
        answer.readline()


def jpeg_size(picture):
    """Width and height from the frame header of a baseline JPEG."""
    place = picture.index(b"\xff\xc0")
    return int.from_bytes(picture[place + 7:place + 9], "big"), int.from_bytes(picture[place + 5:place + 7], "big")


class Description(DaemonCase):
    def test_every_answer_is_as_described(self):
        self.write("report.html", "<!doctype html><title>report</title>")
        text = installation(extra=f'[scene]\nmeshes = ["{BENCH}/scene.obj"]\nvolume.min = [-2, -2, -2]\nvolume.max = [2, 2, 2]\n'
                                  '[[zone]]\nname = "here"\nmin = [-2, -2, -2]\nmax = [2, 2, 2]\n')
        daemon = self.start(text.replace(f"{BENCH}/calibration.toml",
                                         self.write("calibration.toml", read_text(f"{BENCH}/calibration.toml"))))
        client = Client(daemon.http)
        wait_until(lambda: client.get("/readyz")[0] == 200, "it is ready")
        wait_until(lambda: "translation_m" in json.loads(client.get("/api/v1/objects")[2])[0], "the object is found")
        description = json.loads(client.get("/api/v1/openapi.json")[2])
        checked = 0
        for path, methods in description["paths"].items():
            if "get" not in methods:
                continue
            if path.endswith(("{path}", "capture/report")):  # of a recording, or of a capture: there is none
                continue
            name = "carton" if "objects" in path else "left"
            expected = methods["get"]["responses"]["200"]["content"]
            connection, answer = client.open("GET", path.replace("{name}", name))
            self.assertEqual(answer.status, 200, path)
            self.assertIn(answer.headers.get_content_type(), expected, path)
            self.assertEqual(answer.headers["Cache-Control"], "no-store", path)
            if answer.headers.get_content_type() == "application/json":
                schema = expected["application/json"]["schema"]
                self.assertIsNone(fault(json.loads(answer.read()), schema, description), path)
                checked += 1
            connection.close()
        self.assertGreaterEqual(checked, 12)
        connection, answer = client.open("GET", "/api/v1/events?state=1")
        seen = set()
        schemas = {"pose": "Pose", "state": "State"}
        for event, data in events(answer):
            self.assertIsNone(fault(data, {"$ref": f"/{schemas[event]}"}, description), event)
            seen.add(event)
            if seen == set(schemas):
                break
        connection.close()
        status, data = client.post("/api/v1/objects/nobody/hint", {"camera": "left", "x": 1, "y": 1})
        self.assertEqual(status, 404)
        self.assertIsNone(fault(data, {"$ref": "/Error"}, description))
        self.assertEqual(daemon.stop(), 0)


class Log(DaemonCase):
    def test_the_newest_messages_with_what_they_are_about(self):
        daemon = self.start(installation(cameras=("left", "right")) + '[[camera]]\nname = "side"\nsource = "v4l2:/dev/video-of-nobody"\n')
        client = Client(daemon.http)
        lines = lambda query="": json.loads(client.get("/api/v1/log" + query)[2])["events"]
        wait_until(lambda: any(event["text"] == "carton: found" for event in lines()), "the object is found")
        wait_until(lambda: any(event.get("camera") == "side" for event in lines()), "the camera is missed")
        gone = next(event for event in lines() if event.get("camera") == "side")
        self.assertEqual((gone["level"], gone["cause"]), ("warning", "absent"))
        self.assertIn("video-of-nobody", gone["text"])
        found = next(event for event in lines() if event["text"] == "carton: found")
        self.assertEqual((found["level"], found["object"]), ("info", "carton"))
        numbers = [event["number"] for event in lines()]
        self.assertEqual(numbers, list(range(1, len(numbers) + 1)))
        later = [event["number"] for event in lines(f"?after={numbers[2]}")]
        self.assertEqual(later[:len(numbers) - 3], numbers[3:])
        self.assertEqual(lines("?after=18446744073709551615"), [])
        for query in ("?after=-1", "?after=", "?after=1.5", "?after=1&after=2", "?before=1", "?after=18446744073709551616"):
            self.assertEqual(client.get("/api/v1/log" + query)[0], 400, query)
        for number in range(120):  # each is a line: refused
            client.post(f"/api/v1/objects/nobody{number}/forget", {})
            client.post("/api/v1/reload", {"no": number})
        kept = lines()
        self.assertEqual(len(kept), 200)
        self.assertEqual(kept[-1]["number"] - kept[0]["number"], 199)


class Pictures(DaemonCase):
    def test_a_snapshot_is_annotated_or_clean(self):
        daemon = self.start()
        client = Client(daemon.http)
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the object is found")
        status, headers, annotated = client.get("/cameras/left/snapshot.jpg")
        self.assertEqual((status, headers["Content-Type"]), (200, "image/jpeg"))
        self.assertEqual(jpeg_size(annotated), (640, 480))
        self.assertGreater(int(headers["X-Capture-Ns"]), 0)
        status, _, clean = client.get("/cameras/left/snapshot.jpg?annotated=0")
        self.assertEqual((status, jpeg_size(clean)), (200, (640, 480)))
        self.assertNotEqual(clean, annotated)
        self.assertEqual(client.get("/cameras/nobody/snapshot.jpg")[0], 404)
        self.assertEqual(client.get("/cameras/left/snapshot.jpg?scale=2")[0], 400)

    def test_pictures_are_made_while_they_are_watched_and_only_then(self):
        daemon = self.start()
        client = Client(daemon.http)
        made = lambda: daemon.metric("sightline_pictures_encoded_total", camera="left")
        time.sleep(1)
        self.assertEqual(made(), 0)
        self.assertEqual(daemon.state()["cameras"][0]["draw_s"], 0)
        connection, answer = client.open("GET", "/cameras/left/stream.mjpeg")
        self.assertTrue(answer.headers["Content-Type"].startswith("multipart/x-mixed-replace"))
        sequences = []
        for headers, picture in parts(answer):
            self.assertEqual(jpeg_size(picture), (640, 480))
            sequences.append(int(headers["X-Sequence"]))
            if len(sequences) == 20:
                break
        self.assertEqual(sequences, sorted(set(sequences)))
        self.assertEqual(daemon.state()["cameras"][0]["picture_viewers"], 1)
        connection.close()
        wait_until(lambda: daemon.state()["cameras"][0]["picture_viewers"] == 0, "nobody watches")
        before = made()
        time.sleep(1)
        self.assertLessEqual(made(), before + 1)  # what was under way
        self.assertIsNone(daemon.state()["cameras"][0].get("encoder"))  # no video was made for it
        self.assertEqual(daemon.stop(), 0)

    def test_several_cameras_come_in_one_answer_each_at_its_rate(self):
        daemon = self.start()
        connection, answer = Client(daemon.http).open("GET", "/api/v1/pictures?camera=left&camera=side&rate_hz=5")
        seen = {"left": [], "side": []}
        for headers, _ in parts(answer):
            seen[headers["X-Camera"]].append(int(headers["X-Capture-Ns"]))
            if min(map(len, seen.values())) == 10:
                break
        connection.close()
        for times in seen.values():  # of a recording at 30 Hz
            self.assertGreater((times[9] - times[0]) / 9, 0.9e9 / 5)

    def test_a_viewer_that_stops_reading_harms_no_other(self):
        daemon = self.start()
        stopped = socket.create_connection(("127.0.0.1", daemon.http))
        stopped.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        stopped.sendall(b"GET /cameras/left/stream.mjpeg HTTP/1.1\r\nHost: localhost\r\n\r\n")
        stopped.recv(100)
        connection, answer = Client(daemon.http).open("GET", "/cameras/left/stream.mjpeg")
        number = sum(1 for _, _ in zip(range(60), parts(answer)))
        self.assertEqual(number, 60)
        connection.close()
        wait_until(lambda: daemon.state()["cameras"][0]["picture_viewers"] == 0, "it is cut off")
        stopped.close()

    def test_streams_of_a_removed_camera_end_and_others_go_on_over_a_reload(self):
        daemon = self.start()
        client = Client(daemon.http)
        gone = client.open("GET", "/cameras/side/stream.mjpeg")[1]
        stays = client.open("GET", "/cameras/left/stream.mjpeg")[1]
        going, staying = parts(gone), parts(stays)
        next(going), next(staying)
        self.assertTrue(self.reload(daemon, installation(cameras=("left", "right"))))
        self.assertLess(sum(1 for _ in going), 1000)  # to its end
        for _ in range(30):
            next(staying)
        self.assertEqual(client.get("/cameras/side/snapshot.jpg")[0], 404)
        self.assertEqual(daemon.stop(), 0)


class Orders(DaemonCase):
    def test_forget_and_reload_reach_the_daemon(self):
        daemon = self.start()
        client = Client(daemon.http)
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the object is found")
        connection, answer = client.open("GET", "/api/v1/events")
        stream = events(answer)
        next(stream)
        self.assertEqual(client.post("/api/v1/objects/carton/forget")[0], 202)
        self.assertTrue(any(data["state"] == "searching" for _, (_, data) in zip(range(200), stream)))
        self.assertTrue(any(data["state"] != "searching" for _, (_, data) in zip(range(2000), stream)))
        connection.close()
        self.write("sightline.toml", "nonsense")
        ready = sum(word == "READY=1" for word in daemon.read_notifications())
        self.assertEqual(client.post("/api/v1/reload")[0], 202)
        daemon.wait_for_word("READY=1", count=ready + 1)
        self.assertIn("refused", daemon.state()["config"])
        self.assertEqual(daemon.stop(), 0)

    def test_a_hint_is_taken_for_an_object_that_is_searched_for(self):
        path = self.write("plain.toml", f'name = "plain"\nmesh = "{BENCH}/objects/carton.obj"\nunit = "m"\n')
        daemon = self.start(installation().replace(f"{BENCH}/objects/carton.toml", path))
        client = Client(daemon.http)
        for body in ({"camera": "left", "x": 320, "y": 240}, {"camera": "left", "x": 320, "y": 240, "radius_px": 20},
                     {"translation_m": [0, 0, 0.3], "rotation_wxyz": [1, 0, 0, 0]}):
            self.assertEqual(client.post("/api/v1/objects/plain/hint", body), (202, {}), body)
        self.assertEqual(client.post("/api/v1/objects/plain/hint", {"camera": "left", "x": 1, "y": 1, "radius_px": 0})[0], 400)
        self.assertEqual(daemon.stop(), 0)

    def test_a_hint_is_judged_by_what_there_is(self):
        daemon = self.start()
        client = Client(daemon.http)
        hint = lambda **body: client.post("/api/v1/objects/carton/hint", body)
        for body, status, text in (({"camera": "nobody", "x": 1, "y": 1}, 404, "no such camera"),
                                   ({"camera": "left", "x": 640, "y": 1}, 400, "outside its image of 640x480"),
                                   ({"camera": "left", "x": 1, "y": 1}, 400, "has markers"),
                                   ({"camera": "left", "x": 1}, 400, '"y" is missing')):
            got, answer = hint(**body)
            self.assertEqual(got, status, body)
            self.assertIn(text, answer["error"])
        self.assertEqual(daemon.stop(), 0)


class Roles(DaemonCase):
    TOKENS = "anna operator 0123456789abcdef-anna\nwall viewer 0123456789abcdef-wall\n"

    def tokens(self, text=TOKENS, mode=0o600):
        path = self.write("tokens", text)
        os.chmod(path, mode)
        return path

    def test_tokens_are_asked_for_and_never_said(self):
        path = self.tokens()
        port = fixed_port()
        daemon = self.start(installation(http=port, extra=f'[access]\ntokens = "{path}"\n'))
        anna = Client(port, {"Authorization": "Bearer 0123456789abcdef-anna"})
        wall = Client(port, {"Authorization": "Bearer 0123456789abcdef-wall"})
        self.assertEqual(Client(port).get("/api/v1/state")[0], 401)
        self.assertEqual(Client(port).get("/healthz")[0], 200)
        self.assertEqual(wall.get("/cameras/left/snapshot.jpg")[0], 200)
        self.assertEqual(wall.post("/api/v1/objects/carton/forget")[0], 403)
        self.assertEqual(anna.post("/api/v1/objects/carton/forget")[0], 202)
        self.assertEqual(Client(port, {"Authorization": "Bearer no-such-token-here"}).get("/metrics")[0], 401)
        rtsp = lambda user: subprocess.run(
            ["ffmpeg", "-nostdin", "-loglevel", "error", "-rtsp_transport", "tcp", "-i", f"rtsp://{user}127.0.0.1:{daemon.rtsp}/left",
             "-frames:v", "3", "-f", "null", "-"], timeout=WAIT_S, capture_output=True, check=False)
        self.assertEqual(rtsp("wall:0123456789abcdef-wall@").returncode, 0)
        for nobody in ("", "wall:0123456789abcdef-anna@", "nobody:0123456789abcdef-wall@"):
            done = rtsp(nobody)
            self.assertNotEqual(done.returncode, 0, nobody)
            self.assertIn(b"401", done.stderr)
        # New tokens come with a reload, which HTTP survives at its port.
        self.tokens("anna operator another-0123456789abcdef\n")
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_word("READY=1", count=2)
        self.assertEqual(anna.get("/metrics")[0], 401)
        new = Client(port, {"Authorization": "Bearer another-0123456789abcdef"})
        self.assertEqual(new.get("/metrics")[0], 200)
        self.assertEqual(daemon.stop(), 0)
        log = daemon.log_text()
        self.assertNotRegex(log, "0123456789abcdef|no-such-token")
        self.assertRegex(log, "forget by anna")

    def test_guesses_over_rtsp_are_limited_and_harm_no_viewer(self):
        daemon = self.start(installation(extra=f'[access]\ntokens = "{self.tokens()}"\n'))
        address = f"127.0.0.1:{daemon.rtsp}/left"

        def play(secret, frames=2):
            return subprocess.Popen(["ffmpeg", "-nostdin", "-loglevel", "error", "-rtsp_transport", "tcp", "-i",
                                     f"rtsp://wall:{secret}@{address}", "-frames:v", str(frames), "-f", "null", "-"],
                                    stderr=subprocess.DEVNULL)

        viewer = play("0123456789abcdef-wall", frames=100000)
        self.addCleanup(viewer.wait, timeout=WAIT_S)
        self.addCleanup(viewer.kill)
        wait_until(lambda: self.watched(daemon), "somebody watches")
        for _ in range(9):
            self.assertNotEqual(play("a-wrong-guess").wait(timeout=WAIT_S), 0)
        self.assertEqual(play("0123456789abcdef-wall").wait(timeout=WAIT_S), 0)  # nine may be mistakes
        self.assertNotEqual(play("a-wrong-guess").wait(timeout=WAIT_S), 0)
        self.assertNotEqual(play("0123456789abcdef-wall").wait(timeout=WAIT_S), 0)  # nothing is learned any more
        self.assertRegex(daemon.log_text(), "refused for a minute: too many wrong passwords")
        self.assertTrue(self.watched(daemon))
        self.assertEqual(daemon.stop(), 0)

    def watched(self, daemon):
        state = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-wall"}).get("/api/v1/state")[2]
        return json.loads(state)["cameras"][0]["viewers"] == 1

    def test_bad_token_files_are_named_with_their_line(self):
        path = self.tokens("anna admin 0123456789abcdef-anna\n")
        daemon = self.start()
        self.assertFalse(self.reload(daemon, installation(extra=f'[access]\ntokens = "{path}"\n')))
        refused = daemon.state()["config"]["refused"]["problem"]
        self.assertRegex(refused, r"sightline\.toml:\d+:10")
        self.assertIn(f"{path}:1: the role", refused)
        self.tokens(mode=0o644)
        self.assertFalse(self.reload(daemon, installation(extra=f'[access]\ntokens = "{path}"\n')))
        self.assertIn("chmod o=", daemon.state()["config"]["refused"]["problem"])
        self.assertNotIn("abcdef", re.sub(path, "", daemon.log_text()))


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    unittest.main(verbosity=2)
