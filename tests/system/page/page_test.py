#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The page in a headless Chromium against a real daemon: video or pictures in every tile, states and events, a picture that
gets stale, one camera large, hints and forget by mouse and keyboard, themes, phone width, names for assistive programs,
and no error on the console. With SIGHTLINE_SCREENSHOTS it leaves pictures in that folder."""
import os
import signal
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from browser import Browser, chromium  # noqa: E402
from support import BENCH, DaemonCase, installation, wait_until  # noqa: E402

SHOTS = os.environ.get("SIGHTLINE_SCREENSHOTS")
COLORS = "(() => {{ const from = document.querySelector('[data-camera={}] {}'), c = new OffscreenCanvas(640, 480)," \
         "d = c.getContext('2d'); d.drawImage(from, 0, 0); return new Set(d.getImageData(0, 0, 640, 480).data).size; }})()"
SEQUENCE = "+document.querySelector('[data-camera={}] canvas').dataset.sequence"


class Page(DaemonCase):
    def open(self, daemon, query="", **options):
        browser = Browser(**options)
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{daemon.http}/{query}")
        return browser

    def shot(self, browser, name, whole=False):
        if SHOTS:
            browser.screenshot(os.path.join(SHOTS, name + ".png"), whole)

    def plays(self, browser, camera):
        """True if its video is what is shown."""
        return browser.run(f"(v => !v.hidden && v.readyState >= 2 && v.videoWidth > 0)(document.querySelector('[data-camera={camera}] video'))")

    def live(self, browser, cameras=("left", "right", "side")):
        for camera in cameras:
            browser.wait_for(f"document.querySelector('[data-camera={camera}] .chip')?.textContent === 'live'", f"{camera} is live")
            first = browser.run(SEQUENCE.format(camera))
            browser.wait_for(f"{SEQUENCE.format(camera)} > {first} + 5 || {SEQUENCE.format(camera)} < {first}", f"{camera} moves")

    def test_it_shows_what_is_there(self):
        daemon = self.start()
        browser = self.open(daemon, "?theme=light", width=1360)
        self.live(browser)
        self.assertEqual(browser.run("document.title"), "test – Sightline")
        for camera in ("left", "right", "side"):  # on a busy machine pictures may come first: video is tried again
            wait_until(lambda camera=camera: self.plays(browser, camera), f"{camera} plays by WebRTC")
            self.assertGreater(browser.run(COLORS.format(camera, "video")), 100)
        played = "document.querySelector('[data-camera=side] video').getVideoPlaybackQuality().totalVideoFrames"
        before = browser.run(played)
        browser.wait_for(f"{played} > {before} + 10", "frames are decoded")
        self.assertEqual([camera["webrtc_viewers"] for camera in daemon.state()["cameras"]], [1, 1, 1])
        self.assertEqual([camera["picture_viewers"] for camera in daemon.state()["cameras"]], [0, 0, 0])
        browser.wait_for("document.querySelector('[data-object=carton] .chip').textContent.includes('tracking')", "it tracks")
        browser.wait_for("/\\d m$/.test(document.querySelector('[data-object=carton] dd').textContent)", "it has a place")
        browser.wait_for("/carton: tracking/.test(document.getElementById('events').textContent)", "it is an event")
        browser.wait_for("/\\d mm$/.test(document.querySelector('.plot span + span').textContent)", "it is plotted")
        self.shot(browser, "light")
        browser.run("document.getElementById('theme').click()")
        self.assertEqual(browser.run("document.documentElement.dataset.theme"), "dark")
        self.shot(browser, "dark")
        self.assertEqual(browser.problems, [])
        self.assertEqual(daemon.stop(), 0)

    def test_pictures_do_where_video_is_refused(self):
        text = installation()
        for extra, viewers, query in (("webrtc_viewers = 0\n", [0, 0, 0], ""), ("webrtc_viewers = 2\n", [1, 1, 0], ""),
                                      ("", [0, 0, 0], "?video=off")):
            daemon = self.start(text.replace("[http]\n", "[http]\n" + extra))
            browser = self.open(daemon, query)
            self.live(browser)
            wait_until(lambda: sorted(c["webrtc_viewers"] for c in daemon.state()["cameras"]) == sorted(viewers), "videos")
            for camera in daemon.state()["cameras"]:
                kind = "video" if camera["webrtc_viewers"] else "canvas"
                self.assertEqual(camera["picture_viewers"], 0 if kind == "video" else 1)
                self.assertEqual(self.plays(browser, camera["name"]), kind == "video")
                self.assertGreater(browser.run(COLORS.format(camera["name"], kind)), 100)
            self.assertEqual([problem for problem in browser.problems if "503" not in problem], [])
            if not viewers[0]:
                self.shot(browser, "pictures")
            browser.close()
            self.assertEqual(daemon.stop(), 0)

    def test_a_tab_that_closes_leaves_no_viewer(self):
        daemon = self.start()
        browser = self.open(daemon)
        self.live(browser)
        browser.go("about:blank")
        wait_until(lambda: all(c["webrtc_viewers"] == 0 for c in daemon.state()["cameras"]), "they have gone")

    def test_it_fits_a_phone_and_speaks_its_names(self):
        daemon = self.start()
        browser = self.open(daemon, width=390, height=844)
        self.live(browser, ("left",))
        self.assertLessEqual(browser.run("document.documentElement.scrollWidth"), 390)
        self.shot(browser, "phone", whole=True)
        names = browser.accessible_names()
        for expected in (("button", "Enlarge left"), ("button", "Say where it is: carton, in a picture"),
                         ("button", "Forget where carton is"), ("article", "Camera side"), ("article", "Object carton")):
            self.assertIn(expected, names)
        self.assertEqual([name for name in names if name[0] in ("button", "link", "image", "img", "article") and not name[1]], [])
        self.assertEqual(browser.problems, [])

    def test_one_camera_is_large_and_only_that_is_fetched(self):
        daemon = self.start()
        browser = self.open(daemon)
        self.live(browser)
        browser.run("document.querySelector('[data-camera=right] button').focus()")
        browser.key("Enter", 13)
        browser.wait_for("document.querySelectorAll('.tile:not([hidden])').length === 1", "one is shown")
        browser.wait_for("document.querySelector('[data-camera=right] canvas').clientWidth > 600", "it is large")
        watchers = lambda: [camera["webrtc_viewers"] for camera in daemon.state()["cameras"]]
        wait_until(lambda: watchers() == [0, 1, 0], "the others are not fetched")
        self.shot(browser, "large")
        browser.key("Escape", 27)
        browser.wait_for("document.querySelectorAll('.tile:not([hidden])').length === 3", "all are shown")
        self.live(browser)
        self.assertEqual(browser.problems, [])

    def test_a_picture_that_stands_still_is_seen_to_be_old(self):
        daemon = self.start()
        browser = self.open(daemon)
        self.live(browser)
        daemon.process.send_signal(signal.SIGSTOP)
        try:
            browser.wait_for("document.querySelectorAll('.stale').length === 3", "all are gray")
            browser.wait_for("/no picture for \\d+ s/.test(document.querySelector('.note').textContent)", "it says how long")
            browser.wait_for("/not known/.test(document.querySelector('[data-object=carton] .chip').textContent)", "nor is the state")
            browser.wait_for("/^silent for/.test(document.getElementById('link').textContent)", "and why")
            self.shot(browser, "stale")
        finally:
            daemon.process.send_signal(signal.SIGCONT)
        self.live(browser)
        browser.wait_for("document.querySelectorAll('.stale').length === 0", "they are fresh again")

    def test_it_records_marks_and_plays(self):
        os.mkdir(self.path("recordings"))
        daemon = self.start(installation(extra=f'[record]\ndirectory = "{self.path("recordings")}"\n'))
        browser = self.open(daemon, "?theme=light", width=1360)
        button = "document.querySelector('[data-kind=viewing]')"
        browser.wait_for(f"/Record viewing/.test({button}?.textContent)", "it offers to record")
        browser.wait_for(f"!{button}.disabled", "it can")
        browser.run(f"{button}.click()")
        browser.wait_for(f"/Stop viewing/.test({button}.textContent)", "it records")
        browser.wait_for("!document.querySelector('#recordings input').disabled", "it can be marked")
        browser.run("document.querySelector('#recordings input').value = 'door'")
        browser.run("document.querySelector('#recordings form').requestSubmit()")
        browser.wait_for("/marked: door/.test(document.getElementById('events').textContent)", "it is marked")
        folder = os.path.join(self.path("recordings"), os.listdir(self.path("recordings"))[0])
        wait_until(lambda: os.path.exists(os.path.join(folder, "marks.csv")), "the mark is written")
        wait_until(lambda: sum(entry.stat().st_size for entry in os.scandir(folder)) > 1_000_000, "there is something to see")
        browser.run(f"{button}.click()")
        browser.wait_for(f"/Record viewing/.test({button}.textContent)", "it has ended")
        play = "document.querySelector('#recordings [aria-label^=\"Play left-0001\"]')"
        browser.wait_for(f"{play} !== null", "it is listed")
        browser.run(f"{play}.click()")
        video = "document.querySelector('#recordings video')"
        browser.wait_for(f"{video}.currentTime > 0.5 && {video}.videoWidth === 640", "it plays")
        self.shot(browser, "recordings", whole=True)
        self.assertEqual(browser.run(f"{video}.error"), None)
        browser.run("document.querySelector('#recordings .player button').click()")
        self.assertEqual(browser.problems, [])

    def test_an_operator_points_and_forgets(self):
        daemon = self.start()
        browser = self.open(daemon)
        self.live(browser, ("left",))
        browser.run("document.querySelector('[data-object=carton] .do button').click()")
        box = browser.run("(() => { const b = document.querySelector('[data-camera=left] canvas').getBoundingClientRect();"
                          "return [b.left + b.width / 2, b.top + b.height / 2]; })()")
        browser.click(*box)
        # This object has markers: the daemon says so, and the page says it.
        events = "document.getElementById('events').textContent"
        browser.wait_for(f"/hint for carton refused: .*has markers/.test({events})", "the answer is shown")
        browser.run("document.querySelector('[data-camera=left] canvas').focus()")
        browser.key("ArrowRight", 39)
        browser.key("Enter", 13)
        browser.wait_for(f"({events}.match(/has markers/g) ?? []).length === 2", "the keyboard points too")
        browser.key("Escape", 27)
        self.assertEqual(browser.run("document.querySelector('.pointing')"), None)
        self.assertIn("carton/hint refused", daemon.log_text())
        browser.run("document.querySelector('[data-object=carton] .do button + button').click()")
        browser.wait_for(f"/carton forgotten/.test({events})", "it is forgotten")
        wait_until(lambda: "carton: forgotten" in daemon.log_text(), "the daemon says so")
        # A refused order is an error of the network to the browser, and nothing else is.
        self.assertEqual([problem for problem in browser.problems if "400" not in problem], [])

    def test_the_events_are_the_daemons_also_those_before_the_page(self):
        daemon = self.start(installation(cameras=("left", "right")) + '[[camera]]\nname = "side"\nsource = "v4l2:/dev/video-of-nobody"\n')
        wait_until(lambda: "carton: found" in daemon.log_text(), "it has something to tell")
        self.assertFalse(self.reload(daemon, "nonsense = 1"))
        browser = self.open(daemon, width=390, height=844)
        events = "document.getElementById('events')"
        for said in ("carton: found", "video-of-nobody", "warning .*side", "error reload refused.*nonsense"):
            browser.wait_for(f"/{said}/s.test({events}.textContent)", f"{said} is listed")
        times = browser.run(f"[...{events}.children].map((line) => +line.dataset.time)")
        self.assertEqual(times, sorted(times, reverse=True))
        self.assertTrue(self.reload(daemon, installation()))
        browser.wait_for(f"/reload: /.test({events}.firstElementChild.textContent + {events}.textContent)", "what happens now comes, too")
        self.assertLessEqual(browser.run("document.documentElement.scrollWidth"), 390)
        self.shot(browser, "events", whole=True)
        browser.call("Page.reload")
        browser.wait_for(f"/error reload refused/.test({events}?.textContent ?? '')", "another page sees the same")
        self.assertEqual(browser.problems, [])

    def test_a_reload_changes_the_page_and_a_refused_one_is_told(self):
        daemon = self.start()
        browser = self.open(daemon)
        self.live(browser)
        self.assertTrue(self.reload(daemon, installation(http=0, cameras=("left", "right"))))
        browser.wait_for("document.querySelectorAll('.tile').length === 2", "the tile is gone")
        self.live(browser, ("left", "right"))
        self.assertFalse(self.reload(daemon, "nonsense = 1"))
        browser.wait_for("/was refused/.test(document.getElementById('banner').textContent)", "it is told")
        self.shot(browser, "refused")
        self.assertEqual(browser.problems, [])


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    if chromium() is None:
        print("skipped: no chromium on this machine (scripts/deps installs it)")
        sys.exit(77)
    unittest.main(verbosity=2)
