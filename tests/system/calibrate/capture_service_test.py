#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A capture of target views by the cameras of a running daemon, by order over HTTP: it says what is missing, ends by itself
with a good report, or is stopped; what is in force stays as it is, live streams go on, a reload and a killed daemon lose nothing
that was taken. And the same at the page, in a browser (skipped without Chromium)."""
import json
import os
import re
import shutil
import subprocess
import sys
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, ".."), os.path.join(HERE, "..", "page")]
from accessibility_test import CONTRAST  # noqa: E402
from api_test import Client, fault  # noqa: E402
from browser import Browser, chromium  # noqa: E402
from calibrate_capture_test import Recorded  # noqa: E402
from support import BIN, WAIT_S, DaemonCase, read_text, sightline, wait_until  # noqa: E402

CAPTURE = "/api/v1/calibration/capture"


class Desk(Recorded, DaemonCase):
    def installation(self, extra="", cameras=("left", "right")):
        """The calibration in force is beside it, and a target; so is what is no target."""
        force = read_text(os.path.join(self.recording, "calibration.toml"))
        self.write("force.toml", force.replace("\nfx = ", "\nreadout_s = 0.01\nfx = ", 1))  # left is a rolling shutter
        shutil.copy(self.target(), self.path("board.toml"))
        shutil.copy(os.path.join(self.recording, "wall.toml"), self.path("wall.toml"))
        text = 'name = "test"\ncalibration = "force.toml"\n'
        for camera in cameras:
            text += f'[[camera]]\nname = "{camera}"\nsource = "replay:{self.recording}"\n'
        return text + "[rtsp]\nport = 0\n[http]\nport = 0\n" + extra

    def begin(self, extra="", **order):
        """A daemon that captures: (daemon, client)."""
        daemon = self.start(self.installation(extra))
        client = Client(daemon.http)
        wait_until(lambda: client.get("/readyz")[0] == 200, "it is ready")
        self.order(client, **order)
        return daemon, client

    def order(self, client, **order):
        status, answer = client.post(f"{CAPTURE}/start", order)
        self.assertEqual(status, 202, answer)
        self.capture_folder = answer["folder"]

    def capture(self, client):
        return json.loads(client.get(CAPTURE)[2])

    def wait_for(self, client, condition, what):
        wait_until(lambda: condition(self.capture(client)) or self.capture(client)["state"] == "failed", what)
        found = self.capture(client)
        self.assertNotEqual(found["state"], "failed", found.get("words"))
        return found


class Orders(Desk):
    def test_it_ends_by_itself_and_touches_nothing(self):
        daemon, client = self.begin()
        before = read_text(self.path("force.toml"))
        description = json.loads(client.get("/api/v1/openapi.json")[2])
        described = lambda value, name: self.assertIsNone(fault(value, {"$ref": f"/{name}"}, description))
        targets = json.loads(client.get(f"{CAPTURE}/targets")[2])
        described(targets, "CaptureTargets")
        self.assertEqual([target["name"] for target in targets], ["board.toml"])  # the wall cannot be shown
        self.assertEqual(client.post(f"{CAPTURE}/start")[0], 409)
        self.assertEqual(client.get(f"{CAPTURE}/report")[0], 404)
        said = []
        running = None

        def over():
            nonlocal running
            now = self.capture(client)
            described(now, "Capture")
            if not said or said[-1] != now["words"]:
                said.append(now["words"])
            if now["state"] == "running" and now["sets"] >= 4:
                running = now
            return now["state"] in ("done", "failed")

        wait_until(over, "it ends")
        done = self.capture(client)
        self.assertEqual((done["state"], done["grade"]), ("done", "good"), done["words"])
        self.assertRegex("\n".join(said), r"left: show the board (in|at) the \w+")
        self.assertRegex("\n".join(said), r"tilted: its \w+ edge \(in the picture\) towards the camera")
        self.assertIn("what was taken is being solved", said)
        left = running["cameras"][0]
        self.assertEqual(len(left["cells"]), left["columns"] * left["rows"])
        self.assertAlmostEqual(sum(1 for n in left["cells"] if n) / len(left["cells"]), left["coverage"], places=2)
        self.assertEqual(done["links"][0]["cameras"], ["left", "right"])
        self.assertGreaterEqual(done["links"][0]["sets"], done["links_needed"])
        self.assertTrue(all(camera["complete"] for camera in done["cameras"]))
        # What is there can be looked at and solved again, and is not in force.
        status, headers, report = client.get(f"{CAPTURE}/report")
        self.assertEqual(status, 200)
        self.assertIn("sandbox", headers["Content-Security-Policy"])
        self.assertIn(b"<svg", report)
        again = self.path("again")
        sightline("calibrate", "solve", os.path.join(done["folder"], "corners.csv"), "--out", again)
        made = self.calibration(os.path.join(done["folder"], "calibration.toml"))
        for name, camera in self.calibration(os.path.join(again, "calibration.toml")).items():
            self.assertAlmostEqual(camera["fx"], made[name]["fx"], places=6)
        true = self.calibration(os.path.join(self.recording, "calibration.toml"))
        for name in ("left", "right"):
            for key in ("fx", "fy", "cx", "cy"):
                self.assertLess(abs(made[name][key] - true[name][key]), 6 * made[name]["sigmas"][key], f"{name} {key}")
        self.assertEqual(read_text(self.path("force.toml")), before)
        for name in ("coverage_left.svg", "coverage_right.svg", "capture.html"):
            self.assertIn("<svg", read_text(os.path.join(done["folder"], name)), name)
        self.assertEqual(client.post(f"{CAPTURE}/stop")[0], 404)
        self.assertEqual(daemon.stop(), 0)

    def test_stopped_it_solves_what_it_has_and_goes_on_from_there(self):
        daemon, client = self.begin(target="board.toml", keep_lenses=True)
        first = self.wait_for(client, lambda now: now["sets"] >= 3, "three sets are taken")
        self.assertTrue(first["cameras"][0]["lens_known"])
        self.assertEqual(client.post(f"{CAPTURE}/stop")[0], 202)
        stopped = self.wait_for(client, lambda now: now["state"] == "done", "it is solved")
        self.assertEqual(self.sets(stopped["folder"]), stopped["sets"])
        # The lens that was kept is that in force.
        made, force = (self.calibration(os.path.join(folder, name)) for folder, name in
                       ((stopped["folder"], "calibration.toml"), (self.folder, "force.toml")))
        self.assertAlmostEqual(made["left"]["fx"], force["left"]["fx"], places=6)
        self.assertEqual((made["left"]["readout_s"], made["right"].get("readout_s", 0)), (0.01, 0))
        self.order(client, target="board.toml", keep_lenses=True, resume=True)
        more = self.wait_for(client, lambda now: now["state"] == "running", "it goes on")
        self.assertGreaterEqual(more["sets"], stopped["sets"])
        self.assertNotEqual(more["folder"], stopped["folder"])
        # A daemon that is killed loses nothing that was taken.
        self.wait_for(client, lambda now: now["sets"] > more["sets"] or now["state"] == "done", "another set")
        taken = self.capture(client)["sets"]
        wait_until(lambda: self.sets(more["folder"]) >= taken, "it is on the disk")
        daemon.process.kill()
        daemon.process.wait(timeout=WAIT_S)
        self.assertGreaterEqual(self.sets(more["folder"]), taken)

    def test_readouts_of_rolling_shutters_are_solved_for(self):
        self.recording = self.path("rolling")
        subprocess.run([os.path.join(BIN, "make_board_recording"), self.recording, "--moving", "--poses", "14", "--readout",
                        "0.03"], check=True, timeout=8 * WAIT_S)
        true = self.calibration(os.path.join(self.recording, "calibration.toml"))
        installation = self.installation()
        self.write("force.toml", re.sub(r"readout_s = .*\n", "", read_text(self.path("force.toml"))))
        daemon = self.start(installation)
        client = Client(daemon.http)
        wait_until(lambda: client.get("/readyz")[0] == 200, "it is ready")
        self.order(client, target="board.toml", keep_lenses=True, moving=True, readouts=True)
        self.wait_for(client, lambda now: now["sets"] >= 10 or now["state"] == "done", "ten sets are taken")
        self.assertTrue(self.capture(client)["readouts"])
        client.post(f"{CAPTURE}/stop")
        done = self.wait_for(client, lambda now: now["state"] == "done", "it is solved")
        for name, camera in self.calibration(os.path.join(done["folder"], "calibration.toml")).items():
            self.assertLess(abs(camera["readout_s"] - true[name]["readout_s"]), 0.003, name)

    def test_what_cannot_be_captured_is_refused_by_name(self):
        daemon = self.start(self.installation())
        client = Client(daemon.http)
        self.assertEqual(self.capture(client), {"state": "off"})
        wall = read_text(self.path("wall.toml"))
        for body, status, words in (({"target": "other.toml"}, 400, "there is no 'other.toml'; there are board.toml"),
                                    ({"target": "../board.toml"}, 400, "there are board.toml"),
                                    ({"target_toml": wall}, 400, "fixed = true"), ({"target_toml": "x = 1"}, 400, "target_toml"),
                                    ({"target": "board.toml", "target_toml": wall}, 400, "one too many"),
                                    ({"cameras": ["nobody"]}, 400, "there is no such camera"), ({"cameras": ["left", "left"]}, 400, "twice"),
                                    ({"cameras": []}, 400, "list of names"), ({"moving": 1}, 400, "true or false"), ({"readouts": True}, 400, "needs \"moving\""),
                                    ({"resume": True}, 400, "no earlier capture"), ({"folder": "/tmp"}, 400, "is not known")):
            got, answer = client.post(f"{CAPTURE}/start", body)
            self.assertEqual(got, status, (body, answer))
            self.assertIn(words, answer["error"])
        self.assertEqual(client.post(f"{CAPTURE}/stop")[0], 404)
        self.assertEqual(self.capture(client), {"state": "off"})
        self.assertFalse(os.path.exists(self.path("state", "sightline", "captures")))
        # Views of a board that nobody shows: none, and no calibration.
        other = read_text(self.path("board.toml")).replace("5X5_100", "4X4_50")
        self.order(client, target_toml=other)
        self.wait_for(client, lambda now: now["cameras"][0]["images"] > 0, "images are looked at")
        self.assertEqual(client.post(f"{CAPTURE}/stop")[0], 202)
        wait_until(lambda: self.capture(client)["state"] == "failed", "it is over")
        self.assertIn("no view was taken", self.capture(client)["words"])
        self.assertEqual(daemon.stop(), 0)

    def test_it_takes_an_operator(self):
        path = self.write("tokens", "anna operator 0123456789abcdef-anna\nwall viewer 0123456789abcdef-wall\n")
        os.chmod(path, 0o600)
        daemon = self.start(self.installation(f'[access]\ntokens = "{path}"\n'))
        wall = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-wall"})
        anna = Client(daemon.http, {"Authorization": "Bearer 0123456789abcdef-anna"})
        self.assertEqual(wall.post(f"{CAPTURE}/start")[0], 403)
        self.assertEqual(anna.post(f"{CAPTURE}/start")[0], 202)
        self.assertEqual(self.capture(wall)["state"], "running")
        self.assertEqual(wall.post(f"{CAPTURE}/stop")[0], 403)
        self.assertEqual(anna.post(f"{CAPTURE}/stop")[0], 202)
        self.assertRegex(daemon.log_text(), "capture/start by anna")

    def test_cameras_go_on_and_others_end_it(self):
        daemon, client = self.begin()
        self.wait_for(client, lambda now: now["sets"] >= 1, "a set is taken")
        # What is about something else leaves it alone; no camera was opened anew for it.
        self.assertTrue(self.reload(daemon, self.installation().replace('"test"', '"other"')))
        self.assertEqual(self.capture(client)["state"], "running")
        for camera in ("left", "right"):
            self.assertEqual(daemon.metric("sightline_source_opened_total", camera=camera), 1)
        # Frames of other cameras under the numbers of these would be no views of theirs.
        self.assertTrue(self.reload(daemon, self.installation(cameras=("right",))))
        wait_until(lambda: self.capture(client)["state"] not in ("running", "solving"), "it ends")
        self.assertEqual([camera["name"] for camera in self.capture(client)["cameras"]], ["left", "right"])
        self.assertGreaterEqual(self.sets(self.capture_folder), 1)
        self.assertEqual(daemon.stop(), 0)

    def test_the_daemon_ends_while_it_captures(self):
        daemon, client = self.begin()
        self.wait_for(client, lambda now: now["sets"] >= 1, "a set is taken")
        wait_until(lambda: self.sets(self.capture_folder) >= 1, "it is kept")
        self.assertEqual(daemon.stop(), 0)
        self.assertGreaterEqual(self.sets(self.capture_folder), 1)


@unittest.skipUnless(chromium(), "no chromium")
class Page(Desk):
    WORDS = "document.querySelector('#capture .words').textContent"

    def browse(self, daemon, query="?theme=light", **options):
        browser = Browser(**options)
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{daemon.http}/{query}")
        browser.wait_for("document.querySelectorAll('.tile .chip.good').length === 2", "both cameras are live")
        return browser

    def press(self, browser, text):
        browser.run(f"[...document.querySelectorAll('button')].find((b) => b.textContent === '{text}').click()")

    def test_an_operator_captures_from_the_page(self):
        daemon = self.start(self.installation())
        browser = self.browse(daemon)
        other = self.browse(daemon, "?theme=dark", width=390, height=844)
        self.assertTrue(browser.run("document.getElementById('capture').hidden"))
        self.press(browser, "Capture views of a target")
        browser.wait_for("/^board\\.toml: /.test(document.querySelector('.capture-form select').selectedOptions[0]?.textContent ?? '')",
                         "the target is offered")
        self.assertEqual(browser.run(CONTRAST), [])
        # Read-outs are solved for with a board in motion; the boxes say so.
        labels = "[...document.querySelectorAll('.capture-form fieldset label')]"
        checked = labels + ".filter((l) => l.firstChild.checked).map((l) => l.textContent)"
        click = labels + ".find((l) => l.textContent === '{}').firstChild.click()"
        browser.run(click.format("solve for rolling shutters"))
        self.picture(browser, "form_light", whole=True)
        self.assertEqual(browser.run(checked), ["board in motion", "solve for rolling shutters"])
        self.assertLessEqual(browser.run("document.documentElement.scrollWidth"), 1280)
        browser.run(click.format("board in motion"))
        self.assertEqual(browser.run(checked), [])
        self.press(browser, "Start")
        for one in (browser, other):  # who looks elsewhere sees the same
            one.wait_for("!document.getElementById('capture').hidden", "it is shown")
            one.wait_for(f"/show the board|show it the board/.test({self.WORDS})", "it says what to do")
            one.wait_for("document.querySelectorAll('.tile .coverage').length === 2", "a grid over each picture")
        seen = "document.querySelectorAll('.tile .coverage .seen').length"
        first = browser.run(seen)
        browser.wait_for("parseInt(document.querySelector('#capture .facts').textContent) >= 4", "sets are taken")
        self.assertGreater(browser.run(seen), first)
        browser.wait_for("document.querySelector('.tile .coverage .wanted') !== null", "where to show it next")
        browser.wait_for("/left and right \\d+×/.test(document.getElementById('capture').textContent)", "links")
        self.assertGreater(browser.run("document.querySelector('#capture progress').value"), 0)
        self.assertLessEqual(other.run("document.documentElement.scrollWidth"), 390)
        names = [name for _, name in other.accessible_names()]
        self.assertTrue(any(name.startswith("Coverage of camera left: ") for name in names), names)
        self.assertIn("What has been taken of what is needed", names)
        for one in (browser, other):
            self.assertEqual(one.run(CONTRAST), [])
        self.picture(browser, "running_light")
        self.picture(other, "running_phone_dark")
        for one in (browser, other):
            one.wait_for("document.getElementById('capture').dataset.state === 'done'", "it ends by itself")
            self.assertRegex(one.run(self.WORDS), r"^Done, good: .*calibration\.toml$")
            one.wait_for("document.querySelectorAll('.coverage').length === 0", "the pictures are free again")
            self.assertEqual(one.run(CONTRAST), [])
        self.assertRegex(browser.run("document.getElementById('capture').textContent"), r"left: good for [\d.]+ mm at")
        self.assertEqual(browser.run("fetch(document.querySelector('#capture a').href).then((r) => r.status)"), 200)
        self.picture(browser, "done_light")
        self.press(browser, "Close")
        browser.wait_for("document.getElementById('capture').hidden", "it is put away")
        self.assertEqual(browser.problems + other.problems, [])

    def test_it_is_stopped_from_the_page(self):
        daemon, _ = self.begin()
        browser = self.browse(daemon)
        browser.wait_for("document.getElementById('capture').dataset.state === 'running'", "it is shown")
        self.press(browser, "Stop and solve")
        browser.wait_for("/^(done|failed)$/.test(document.getElementById('capture').dataset.state)", "it is over")
        self.assertEqual(browser.problems, [])

    def picture(self, browser, name, whole=False):
        """Where somebody wants to look at it (SIGHTLINE_SCREENSHOTS)."""
        folder = os.environ.get("SIGHTLINE_SCREENSHOTS")
        if folder:
            browser.screenshot(os.path.join(folder, f"capture_{name}.png"), whole)


if __name__ == "__main__":
    unittest.main(verbosity=2)
