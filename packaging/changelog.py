#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Debian's changelog of the tree, on standard output. The version is that of CMakeLists.txt. It is a release where the
newest release that CHANGELOG.md names is that one; otherwise it sorts before the release, and after older commits."""
import argparse
import datetime
import os
import re
import subprocess
import sys
from email.utils import format_datetime

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), ".."))
MAINTAINER = re.compile(r"(?m)^Maintainer: (.*)$")


def read(*names):
    with open(os.path.join(ROOT, *names), encoding="utf-8") as file:
        return file.read()


def project_version(text):
    return re.search(r"project\(sightline VERSION (\d+\.\d+\.\d+)\b", text).group(1)


def newest_release(text):
    """(version, date) of the newest release of a CHANGELOG.md, or None."""
    found = re.search(r"(?m)^## \[?(\d+\.\d+\.\d+)\]? - (\d{4}-\d\d-\d\d)$", text)
    return found and (found.group(1), datetime.datetime.fromisoformat(found.group(2) + "T12:00:00+00:00"))


def git(*arguments):
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def entry(version, changes, commit=None):
    """(version, date, what is new) of the package. `commit`: (name, time) of the tree, for what is no release."""
    release = newest_release(changes)
    if release and release[0] == version and "changed" not in (commit or [""])[0]:
        return version, release[1], "Release; CHANGELOG.md says what is new."
    name, time = commit
    stamp = time.strftime("%Y%m%d.%H%M%S")
    return f"{version}~{stamp}.{name}", time, "Not a release; CHANGELOG.md says what is new."


def changelog(version, date, news, maintainer):
    signature = f" -- {maintainer}  {format_datetime(date)}"
    return f"sightline ({version}) unstable; urgency=medium\n\n  * {news}\n\n{signature}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--version", action="store_true", help="only the version")
    asked = parser.parse_args()
    name, seconds = git("log", "-1", "--format=%h %ct", "--abbrev=8").split()
    if git("status", "--porcelain"):
        name += ".changed"
    commit = (name, datetime.datetime.fromtimestamp(int(seconds), datetime.timezone.utc))
    version, date, news = entry(project_version(read("CMakeLists.txt")), read("CHANGELOG.md"), commit)
    if asked.version:
        print(version)
        return 0
    sys.stdout.write(changelog(version, date, news, MAINTAINER.search(read("packaging", "debian", "control")).group(1)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
