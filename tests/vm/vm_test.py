#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs one test in a guest: packs what it needs, starts the guest and the cameras beside it.

vm_test.py NAME --bin FOLDER [--suite bookworm|trixie] [--keep FOLDER]
NAME is that of a script in guest_tests/. Exit status 77: skipped, with the reason; a rig that cannot start is
such a reason, anything that goes wrong in the guest is not.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
PREFIX = "/opt/sightline"
RIG_FAILED, TOO_LONG = 125, 124

# What a test takes along beside the programs, and how long it may take (seconds, software emulation on two
# busy cores; several times what it needs).
PRODUCT = ["sightlined", "sightline"]
TESTS = {
    "v4l2": {"script": "v4l2.sh", "programs": ["capture_probe"], "limit": 900},
    "usb": {"script": "usb.py", "programs": PRODUCT, "plugins": True, "limit": 3000},
    "u3v": {"script": "u3v.py", "programs": PRODUCT + ["capture_probe"], "plugins": True,
            "limit": 3000},
    "gige": {"script": "gige.py", "programs": ["capture_probe", "gige_simulator"], "tools": ["arv-fake-gv-camera-0.8"],
             "limit": 900},
    "libcamera": {"script": "libcamera.py", "programs": ["capture_probe"], "limit": 900},
}
# Elements of an H.264 stream and of its viewer.
PLUGINS = ["app", "coreelements", "rtp", "rtpmanager", "rtsp", "tcp", "typefindfunctions", "udp", "videoconvertscale",
           "videoparsersbad", "x264"]
# Of the C library the guest has its own, and it must fit the guest's loader.
NOT_TAKEN = re.compile(r"/(ld-linux.*|lib(c|m|dl|rt|pthread|resolv|nss_.*))\.so")


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(77)


def need(tool, package):
    if shutil.which(tool) is None:
        skip(f"{tool} is not installed (Debian: {package})")


def settings(expression, suite="bookworm"):
    """What config.sh says."""
    done = subprocess.run(["bash", "-c", f". '{HERE}/config.sh' && {expression}"], capture_output=True, text=True,
                          env=dict(os.environ, VMRIG_SUITE=suite), timeout=120, check=False)
    return done.stdout.strip()


def check_host(suite):
    if os.environ.get("SIGHTLINE_VM_TESTS") != "1":
        skip("takes minutes; SIGHTLINE_VM_TESTS=1 runs it, and so does scripts/test")
    need("qemu-system-x86_64", "qemu-system-x86")
    need("qemu-img", "qemu-utils")
    need("mke2fs", "e2fsprogs")
    for tool in ("cc", "ffmpeg", "cpio"):
        need(tool, tool)
    image = settings("vmrig_image_dir", suite)
    if not os.path.exists(os.path.join(image, "complete")):
        if os.geteuid() != 0:
            skip(f"the image of the {suite} guest is not built, and building it needs root: tests/vm/build-image.sh")
        need("debootstrap", "debootstrap")
        need("curl", "curl")


def trixie_build(programs):
    """Where build-trixie.sh has put the programs, and the tree of Debian 13 that they were built in."""
    folder = os.path.join(ROOT, "build", "trixie", "bin")
    if not all(os.path.exists(os.path.join(folder, program)) for program in programs):
        skip("nothing is built for Debian 13: tests/vm/build-trixie.sh does that, scripts/test with SIGHTLINE_VM_TRIXIE=1")
    if os.geteuid() != 0:
        skip("looking up Debian 13's libraries needs root")
    tree = subprocess.run([os.path.join(HERE, "build-trixie.sh"), "-l"], capture_output=True, text=True, timeout=60,
                          check=True).stdout.strip()
    return folder, tree


def libraries(paths, root):
    """What the dynamic linker loads for these files, by name. `root`: the tree of the other Debian that they are for."""
    found = {}
    for path in paths:
        command = ["ldd", path]
        if root:
            shutil.copy2(path, os.path.join(root, "tmp", "looked_at"))
            command = ["chroot", root, "ldd", "/tmp/looked_at"]
        listing = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
        for name, library in re.findall(r"(\S+) => (/\S+)", listing):
            if not NOT_TAKEN.search(library):
                found[name] = root + library
        if "not found" in listing:
            raise SystemExit(f"{path}: a library is missing:\n{listing}")
    return found


def plugin_folder():
    return subprocess.run(["pkg-config", "--variable=pluginsdir", "gstreamer-1.0"], capture_output=True, text=True,
                          timeout=60, check=True).stdout.strip()


def pack(test, programs, root, folder):
    """A file system image, mounted in the guest at PREFIX: programs, their libraries, unit, recording."""
    tree = os.path.join(folder, "tree")
    for name in ("bin", "lib", "gst"):
        os.makedirs(os.path.join(tree, name))
    for program in test["programs"]:
        shutil.copy2(os.path.join(programs, program), os.path.join(tree, "bin"))
    for tool in test.get("tools", []):
        need(tool, "aravis-tools")
        shutil.copy2(shutil.which(tool), os.path.join(tree, "bin"))
    if "sightlined" in test["programs"]:
        subprocess.run(["cmake", "-DCMAKE_INSTALL_PREFIX=" + PREFIX, "-P", "systemd/cmake_install.cmake"],
                       cwd=os.path.dirname(programs), env=dict(os.environ, DESTDIR=os.path.join(folder, "staged")),
                       stdout=subprocess.DEVNULL, timeout=60, check=True)
        shutil.copytree(os.path.join(folder, "staged" + PREFIX), tree, dirs_exist_ok=True)
        shutil.copytree(os.path.join(ROOT, "recordings", "bench", "objects"), os.path.join(tree, "objects"))
        shutil.copytree("/usr/share/fonts/truetype/dejavu", os.path.join(tree, "fonts", "truetype", "dejavu"))
    if test.get("plugins"):
        shutil.copy2(shutil.which("gst-launch-1.0"), os.path.join(tree, "bin"))
        for plugin in PLUGINS:
            shutil.copy2(os.path.join(plugin_folder(), f"libgst{plugin}.so"), os.path.join(tree, "gst"))
    binaries = [os.path.join(tree, part, name) for part in ("bin", "gst") for name in os.listdir(os.path.join(tree, part))]
    for name, library in libraries(binaries, root).items():
        shutil.copy2(library, os.path.join(tree, "lib", name))
    image = os.path.join(folder, "product")
    subprocess.run(["mke2fs", "-q", "-F", "-t", "ext4", "-O", "^has_journal", "-m", "0", "-d", tree, image,
                    settings("echo $VMRIG_EXTRA_MB") + "M"], stdout=subprocess.DEVNULL, timeout=300, check=True)
    shutil.rmtree(tree)
    return image


def make_cameras(folder):
    """The emulated cameras, and images for those that send MJPEG."""
    for kind in ("uvc", "u3v"):
        subprocess.run(["cc", "-std=gnu11", "-O2", "-Wall", "-Wextra", "-o", os.path.join(folder, "fake-" + kind),
                        os.path.join(HERE, "fakecams", f"fake-{kind}.c")], timeout=120, check=True)
    images = os.path.join(folder, "images")
    os.mkdir(images)
    subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-f", "lavfi", "-i", "testsrc=size=320x180:rate=10",
                    "-frames:v", "10", "-pix_fmt", "yuvj422p", "-q:v", "5", os.path.join(images, "%02d.jpg")],
                   timeout=120, check=True)
    peer = os.path.join(folder, "peer")
    with open(peer, "w", encoding="utf-8") as file:
        file.write(f"exec {sys.executable} '{HERE}/shelf.py' '{folder}' '{images}'\n")
    return peer


def show(path, lines):
    if os.path.exists(path):
        with open(path, encoding="utf-8", errors="replace") as file:
            print(f"-- {os.path.basename(path)}\n" + "".join(file.readlines()[-lines:]), flush=True)


def run(name, programs, root, suite, folder):
    test = TESTS[name]
    os.makedirs(os.path.join(folder, "in"))
    disk = pack(test, programs, root, folder)
    peer = make_cameras(folder)
    for script in os.listdir(os.path.join(HERE, "guest_tests")):
        if script.endswith((".py", ".sh")):
            shutil.copy2(os.path.join(HERE, "guest_tests", script), os.path.join(folder, "in"))
    out = os.path.join(folder, "out")
    interpreter = "python3" if test["script"].endswith(".py") else "bash"
    environment = [f"SIGHTLINE_VM_SUITE={suite}"] + [
        f"{key}={value}" for key, value in os.environ.items() if key.startswith("SIGHTLINE_VM_")]
    status = subprocess.run([os.path.join(HERE, "run-in-guest.sh"), "-s", suite, "-t", str(test["limit"]), "-i",
                             os.path.join(folder, "in"), "-o", out, "-p", peer, "--", "env", *environment, interpreter,
                             "/vmrig/in/" + test["script"]], check=False,
                            env=dict(os.environ, VMRIG_EXTRA_DISK=disk), timeout=test["limit"] + 900).returncode
    if status not in (0, 77):
        show(os.path.join(out, "journal.txt"), 60)
        show(os.path.join(out, "dmesg.txt"), 20)
    if status == RIG_FAILED:
        show(os.path.join(out, "console.txt"), 20)
        skip("the guest did not start or stopped by itself; see above")
    if status == TOO_LONG:
        print("the test did not end in time")
    return status


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("name", choices=sorted(TESTS))
    parser.add_argument("--bin", default=os.path.join(ROOT, "build", "release", "bin"), help="the programs under test")
    parser.add_argument("--suite", default="bookworm")
    parser.add_argument("--trixie-build", action="store_true", help="the programs are those that build-trixie.sh made")
    parser.add_argument("--keep", help="work in this folder and leave everything there")
    given = parser.parse_args()
    check_host(given.suite)
    programs, root = os.path.abspath(given.bin), ""
    if given.trixie_build:
        programs, root = trixie_build(TESTS[given.name]["programs"])
    if given.keep:
        shutil.rmtree(given.keep, ignore_errors=True)
        os.makedirs(given.keep)
        return run(given.name, programs, root, given.suite, os.path.abspath(given.keep))
    with tempfile.TemporaryDirectory(prefix="sightline_vm.") as folder:
        return run(given.name, programs, root, given.suite, folder)


if __name__ == "__main__":
    sys.exit(main())
