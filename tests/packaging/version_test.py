#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""One version everywhere, what a build says of itself, what the packages are made from, and the shell's completion."""
import datetime
import json
import os
import re
import subprocess
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "system"))
from support import BIN, ROOT, WAIT_S, read_text, sightline  # noqa: E402

sys.path.insert(0, os.path.join(ROOT, "packaging"))
import changelog  # noqa: E402

COMMIT = ("0123abcd", datetime.datetime(2026, 11, 23, 15, 4, 5, tzinfo=datetime.timezone.utc))
# Debian's builders have these, or make no use of them.
NOT_FOR_PACKAGES = {"build-essential", "ccache", "cmake", "git", "ca-certificates"}


def daemon(*arguments, status=0):
    done = subprocess.run([os.path.join(BIN, "sightlined"), *arguments], capture_output=True, text=True, timeout=WAIT_S,
                          check=False)
    assert done.returncode == status, f"{arguments}: exit {done.returncode}\n{done.stderr}"
    return done.stdout


class Version(unittest.TestCase):
    def setUp(self):
        self.version = changelog.project_version(read_text(os.path.join(ROOT, "CMakeLists.txt")))

    def test_programs_and_pages_have_the_version_of_the_project(self):
        self.assertEqual(daemon("--version"), f"sightlined {self.version}\n")
        self.assertEqual(sightline("--version")[0], f"sightline {self.version}\n")
        short = self.version.rsplit(".", 1)[0]
        for page in ("sightline.1", "sightlined.8"):
            heading = read_text(os.path.join(ROOT, "docs", "man", page)).split("\n")[1]
            self.assertIn(f'"Sightline {short}"', heading)

    def test_the_changelog_has_no_release_newer_than_the_project(self):
        release = changelog.newest_release(read_text(os.path.join(ROOT, "CHANGELOG.md")))
        if release:
            def numbers(text):
                return tuple(map(int, text.split(".")))
            self.assertLessEqual(numbers(release[0]), numbers(self.version))

    def test_says_how_it_was_built(self):
        for arguments in (("--version", "--json"), ("--json", "--version")):
            said = json.loads(daemon(*arguments))
            self.assertEqual((said["program"], said["version"], said["api"]), ("sightlined", self.version, 1))
            self.assertEqual(set(said["options"]), {"aravis", "libcamera", "egl", "webrtc", "mqtt", "page"})
        cache = read_text(os.path.join(os.path.dirname(BIN), "CMakeCache.txt"))
        found = dict(re.findall(r"(?m)^(\w+):\w+=(.*)$", cache))
        for option, name in (("aravis", "ARAVIS"), ("libcamera", "LIBCAMERA"), ("egl", "EGL"),
                             ("webrtc", "GSTREAMER_WEBRTC"), ("mqtt", "MOSQUITTO")):
            self.assertEqual(said["options"][option], found.get(name + "_FOUND") == "1", option)
        self.assertEqual(said["build"]["type"], found["CMAKE_BUILD_TYPE"])

    def test_build_options_agree_with_what_is_linked(self):
        said = json.loads(daemon("--version", "--json"))["options"]
        libraries = subprocess.run(["ldd", os.path.join(BIN, "sightlined")], capture_output=True, text=True,
                                   timeout=WAIT_S, check=True).stdout
        for option, library in (("aravis", "libaravis-"), ("libcamera", "libcamera.so"), ("egl", "libEGL.so"),
                                ("webrtc", "libgstwebrtc-"), ("mqtt", "libmosquitto.so")):
            self.assertEqual(said[option], library in libraries, option)

    def test_json_alone_is_not_enough(self):
        daemon("--json", status=2)


class PackageVersion(unittest.TestCase):
    def test_a_commit_sorts_before_its_release_and_after_older_ones(self):
        version, date, _ = changelog.entry("0.2.0", "## Unreleased\n\n## 0.1.0 - 2026-10-01\n", COMMIT)
        self.assertEqual((version, date), ("0.2.0~20261123.150405.0123abcd", COMMIT[1]))
        older = changelog.entry("0.2.0", "", ("fedc", COMMIT[1] - datetime.timedelta(seconds=1)))[0]
        for low, high in ((version, "0.2.0"), (older, version), ("0.1.0", version)):
            done = subprocess.run(["dpkg", "--compare-versions", low, "lt", high], check=False, timeout=WAIT_S)
            self.assertEqual(done.returncode, 0, f"{low} < {high}")

    def test_a_release_has_its_own_date(self):
        changes = "# Changelog\n\n## Unreleased\n\n## [0.2.0] - 2026-12-01\n\n## 0.1.0 - 2026-10-01\n"
        version, date, news = changelog.entry("0.2.0", changes)
        self.assertEqual(version, "0.2.0")
        self.assertEqual(changelog.changelog(version, date, news, "A <a@b>").split("\n"), [
            "sightline (0.2.0) unstable; urgency=medium", "", "  * Release; CHANGELOG.md says what is new.", "",
            " -- A <a@b>  Tue, 01 Dec 2026 12:00:00 +0000", ""])

    def test_packages_are_built_with_what_the_tree_is_built_with(self):
        control = read_text(os.path.join(ROOT, "packaging", "debian", "control"))
        needs = re.search(r"(?ms)^Build-Depends:\n(.*?)^$", control).group(1)
        needs = {line.strip(" ,").split(" ")[0] for line in needs.splitlines()} - {"debhelper-compat", "cmake"}
        build = re.search(r"(?s)\nbuild=\((.*?)\)", read_text(os.path.join(ROOT, "scripts", "deps"))).group(1).split()
        self.assertEqual(needs, set(build) - NOT_FOR_PACKAGES)


class Completion(unittest.TestCase):
    def complete(self, *words):
        script = ('source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _sightline; '
                  'printf "%s\\n" "${COMPREPLY[@]}"')
        source = os.path.join(ROOT, "docs", "sightline.bash-completion")
        done = subprocess.run(["bash", "-c", script, "bash", source, *words], capture_output=True, text=True,
                              timeout=WAIT_S, check=True, cwd=ROOT,
                              env=dict(os.environ, PATH=BIN + ":" + os.environ["PATH"]))
        return done.stdout.split()

    def test_commands(self):
        self.assertEqual(self.complete("sightline", "repl"), ["replay"])
        self.assertEqual(self.complete("sightline", "calibrate", "so"), ["solve"])
        self.assertLessEqual({"check", "record", "calibrate"}, set(self.complete("sightline", "")))

    def test_options_of_the_command(self):
        self.assertEqual(self.complete("sightline", "replay", "--po"), ["--poses", "--points"])
        self.assertEqual(self.complete("sightline", "calibrate", "solve", "--tar"), ["--target"])
        self.assertEqual(self.complete("sightline", "check", "--po"), [])

    def test_files(self):
        self.assertEqual(self.complete("sightline", "check", "READ"), ["README.md"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
