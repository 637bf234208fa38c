#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The page for everybody: axe finds no error in any of its looks (light, dark, phone width, with something wrong, with a
camera large), where axe-core is installed (npm install --prefix build/npm axe-core); and without it every control has a
name, every text enough contrast, and the keyboard reaches all that a mouse does."""
import os
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from browser import Browser, chromium  # noqa: E402
from support import BENCH, ROOT, DaemonCase, installation, read_text  # noqa: E402

NODE_MODULES = os.environ.get("SIGHTLINE_NODE_MODULES", os.path.join(ROOT, "build", "npm", "node_modules"))
AXE = os.path.join(NODE_MODULES, "axe-core", "axe.min.js")
RULES = "['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice']"
FAULTS = f"axe.run(document, {{ runOnly: {RULES} }}).then((result) => result.violations.map((one) =>" \
         " one.id + ': ' + one.help + ' at ' + one.nodes.map((node) => node.target.join(' ') + ' ' + node.failureSummary).join('; ')))"

# Texts whose color is too near to the ground that they stand on (WCAG 2.1, 1.4.3: 4.5, large ones 3).
CONTRAST = """(() => {
  const parse = (text) => (text.match(/[\\d.]+/g) ?? []).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const color = parse(getComputedStyle(at).backgroundColor);
      if (color.length === 3 || color[3] > 0.7) return color;
    }
    return [255, 255, 255];
  };
  const wrong = [];
  let seen = 0;
  for (const element of document.querySelectorAll('body *')) {
    const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!own || !element.checkVisibility() || element.disabled || element.tagName === 'NOSCRIPT') continue;
    const style = getComputedStyle(element), size = parseFloat(style.fontSize);
    const [a, b] = [light(parse(style.color)), light(ground(element))].sort((x, y) => y - x), ratio = (a + 0.05) / (b + 0.05);
    ++seen;
    if (ratio < (size >= 24 || (size >= 18.66 && style.fontWeight >= 700) ? 3 : 4.5)) {
      wrong.push(`${element.textContent.slice(0, 30)}: ${ratio.toFixed(2)}`);
    }
  }
  return seen < 20 ? ['only ' + seen + ' texts'] : wrong;
})()"""
CONTROLS = ("button", "link", "checkbox", "combobox", "textbox", "image", "img", "article", "region", "list")


class Accessibility(DaemonCase):
    def judge(self, browser, look):
        self.assertEqual(browser.run(CONTRAST), [], look)
        nameless = [entry for entry in browser.accessible_names() if entry[0] in CONTROLS[:-1] and not entry[1]]
        self.assertEqual(nameless, [], look)
        ids = browser.run("[...document.querySelectorAll('[id]')].map((e) => e.id)")
        self.assertEqual(len(ids), len(set(ids)), look)
        if os.path.exists(AXE):
            if not browser.run("'axe' in window"):
                browser.run(read_text(AXE) + "; undefined")
            self.assertEqual(browser.run(FAULTS), [], look)

    def open(self, daemon, query, **options):
        browser = Browser(**options)
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{daemon.http}/{query}")
        browser.wait_for("document.querySelectorAll('.chip.good').length >= 4", "it is live")
        browser.wait_for("document.querySelectorAll('#overlay input').length > 5", "the overlay is there")
        browser.wait_for("document.querySelectorAll('.places li').length === 3", "so is the calibration")
        return browser

    def full(self):
        os.mkdir(self.path("recordings"))
        self.write("report.html", "<p>report</p>")
        path = self.write("calibration.toml", read_text(f"{BENCH}/calibration.toml"))
        return installation(extra=f'[record]\ndirectory = "{self.path("recordings")}"\n[[zone]]\nname = "here"\n'
                                  'min = [-2, -2, -2]\nmax = [2, 2, 2]\n').replace(f"{BENCH}/calibration.toml", path)

    def test_in_light_dark_and_on_a_phone(self):
        daemon = self.start(self.full())
        for query, options in (("?theme=light", {}), ("?theme=dark", {}), ("?theme=light&webgl=off", {"width": 390, "height": 844}),
                               ("?theme=dark", {"width": 390, "height": 844})):
            browser = self.open(daemon, query, **options)
            self.judge(browser, query + str(options))
            self.assertLessEqual(browser.run("document.documentElement.scrollWidth"), options.get("width", 1280))
            browser.close()

    def test_with_something_wrong_and_in_use(self):
        text = self.full()
        daemon = self.start(text)
        for theme in ("light", "dark"):
            browser = self.open(daemon, f"?theme={theme}")
            browser.run("document.querySelector('[data-kind=viewing]').click()")
            browser.run("document.querySelector('[data-object=carton] .do button').click()")
            browser.run("document.querySelector('[data-camera=right] button').click()")
            browser.wait_for("/Stop viewing/.test(document.querySelector('[data-kind=viewing]').textContent)", "it records")
            browser.wait_for("document.querySelectorAll('.recordings a').length > 0", "it is listed")
            self.judge(browser, theme + ", in use")
            browser.run("document.querySelector('[data-kind=viewing]').click()")
            self.assertFalse(self.reload(daemon, "nonsense = 1"))
            browser.wait_for("/was refused/.test(document.getElementById('banner').textContent)", "it is told")
            browser.wait_for("/nonsense/.test(document.querySelector('#configuration .problem').textContent)", "and why")
            self.judge(browser, theme + ", refused")
            browser.close()
            self.assertTrue(self.reload(daemon, text))

    def test_the_keyboard_reaches_everything(self):
        browser = self.open(self.start(self.full()), "?theme=light")
        wanted = browser.run("[...document.querySelectorAll('button, select, input, a[href], [tabindex=\"0\"]')]"
                             ".filter((e) => e.checkVisibility() && !e.disabled).map((e) => (e.dataset.tab = 'no', 1)).length")
        self.assertGreater(wanted, 25)
        for _ in range(wanted + 2):
            browser.key("Tab", 9)
            browser.run("document.activeElement.dataset.tab = 'yes'")
        self.assertEqual(browser.run("[...document.querySelectorAll('[data-tab=no]')].filter((e) => e.checkVisibility() && !e.disabled)"
                                     ".map((e) => e.outerHTML.slice(0, 80))"), [])


if __name__ == "__main__":
    if chromium() is None:
        print("skipped: no chromium on this machine (scripts/deps installs it)")
        sys.exit(77)
    if not os.path.exists(AXE):
        print("axe-core is not installed: its own judgment is left out")
    unittest.main(verbosity=2)
