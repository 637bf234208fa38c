#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline calibrate capture --page` in a browser of a phone's width: the words of the terminal, pictures that fill, links,
the end; a capture that is gone is visibly gone. Who may see it: the rules of the daemon's page. Skipped (77) without Chromium."""
import http.client
import os
import re
import signal
import sys
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, ".."), os.path.join(HERE, "..", "page")]
from browser import Browser, chromium  # noqa: E402
from calibrate_capture_test import Recorded  # noqa: E402
from support import WAIT_S, read_text, sightline, wait_until  # noqa: E402

SHADED = "[...document.querySelectorAll('#pictures rect')].filter((r) => (r.getAttribute('fill') ?? '').startsWith('rgb')).length"


class Page(Recorded):
    def open_capture(self, *more, extra="", out="out"):
        """A capture with a page: (process, port)."""
        process = self.begin(*self.arguments(self.rig(extra=extra), self.path(out), "--page", "--page-port", "0", *more))
        address = re.compile(r"^page: https?://127\.0\.0\.1:(\d+)/$", re.MULTILINE)
        wait_until(lambda: address.search(read_text(self.said)) or process.poll() is not None, "it says where the page is")
        found = address.search(read_text(self.said))
        self.assertTrue(found, read_text(self.said))
        return process, int(found.group(1))

    def browse(self, port):
        browser = Browser(width=390, height=844)
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{port}/")
        return browser

    def test_it_shows_what_the_terminal_says_until_the_end(self):
        process, port = self.open_capture()
        browser = self.browse(port)
        browser.wait_for("/show the board|show it the board/.test(document.getElementById('words').textContent)", "it says what to do")
        browser.wait_for("document.querySelectorAll('#pictures > div').length === 2", "each camera has a picture")
        first = browser.run(SHADED)
        browser.wait_for("parseInt(document.getElementById('sets').textContent) >= 4", "sets are taken")
        self.assertGreater(browser.run(SHADED), first, "their pictures fill")
        self.assertIn(browser.run("document.getElementById('words').textContent"), read_text(self.said))
        browser.wait_for("/left and right saw it together \\d+ time/.test(document.getElementById('links').textContent)", "links")
        self.assertGreater(browser.run("document.getElementById('share').value"), 0)
        # A phone is not scrolled sideways, and who cannot see the pictures is told of them.
        self.assertLessEqual(browser.run("document.documentElement.scrollWidth"), 390)
        names = browser.accessible_names()
        for camera in ("left", "right"):
            self.assertIn(f"coverage of camera {camera}", [name for _, name in names])
        self.assertIn("what has been taken of what is needed", [name for _, name in names])
        browser.wait_for("document.getElementById('words').className === 'good'", "it ends")
        self.assertRegex(browser.run("document.getElementById('words').textContent"), r"^Done, good: .*report\.html$")
        self.assertEqual(browser.run("document.getElementById('stale').textContent"), "")
        self.assertEqual(process.wait(timeout=WAIT_S), 0, read_text(self.said))
        self.assertEqual(browser.problems, [])

    def test_a_capture_that_is_gone_is_visibly_gone(self):
        process, port = self.open_capture()
        browser = self.browse(port)
        browser.wait_for("document.querySelectorAll('#pictures > div').length === 2", "it is there")
        process.send_signal(signal.SIGKILL)
        browser.wait_for("document.body.classList.contains('stale')", "it is grayed")
        self.assertRegex(browser.run("document.getElementById('stale').textContent"), r"^No word from the rig for \d+ s\.$")

    def test_the_rules_are_those_of_the_daemon(self):
        _, error = sightline(*self.arguments(self.rig(extra='[http]\naddress = "0.0.0.0"\n'), self.path("none"), "--page"), status=2)
        self.assertIn("open = true", error)
        self.assertFalse(os.path.exists(self.path("none", "corners.csv")))
        secret = self.write("tokens", "anna viewer 0123456789abcdef0123456789abcdef\n")
        os.chmod(secret, 0o600)
        process, port = self.open_capture(extra=f'[access]\ntokens = "{secret}"\n')

        def status(path="/", **headers):
            client = http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)
            client.request("GET", path, headers=headers)
            answer = client.getresponse()
            answer.read()
            client.close()
            return answer.status

        self.assertEqual(status(), 401)
        self.assertEqual(status("/api/v1/state"), 401)
        bearer = {"Authorization": "Bearer 0123456789abcdef0123456789abcdef"}
        self.assertEqual(status(**bearer), 200)
        self.assertEqual(status(Host="evil.example", **bearer), 403)
        # Another capture does not take the port from it.
        config = self.write("second.toml", f'[http]\nport = {port}\n[[camera]]\nname = "left"\nsource = "replay:{self.recording}"\n')
        _, error = sightline("calibrate", "capture", "--config", config, "--target", self.target(), "--out", self.path("second"),
                             "--page", status=3)
        self.assertIn("--page-port takes another", error)
        process.send_signal(signal.SIGINT)
        process.wait(timeout=WAIT_S)


if __name__ == "__main__":
    if not chromium():
        print("skipped: no chromium")
        sys.exit(77)
    unittest.main()
