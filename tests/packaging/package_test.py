#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Debian packages: built twice, judged by lintian, installed, run, upgraded and purged. Only where
SIGHTLINE_PACKAGE_TESTS=1, as root. The programs are those of the build tree; SIGHTLINE_PACKAGE_COMPILE=1 compiles them
with the package's flags, twice. The root is this system's under an overlay; SIGHTLINE_PACKAGE_ROOT names the folder
of a clean one (mmdebstrap), which then gets what the package depends on from its mirror."""
import glob
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "system"))
from support import BIN, ROOT, WAIT_S, read_text  # noqa: E402

COMPILE = os.environ.get("SIGHTLINE_PACKAGE_COMPILE") == "1"
LOWER = os.environ.get("SIGHTLINE_PACKAGE_ROOT", "/")
BUILD_S = 7200 if COMPILE else 900
# What dpkg, ldconfig and man keep of any package, and fontconfig for root; the service may not write there.
KEPT_BY_DPKG = re.compile(r"^/(var/lib/(dpkg|apt|ucf)|var/log|etc/ld\.so\.cache|"
                          r"var/cache/(apt|man|ldconfig|debconf|fontconfig))(/|$)")


def missing():
    if os.environ.get("SIGHTLINE_PACKAGE_TESTS") != "1":
        return "SIGHTLINE_PACKAGE_TESTS=1 is not set"
    for program in ("dpkg-buildpackage", "dh", "dpkg-deb", "lintian", "nsenter"):
        if not shutil.which(program):
            return f"no {program}: scripts/deps --package"
    if os.geteuid() != 0:
        return "not root"
    return None


def build(folder, tree):
    """The packages of this tree, by name."""
    environment = dict(os.environ)
    if not COMPILE:
        environment["SIGHTLINE_PREBUILT"] = os.path.dirname(BIN)
    subprocess.run([os.path.join(ROOT, "scripts", "package"), "--out", folder, "--tree", os.path.join(folder, tree)],
                   check=True, timeout=BUILD_S, env=environment, stdout=subprocess.DEVNULL)
    return {os.path.basename(path).split("_")[0]: path for path in glob.glob(os.path.join(folder, "*.deb"))}


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


class Overlay:
    """A root to install into: another one's files under an overlay in memory, in a mount namespace of its own. What was
    written shows in `upper`."""

    SCRIPT = """
    mount -t tmpfs none "$1" && mkdir "$1/upper" "$1/work" "$1/merged" &&
    mount -t overlay overlay "-olowerdir=$2,upperdir=$1/upper,workdir=$1/work" "$1/merged" &&
    mount -t proc proc "$1/merged/proc" && mount --bind /dev "$1/merged/dev" && mount -t tmpfs none "$1/merged/tmp" &&
    mount -t tmpfs none "$1/merged/run" &&
    mount --bind "$3" "$1/merged/mnt" &&
    { [ "$2" = / ] || mount --bind /etc/resolv.conf "$1/merged/etc/resolv.conf" || true; } &&
    echo mounted && exec sleep 3600
    """

    def __init__(self, packages):
        self.folder = tempfile.mkdtemp(prefix="sightline_root.")
        self.holder = subprocess.Popen(["unshare", "--mount", "--propagation", "private", "sh", "-c", self.SCRIPT, "sh",
                                        self.folder, LOWER, packages], stdout=subprocess.PIPE, text=True)
        self.mounted = self.holder.stdout.readline() == "mounted\n"

    def enter(self, *command, inside=True):
        prefix = ["nsenter", "--target", str(self.holder.pid), "--mount"]
        return prefix + (["chroot", os.path.join(self.folder, "merged")] if inside else []) + list(command)

    def run(self, *command, inside=True, timeout=WAIT_S):
        done = subprocess.run(self.enter(*command, inside=inside), capture_output=True, text=True, timeout=timeout,
                              check=False, env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL": "C.UTF-8",
                                                "DEBIAN_FRONTEND": "noninteractive", "HOME": "/tmp"})
        assert done.returncode == 0, f"{command}: exit {done.returncode}\n{done.stdout}{done.stderr}"
        return done.stdout

    def shell(self, script, timeout=WAIT_S):
        return self.run("sh", "-euc", script, timeout=timeout)

    def install(self, path):
        path = "/mnt/" + os.path.basename(path)
        if LOWER == "/":
            self.run("dpkg", "--install", path, timeout=4 * WAIT_S)
        else:
            self.run("apt-get", "install", "--yes", "--no-install-recommends", path, timeout=20 * WAIT_S)

    def written(self):
        """Files and links that differ from the root's, without what dpkg itself keeps."""
        upper = os.path.join(self.folder, "upper")
        out = self.run("find", upper, "(", "-type", "f", "-o", "-type", "l", ")", "-printf", "/%P\\n", inside=False)
        return {path for path in out.splitlines() if not KEPT_BY_DPKG.match(path)}

    def close(self):
        self.holder.kill()
        self.holder.wait(timeout=WAIT_S)
        self.holder.stdout.close()
        os.rmdir(self.folder)


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="sightline_package.", dir=os.path.dirname(os.path.dirname(BIN)))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.first = os.path.join(cls.folder, "first")
        cls.packages = build(cls.first, "tree")

    def test_two_builds_in_different_folders_give_the_same_bytes(self):
        again = build(os.path.join(self.folder, "second"), "another_tree")
        self.assertEqual(set(again), set(self.packages))
        self.assertLessEqual({"sightline", "sightline-doc"}, set(again))
        for name, path in self.packages.items():
            self.assertEqual(digest(path), digest(again[name]), name)

    def test_lintian_finds_nothing(self):
        done = subprocess.run(["lintian", "--allow-root", "--fail-on", "error,warning",
                               self.packages["sightline"], self.packages["sightline-doc"]],
                              capture_output=True, text=True, timeout=BUILD_S, check=False)
        self.assertEqual((done.returncode, done.stdout), (0, ""), done.stderr)

    def test_no_path_of_the_build_is_in_the_packages(self):
        if not COMPILE:
            self.skipTest("the programs were not built with the package's flags")
        out = os.path.join(self.folder, "unpacked")
        subprocess.run(["dpkg-deb", "-x", self.packages["sightline"], out], check=True, timeout=WAIT_S)
        for program in ("sightline", "sightlined"):
            with open(os.path.join(out, "usr", "bin", program), "rb") as file:
                self.assertNotIn(self.folder.encode(), file.read(), program)

    def newer(self):
        """The same package under a newer version and with a changed example: what an upgrade brings."""
        tree, path = os.path.join(self.folder, "newer"), os.path.join(self.first, "newer.deb")
        subprocess.run(["dpkg-deb", "-R", self.packages["sightline"], tree], check=True, timeout=WAIT_S)
        control = os.path.join(tree, "DEBIAN", "control")
        text = re.sub(r"(?m)^(Version: .*)$", r"\1+1", read_text(control))
        with open(control, "w", encoding="utf-8") as file:
            file.write(text)
        subprocess.run(["dpkg-deb", "-Zgzip", "-z1", "-b", tree, path], check=True, timeout=WAIT_S,
                       stdout=subprocess.DEVNULL)
        return path

    def test_installed_run_upgraded_and_purged(self):
        newer = self.newer()
        root = Overlay(self.first)
        self.addCleanup(root.close)
        if not root.mounted:
            self.skipTest("no overlay may be mounted here")
        if LOWER != "/":  # what it depends on stays, so that only its own trace is judged
            root.run("apt-get", "update", timeout=4 * WAIT_S)
            root.run("apt-get", "install", "--yes", "--no-install-recommends", "curl", timeout=4 * WAIT_S)
            root.install(self.packages["sightline"])
            root.run("dpkg", "--purge", "sightline")
        before = root.written()

        root.install(self.packages["sightline"])
        root.shell("test ! -e /etc/sightline/sightline.toml; test -f /etc/sightline/sightline.example.toml")
        # No configuration: the condition of the unit does not hold; in the template neither.
        unit = root.shell("cat /lib/systemd/system/sightlined.service")
        self.assertIn("ConditionPathExists=|/etc/sightline/sightline.toml\n", unit)
        self.assertIn("ExecStart=/usr/bin/sightlined ", unit)
        if shutil.which("systemd-analyze"):
            for name in ("sightlined.service", "sightlined@cell-4.service"):
                root.run("systemd-analyze", "verify", "--man=no", name)
        print(root.run("sh", "/mnt/tree/debian/tests/plays-recording", timeout=2 * WAIT_S).strip(), file=sys.stderr)

        root.shell("""
            sed 's|"replay:../|"replay:/usr/share/sightline/|; s|"\\.\\./|"/usr/share/sightline/|' \
                /usr/share/sightline/config/demo.toml >/etc/sightline/sightline.toml
            echo '# mine' >>/etc/sightline/sightline.example.toml
            mkdir -p /var/lib/private/sightline /var/cache/private/sightline /var/lib/private/sightline-b
            ln -s private/sightline /var/lib/sightline
            ln -s private/sightline-b /var/lib/sightline-b
            echo x >/var/lib/private/sightline-b/last_poses_1.csv
            echo x >/var/lib/private/sightline/last_poses_1.csv
            ln -s private/sightline /var/cache/sightline
            echo x >/var/lib/private/sightline/proposed_calibration_2.toml
            echo x >/var/cache/private/sightline/views
            sightline record --config /etc/sightline/sightline.toml --seconds 1 /var/lib/sightline/monday
            sightlined --version --json | grep -q '"webrtc": true'""", timeout=2 * WAIT_S)
        mine = root.shell("cat /etc/sightline/sightline.toml")
        root.install(newer)
        self.assertEqual(root.shell("cat /etc/sightline/sightline.toml"), mine)
        self.assertIn("# mine", root.shell("cat /etc/sightline/sightline.example.toml"))

        root.run("dpkg", "--remove", "sightline")
        root.shell("test -e /var/lib/private/sightline/last_poses_1.csv; test ! -e /usr/bin/sightlined")
        root.run("dpkg", "--purge", "sightline")
        left = root.written() - before
        recording = {path for path in left if path.startswith("/var/lib/private/sightline/monday/")}
        self.assertIn("/var/lib/private/sightline/monday/recording.toml", recording)
        self.assertIn("/var/lib/private/sightline/monday/left.mkv", recording)
        self.assertEqual(left - recording, {"/etc/sightline/sightline.toml", "/var/lib/sightline"})
        root.run("ls", "/var/lib/sightline/monday/recording.toml")  # the way to it stays, too


if __name__ == "__main__":
    reason = missing()
    if reason:
        print("skipped: " + reason)
        sys.exit(77)
    unittest.main(verbosity=2)
