#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The scene in 3D in a headless Chromium: drawn by WebGL and turned by mouse, wheel and keys; lines alone where there is no
WebGL; still while nobody sees it. And overlay, calibration and installation file as the page shows and changes them."""
import json
import os
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from browser import Browser, chromium  # noqa: E402
from support import BENCH, DaemonCase, installation, read_text, wait_until  # noqa: E402

SHOTS = os.environ.get("SIGHTLINE_SCREENSHOTS")
CANVAS = "document.querySelector('#scene canvas')"
FRAMES = f"+({CANVAS}.dataset.frames ?? 0)"
# Pixels of the picture that this frame ends with, in all colors but the commonest.
PAINTED = f"""new Promise((done) => requestAnimationFrame(() => {{
  const copy = document.createElement('canvas'), from = {CANVAS};
  [copy.width, copy.height] = [from.width, from.height];
  const g = copy.getContext('2d');
  g.drawImage(from, 0, 0);
  const counts = new Map();
  for (const pixel of new Uint32Array(g.getImageData(0, 0, copy.width, copy.height).data.buffer)) counts.set(pixel, (counts.get(pixel) ?? 0) + 1);
  const all = [...counts.values()];
  done([all.reduce((a, b) => a + b, 0) - Math.max(...all), all.length]);
}}))"""
EVENTS = "document.getElementById('events').textContent"


class Scene(DaemonCase):
    def open(self, query="", text=None, **options):
        daemon = self.start(text or installation(extra=f'[scene]\nmeshes = ["{BENCH}/scene.obj"]\n'))
        browser = Browser(**options)
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{daemon.http}/{query}")
        browser.wait_for("document.querySelectorAll('.tile').length === 3", "the page is there")
        browser.run("document.querySelector('#scene').scrollIntoView()")
        browser.wait_for(f"{FRAMES} > 2", "it is drawn")
        browser.wait_for("document.querySelector('[data-object=carton] .chip')?.textContent.includes('tracking')", "it tracks")
        return daemon, browser

    def test_it_is_drawn_and_turns(self):
        _, browser = self.open("?theme=light")
        self.assertEqual(browser.run(f"{CANVAS}.dataset.bodies"), "1")
        lines_only = browser.run("document.querySelector('#scene .why').textContent")
        self.assertNotRegex(lines_only, "Lines only", "this Chromium has WebGL by software")
        box = browser.run(f"(b => [b.x + b.width / 2, b.y + b.height / 2])({CANVAS}.getBoundingClientRect())")
        view = lambda: browser.run(f"{CANVAS}.dataset.view")
        before = view()
        for kind, dx in (("mousePressed", 0), ("mouseMoved", 120), ("mouseReleased", 120)):
            browser.call("Input.dispatchMouseEvent", type=kind, x=box[0] + dx, y=box[1], button="left",
                         buttons=0 if kind == "mouseReleased" else 1, clickCount=1)
        wait_until(lambda: view() != before, "it has turned")
        before = view()
        browser.call("Input.dispatchMouseEvent", type="mouseWheel", x=box[0], y=box[1], deltaX=0, deltaY=-200)
        wait_until(lambda: view() != before, "the wheel brings it nearer")
        browser.run(f"{CANVAS}.focus()")
        for key, code in (("ArrowLeft", 37), ("ArrowUp", 38), ("+", 187)):
            before = view()
            browser.key(key, code)
            wait_until(lambda: view() != before, f"{key} moves it")
        if SHOTS:
            browser.screenshot(os.path.join(SHOTS, "scene.png"))
        self.assertEqual(browser.problems, [])

    def test_what_is_painted_is_a_scene_and_not_one_color(self):
        for query in ("", "?webgl=off"):
            _, browser = self.open(query)
            # WebGL's picture can be read in the frame that it was drawn in only.
            browser.run(f"window.most = 0; (function turn() {{ {PAINTED}.then((p) => {{ window.most = Math.max(window.most, p[0]); turn(); }}); }})()")
            browser.wait_for("window.most > 3000", "there is something to see")
            if query:
                self.assertRegex(browser.run("document.querySelector('#scene .why').textContent"), "Lines only")
            self.assertEqual(browser.problems, [])
            browser.close()

    def test_nothing_is_drawn_that_nobody_sees(self):
        _, browser = self.open(height=500)
        browser.run("scrollTo(0, 0)")
        browser.wait_for(f"{CANVAS}.getBoundingClientRect().top > innerHeight", "it is out of sight")
        first = browser.run(f"new Promise((done) => setTimeout(() => done({FRAMES}), 300))")
        self.assertEqual(browser.run(f"new Promise((done) => setTimeout(() => done({FRAMES}), 1000))"), first)


class Overlay(DaemonCase):
    def test_themes_and_marks_are_switched_live(self):
        daemon = self.start()
        browser = Browser()
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{daemon.http}/?theme=light")
        looks = lambda: {c["name"]: c for c in json.loads(daemon.get("/api/v1/overlay"))["cameras"]}
        browser.wait_for("document.querySelectorAll('#overlay input').length > 5", "the overlay is there")
        choose = "(s => {{ s.value = '{}'; s.dispatchEvent(new Event('change')); }})(document.querySelectorAll('#overlay select')[{}])"
        browser.run(choose.format("high_contrast", 1))
        wait_until(lambda: all(look["overlay"]["color"] == "#ffee00" for look in looks().values()), "the theme is in force")
        browser.wait_for(f"/overlay: theme high_contrast/.test({EVENTS})", "it is an event")
        browser.wait_for("/Not as in the file: left, right, side/.test(document.querySelector('#overlay .facts').textContent)", "it says so")
        browser.run(choose.format("side", 0))
        browser.run("document.querySelector('#overlay input[name=axes]').click()")
        wait_until(lambda: "axes" in looks()["side"]["overlay"]["styles"], "axes in one")
        self.assertNotIn("axes", looks()["left"]["overlay"]["styles"])
        browser.run(choose.format("", 0))
        browser.wait_for("document.querySelector('#overlay input[name=axes]').indeterminate", "some have them")
        browser.run("document.querySelector('#overlay button').click()")
        wait_until(lambda: all(look["as_in_file"] for look in looks().values()), "as in the file")
        # Another viewer's choice is seen here, too.
        wait_until(lambda: browser.run("document.querySelector('#overlay button').disabled"), "the page knows")
        self.assertEqual(browser.problems, [])


class Rig(DaemonCase):
    def test_calibration_report_and_file_are_shown(self):
        self.write("report.html", "<p>report</p>")
        path = self.write("calibration.toml", read_text(f"{BENCH}/calibration.toml"))
        text = installation(extra='[[zone]]\nname = "here"\nmin = [-2, -2, -2]\nmax = [2, 2, 2]\n')
        daemon = self.start(text.replace(f"{BENCH}/calibration.toml", path))
        browser = Browser()
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{daemon.http}/")
        browser.wait_for("document.querySelectorAll('.places .chip.good').length === 3", "the cameras are in order")
        browser.wait_for("document.querySelector('#calibration a').checkVisibility()", "the report can be read")
        browser.wait_for(f"/carton: entered here/.test({EVENTS})", "the zone is an event")
        self.assertIn(self.config, browser.run("document.querySelector('#configuration').textContent"))
        self.write("sightline.toml", "nonsense = 1")
        browser.run("document.querySelector('#configuration button').click()")
        browser.wait_for("/nonsense/.test(document.querySelector('#configuration .problem').textContent)", "its errors are shown")
        self.assertEqual(browser.problems, [])


if __name__ == "__main__":
    if chromium() is None:
        print("skipped: no chromium on this machine (scripts/deps installs it)")
        sys.exit(77)
    unittest.main(verbosity=2)
