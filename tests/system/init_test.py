#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline init`: what it writes is checked by the other programs, and a daemon runs with it."""
import json
import os
import shutil
import subprocess
import tomllib
import unittest

from support import BENCH, BIN, WAIT_S, Daemon, TemporaryFolder, installation, read_text, sightline, wait_until


def mode(pixels, width, height, *rates):
    return {"format": pixels, "width": width, "height": height, "rates_hz": list(rates)}


def device(source, *formats, where="/dev/video0, usb:1-1", note="", model="Webcam", serial="A1"):
    return {"source": source, "model": model, "serial": serial, "where": where, "formats": list(formats), "note": note}


USB_WEBCAM = device("v4l2:/dev/v4l/by-id/usb-A-index0", mode("YUYV", 640, 480, 15, 30, 60), mode("YUYV", 1280, 720, 5, 10),
                    mode("MJPEG", 1280, 720, 15, 30, 60), mode("MJPEG", 1920, 1080, 15, 30, 60))


class Init(TemporaryFolder):
    def setUp(self):
        super().setUp()
        os.environ["XDG_CACHE_HOME"] = self.path("cache")
        self.out = self.path("sightline.toml")

    def init(self, *arguments, status=0):
        return sightline("init", "--out", self.out, *arguments, status=status)

    def written(self):
        """The installation as any TOML reader sees it, held to the strict one before."""
        sightline("check", self.out)
        return tomllib.loads(read_text(self.out))

    def listing(self, *devices):
        return self.write("listing.json", json.dumps({"cameras": devices, "notes": []}))

    def from_listing(self, *devices, arguments=()):
        self.init("--listing", self.listing(*devices), "--force", *arguments)
        return self.written()["camera"]

    def run_daemon(self):
        """With ports that are free."""
        text = read_text(self.out)
        for section in ("rtsp", "http"):
            self.assertIn(f"[{section}]\n", text)
            text = text.replace(f"[{section}]\n", f"[{section}]\nport = 0\n")
        daemon = Daemon(self.folder, self.write("with_ports.toml", text))
        self.addCleanup(daemon.close)
        daemon.wait_for_word("READY=1")
        return daemon

    def test_a_recording_is_measured_at_once(self):
        self.init("--recording", BENCH)
        cameras = self.written()["camera"]
        self.assertEqual([camera["name"] for camera in cameras], ["left", "right", "side"])
        self.assertTrue(all("role" not in camera for camera in cameras))
        daemon = self.run_daemon()
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the carton is tracked")
        self.assertEqual(daemon.pull("left", frames=3).wait(timeout=WAIT_S), 0)
        self.assertEqual(daemon.stop(), 0)

    def test_single_cameras_of_recordings(self):
        self.init("--camera", f"left={os.path.join('replay:' + BENCH)}", "--camera", f"side=replay:{BENCH}")
        self.assertEqual([camera["name"] for camera in self.written()["camera"]], ["left", "side"])
        _, err = self.init("--camera", f"top=replay:{BENCH}", "--force", status=2)
        self.assertIn("left, right, side", err)

    def test_an_installation_is_not_written_over_its_object(self):
        mesh = os.path.join(BENCH, "objects", "carton.obj")
        shutil.copy(mesh, self.path("carton.obj"))
        self.out = self.path("carton.toml")
        _, err = self.init("--recording", BENCH, "--mesh", self.path("carton.obj"), "--unit", "m", status=2)
        self.assertIn("choose another --out", err)
        self.assertFalse(os.path.exists(self.path("carton.toml")))

    def test_a_network_camera_is_asked_for_its_size(self):
        source = Daemon(self.folder, self.write("source.toml", installation(cameras=("left",))))
        self.addCleanup(source.close)
        source.wait_for_word("READY=1")
        address = f"rtsp://127.0.0.1:{source.rtsp}/left"
        self.init("--camera", f"yard={address}")
        camera = self.written()["camera"][0]
        self.assertEqual((camera["name"], camera["source"], camera["width"], camera["height"]), ("yard", address, 640, 480))
        # Nobody calibrated it, so nothing may be measured with it.
        self.assertEqual(camera["role"], "stream")
        os.mkdir(self.path("rig"))
        self.folder, parent = self.path("rig"), self.folder
        shutil.copy(os.path.join(parent, "sightline.guess.toml"), self.folder)
        rig = self.run_daemon()
        wait_until(lambda: rig.state()["cameras"][0]["present"], "it is shown")
        self.assertEqual(rig.pull("yard", frames=3).wait(timeout=WAIT_S), 0)
        self.assertEqual(rig.stop(), 0)
        # Another size than it sends is no use.
        _, err = self.init("--camera", f"yard={address}", "--size", "1280x720", "--force", status=2)
        self.assertIn("640x480", err)

    def test_a_network_camera_that_is_away_needs_a_size(self):
        wish = ("--camera", "yard=rtsp://viewer:secret@127.0.0.1:9/live")
        _, err = self.init(*wish, status=3)
        self.assertIn("--size yard=", err)
        self.assertNotIn("secret", err)
        self.assertFalse(os.path.exists(self.out))
        self.init(*wish, "--size", "yard=1280x720")
        self.assertEqual(self.written()["camera"][0]["width"], 1280)

    def test_formats_are_chosen_with_a_reason(self):
        camera, = self.from_listing(USB_WEBCAM)
        self.assertEqual([camera[key] for key in ("source", "format", "width", "height", "rate")],
                         ["v4l2:/dev/v4l/by-id/usb-A-index0", "MJPEG", 1280, 720, 30])
        self.assertIn("# The largest images up to 1280x720 at 30 Hz; compressed, since", read_text(self.out))
        camera, = self.from_listing(USB_WEBCAM, arguments=("--size", "640x480"))
        self.assertEqual((camera["format"], camera["width"], camera["rate"]), ("YUYV", 640, 30))
        self.assertIn("# The size that was asked for at 30 Hz; in color without compression.", read_text(self.out))
        camera, = self.from_listing(device("v4l2:/dev/video2", mode("GREY", 1280, 720, 30), mode("NV12", 1280, 720, 30),
                                           mode("NV12", 1920, 1080, 30), where="/dev/video2"))
        self.assertEqual((camera["format"], camera["width"]), ("NV12", 1280))
        camera, = self.from_listing(device("v4l2:/dev/video2", mode("YUYV", 640, 480, 10), mode("YUYV", 320, 240, 15)))
        self.assertEqual((camera["width"], camera["rate"]), (640, 10))
        self.assertIn(", only at 10 Hz", read_text(self.out))
        camera, = self.from_listing(device("aravis:Vendor-1", mode("Mono8", 2448, 2048, 1, 35.5), where="10.0.0.3",
                                           *[mode("BayerRG12Packed", 2448, 2048, 1, 35.5), mode("BayerRG8", 2448, 2048, 1, 35.5)]))
        self.assertEqual((camera["format"], camera["width"], camera["rate"]), ("BayerRG8", 2448, 30))
        _, err = self.init("--listing", self.listing(USB_WEBCAM), "--size", "641x480", "--force", status=2)
        self.assertIn("640x480, 1280x720, 1920x1080", err)

    def test_a_camera_is_listed_once(self):
        twin = device(r"libcamera:\_SB_.PCI0.XHC_.RHUB.HS01-1:1.0-046d:0825", mode("YUYV", 640, 480), where="libcamera")
        self.assertEqual(len(self.from_listing(USB_WEBCAM, twin)), 1)
        self.assertIn("the same as one of v4l2's", read_text(self.out))
        self.assertEqual(self.from_listing(twin)[0]["source"], twin["source"])  # backslashes survive
        sensor = device("libcamera:/base/soc/i2c0mux/i2c@1/imx708@1a", mode("NV12", 1280, 720, 5, 120), where="libcamera")
        node = device("v4l2:/dev/video0", mode("SRGGB10P", 4608, 2592), where="/dev/video0")
        cameras = self.from_listing(sensor, node, USB_WEBCAM)
        self.assertEqual([camera["source"] for camera in cameras], [sensor["source"], USB_WEBCAM["source"]])

    def test_what_devices_say_cannot_break_the_file(self):
        camera, = self.from_listing(device("v4l2:/dev/v4l/by-id/usb-\"x\"", mode("YUYV", 640, 480, 30),
                                           model="Cam\nname = 3\n[rtsp]\x7f\\\"", serial="\u00e9"))
        self.assertEqual(camera["source"], 'v4l2:/dev/v4l/by-id/usb-"x"')

    def test_a_mesh_needs_its_unit(self):
        mesh = self.path("part.obj")
        shutil.copy(os.path.join(BENCH, "objects", "carton.obj"), mesh)
        _, err = self.init("--recording", BENCH, "--mesh", mesh, status=2)
        for line in ("--unit m ", "--unit mm", "it is 0.16 x"):
            self.assertIn(line, err)
        self.assertFalse(os.path.exists(self.out))
        self.init("--listing", self.listing(USB_WEBCAM), "--mesh", mesh, "--unit", "m")
        self.assertEqual(self.written()["object"], [{"file": "part.toml"}])
        self.assertEqual(tomllib.loads(read_text(self.path("part.toml"))), {"name": "part", "mesh": "part.obj", "unit": "m"})
        daemon = self.run_daemon()
        self.assertEqual(daemon.state()["objects"][0]["state"], "searching")
        self.assertFalse(daemon.state()["cameras"][0]["present"])  # nothing is plugged in here
        self.assertEqual(daemon.stop(), 0)

    def test_a_calibration_is_used(self):
        calibration = os.path.join(BENCH, "calibration.toml")
        listing = self.listing(USB_WEBCAM)
        self.write("cam1.toml", read_text(calibration).replace('"left"', '"cam1"'))
        _, err = self.init("--listing", listing, "--calibration", self.path("cam1.toml"), status=2)
        self.assertIn("--size cam1=640x480", err)
        self.init("--listing", listing, "--calibration", self.path("cam1.toml"), "--size", "640x480")
        written = self.written()
        self.assertEqual(written["calibration"], "cam1.toml")
        self.assertNotIn("role", written["camera"][0])

    def test_nothing_is_overwritten(self):
        self.write("sightline.toml", "mine")
        _, err = self.init("--recording", BENCH, status=2)
        self.assertIn("--force", err)
        self.assertEqual(read_text(self.out), "mine")
        os.unlink(self.out)
        self.write("sightline.guess.toml", "mine")
        self.init("--listing", self.listing(USB_WEBCAM), status=2)
        self.assertEqual(read_text(self.path("sightline.guess.toml")), "mine")
        self.assertFalse(os.path.exists(self.out))
        self.init("--listing", self.listing(USB_WEBCAM), "--force")
        self.written()

    def test_without_a_camera(self):
        _, err = self.init("--listing", self.listing(), status=2)
        for hint in ("no camera was found", "sightline doctor", "--camera"):
            self.assertIn(hint, err)
        _, err = self.init("--listing", self.listing(device("v4l2:/dev/video0", note="no permission")), status=2)
        self.assertIn("v4l2:/dev/video0: no permission", err)
        self.assertFalse(os.path.exists(self.out))

    def test_this_host(self):
        """Whatever is plugged in here: a file that holds, or the error that says that there is nothing."""
        cameras = json.loads(sightline("cameras", "--json")[0])["cameras"]
        _, err = self.init(status=None)
        if os.path.exists(self.out):
            self.written()
        else:
            self.assertTrue("no camera was found" in err or cameras, err)

    def test_wrong_usage(self):
        listing = self.listing(USB_WEBCAM)
        for arguments in (["--camera", "nothing"], ["--size", "big", "--listing", listing], ["--unit", "mm"],
                          ["--camera", "a=nonsense"], ["--camera", f"a b=replay:{BENCH}"], ["--listing", self.write("x", "{}")],
                          ["--recording", "/nowhere"], ["--listing", listing, "--mesh", self.path("no.obj"), "--unit", "m"]):
            self.init(*arguments, status=2)
            self.assertFalse(os.path.exists(self.out), arguments)


if __name__ == "__main__":
    assert os.access(os.path.join(BIN, "sightline"), os.X_OK)
    subprocess.run(["ffmpeg", "-version"], check=True, stdout=subprocess.DEVNULL)
    unittest.main(verbosity=2)
