#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The simulator is a GigE Vision camera to programs that know nothing of it: Aravis' own tools.

tools_test.py SIMULATOR. Exits 77 without the tools or without a namespace.
"""
import os
import re
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from gige import ADDRESSES, WAIT_S, Simulator, enter_namespace  # noqa: E402

SIMULATOR = ""


def tool(name, *arguments):
    done = subprocess.run([name, *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=2 * WAIT_S, check=False)
    return done.stdout + done.stderr


class Tools(unittest.TestCase):
    def simulator(self, *options, **settings):
        camera = Simulator(SIMULATOR, ADDRESSES[0], "--serial", "S1", "--width", 320, "--height", 240, "--rate", 20,
                           *options, **settings)
        self.addCleanup(camera.close)
        return camera

    def camera_test(self, *arguments):
        """arv-camera-test for two seconds: its counters."""
        text = tool("arv-camera-test-0.8", "-n", ADDRESSES[0], "--duration", 2, *arguments)
        counters = {name: int(value) for name, value in re.findall(r"(n_\w+)\s*= (\d+)", text)}
        self.assertIn("n_completed_buffers", counters, text)
        return counters

    def test_arv_tool_finds_and_reads_it(self):
        self.simulator("--user-name", "left")
        self.assertIn("Simulated-Simulator-S1 (127.0.0.2)", tool("arv-tool-0.8"))
        values = tool("arv-tool-0.8", "-a", ADDRESSES[0], "values")
        for expected in ("'DeviceSerialNumber' = 'S1'", "'DeviceUserID' = 'left'", "'Width' = 320",
                         "'PixelFormat' = 'Mono8'", "'GevTimestampTickFrequency' = 1000000000",
                         "'PtpStatus' = 'Disabled'", "'PayloadSize' = 76800"):
            self.assertIn(expected, values)

    def test_arv_tool_sets_features(self):
        self.simulator()
        text = tool("arv-tool-0.8", "-a", ADDRESSES[0], "control", "PixelFormat=Mono12p", "PayloadSize", "Width=64",
                    "ExposureTime=1234.5", "ExposureTime", "PayloadSize")
        self.assertIn("PayloadSize = 115200", text)
        self.assertIn("PayloadSize = 23040", text)
        self.assertIn("ExposureTime = 1234.5", text)

    def test_arv_test_passes(self):
        self.simulator()
        with tempfile.NamedTemporaryFile("w", suffix=".cfg") as configuration:
            configuration.write("[Simulated:Simulator]\nSensorSize=320;240\nChunksSupport=true\n"
                                "ChunkList=Timestamp FrameID\nSoftwareTriggerSupport=true\n")
            configuration.flush()
            text = tool("arv-test-0.8", "-c", configuration.name)
        self.assertNotIn("FAILURE", text)
        for test in ("Genicam:Load", "SingleAcquisition:BufferCheck", "SoftwareTrigger:BufferCheck",
                     "MultipleAcquisitionB:BufferCheck", "Chunks:BufferCheck", "GigEVision:StreamChannel"):
            self.assertRegex(text, test + r"\s+SUCCESS")

    def test_arv_camera_test_streams(self):
        self.simulator()
        for arguments in ((), ("--no-packet-socket",), ("--chunks", "ExposureTime,FrameID,Timestamp"), ("-i", "8000"),
                          ("-o", "10")):
            with self.subTest(arguments):
                counters = self.camera_test(*arguments)
                self.assertGreater(counters["n_completed_buffers"], 5)
                self.assertEqual(counters["n_failures"], 0)

    def test_lost_packets_are_sent_again(self):
        camera = self.simulator(loss=0.01)
        counters = self.camera_test("--packet-timeout", "5", "--initial-packet-timeout", "1")
        self.assertGreater(counters["n_resent_packets"], 0)
        self.assertGreater(counters["n_completed_buffers"], 5)
        camera.set("resend", 0)
        self.assertGreater(self.camera_test()["n_failures"], 0)
        camera.set("resend", 2)
        self.assertGreater(self.camera_test()["n_error_packets"], 0)

    def test_long_frame_numbers_and_duplicates(self):
        camera = self.simulator("--first-id", 2**32 - 10, extended_ids=1, duplicate=0.05)
        counters = self.camera_test()
        self.assertGreater(counters["n_completed_buffers"], 5)
        self.assertEqual(counters["n_missing_frames"], 0)
        self.assertGreater(counters["n_duplicated_packets"], 0)
        camera.set("pending", 3)  # answers that take a while
        self.assertIn("Width = 320", tool("arv-tool-0.8", "-a", ADDRESSES[0], "control", "Width"))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    enter_namespace("arv-tool-0.8", "arv-camera-test-0.8", "arv-test-0.8")
    SIMULATOR = sys.argv.pop(1)
    unittest.main(verbosity=2)
