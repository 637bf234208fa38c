#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline doctor`: on this host, and on hosts whose dev, proc and sys are made for it."""
import json
import os
import shutil
import subprocess
import unittest

from support import BIN, WAIT_S, TemporaryFolder, sightline


class Doctor(TemporaryFolder):
    def put(self, name, text=""):
        os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
        self.write(name, text)

    def findings(self, status=None, command=()):
        """(subject, state, text) of everything found on the host that was made."""
        done = subprocess.run([*command, os.path.join(BIN, "sightline"), "doctor", "--json", "--root", self.folder],
                              capture_output=True, text=True, timeout=WAIT_S, check=False)
        said = json.loads(done.stdout)
        self.assertEqual(done.returncode, 0 if said["ok"] else 3)
        if status is not None:
            self.assertEqual(done.returncode, status, done.stdout)
        return [(f["subject"], f["state"], f["text"]) for f in said["findings"]]

    def of(self, subject, found):
        return [entry[1:] for entry in found if entry[0] == subject]

    def test_this_host(self):
        out, _ = sightline("doctor", status=None)
        for line in out.splitlines():
            self.assertRegex(line, "^(good|advice|wrong) +(devices|usb|network|temperature|clock|encoder) +[^ ]")
        self.assertRegex(out, r"good +encoder +\w+ encodes H.264")

    def test_a_host_in_order(self):
        self.put("dev/video0")
        self.put("proc/sys/net/core/rmem_max", "33554432\n")
        self.put("sys/class/net/eth0/mtu", "9000\n")
        self.put("sys/class/net/eth0/device/vendor")
        self.put("sys/class/net/lo/mtu", "1400\n")  # no device, so no matter
        self.put("sys/class/thermal/thermal_zone0/temp", "41000\n")
        self.put("sys/class/thermal/thermal_zone0/type", "cpu\n")
        self.put("sys/class/thermal/thermal_zone0/trip_point_0_type", "passive\n")
        self.put("sys/class/thermal/thermal_zone0/trip_point_0_temp", "85000\n")
        found = self.findings(status=0)
        self.assertEqual({state for subject, state, _ in found if subject != "clock"}, {"good"}, found)
        self.assertIn(("good", "/dev/video0 may be used"), self.of("devices", found))
        self.assertEqual(len(self.of("network", found)), 2)
        self.assertIn("41 degrees; from 85", self.of("temperature", found)[0][1])

    def test_small_buffers_and_packets_are_advice(self):
        self.put("proc/sys/net/core/rmem_max", "212992\n")
        self.put("sys/class/net/eth0/mtu", "1500\n")
        self.put("sys/class/net/eth0/device/vendor")
        found = self.of("network", self.findings(status=0))
        self.assertEqual([state for state, _ in found], ["advice", "advice"])
        self.assertIn("208 KiB", found[0][1])
        self.assertIn("net.core.rmem_max=33554432", found[0][1])
        self.assertIn("ip link set eth0 mtu 9000", found[1][1])

    def test_too_hot(self):
        zone = "sys/class/thermal/thermal_zone0/"
        for name, text in (("temp", "91000"), ("type", "package"), ("trip_point_0_type", "active"),
                           ("trip_point_0_temp", "50000"), ("trip_point_1_type", "passive"),
                           ("trip_point_1_temp", "90000")):
            self.put(zone + name, text + "\n")
        self.put("sys/devices/system/cpu/cpu1/thermal_throttle/core_throttle_count", "17\n")
        hot, throttled = self.of("temperature", self.findings(status=3))
        self.assertEqual(hot[0], "wrong")
        self.assertIn("91 degrees; from 90", hot[1])
        self.assertIn("17 times", throttled[1])

    def usb_camera(self, device, kind, subclass="01", speed="480"):
        for name, text in ((f"{device}/busnum", "1"), (f"{device}/speed", speed),
                           (f"{device}:1.0/bInterfaceClass", kind), (f"{device}:1.0/bInterfaceSubClass", subclass)):
            self.put("sys/bus/usb/devices/" + name, text + "\n")

    def test_usb_memory_matters_for_usb3_vision_only(self):
        self.put("sys/module/usbcore/parameters/usbfs_memory_mb", "16\n")
        self.usb_camera("1-1", "0e")
        self.assertEqual(self.of("usb", self.findings(status=0)), [])
        self.usb_camera("2-1", "ef", "05", speed="5000")
        (state, text), = self.of("usb", self.findings(status=3))
        self.assertEqual(state, "wrong")
        self.assertIn("usbfs_memory_mb=1000", text)
        self.put("sys/module/usbcore/parameters/usbfs_memory_mb", "1000\n")
        self.assertEqual(self.of("usb", self.findings(status=0))[0][0], "good")

    def test_cameras_that_share_a_slow_bus(self):
        self.usb_camera("1-1", "0e")
        self.usb_camera("1-2", "0e", speed="5000")
        self.assertEqual(self.of("usb", self.findings(status=0)), [])
        self.usb_camera("1-3", "0e")
        (state, text), = self.of("usb", self.findings(status=0))
        self.assertEqual(state, "advice")
        self.assertIn("2 cameras share", text)

    def test_a_camera_that_this_user_may_not_open(self):
        if os.geteuid() != 0 or not shutil.which("setpriv"):
            self.skipTest("cannot become another user")
        self.put("dev/video0")
        os.chmod(self.path("dev/video0"), 0o660)
        os.chmod(self.folder, 0o755)
        other = ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups")
        if subprocess.run([*other, os.path.join(BIN, "sightline"), "--version"], capture_output=True, timeout=WAIT_S,
                          check=False).returncode != 0:
            self.skipTest("another user may not run the program")
        (state, text), = self.of("devices", self.findings(status=3, command=other))
        self.assertEqual(state, "wrong")
        self.assertRegex(text, "belongs to the group root: usermod")

    def test_what_cannot_be_read_is_left_out(self):
        self.put("proc/sys/net/core/rmem_max", "many\n")
        self.put("sys/class/net/eth0/mtu")
        self.put("sys/class/thermal/thermal_zone0/temp", "99999999999999999999\n")
        found = self.findings(status=0)
        self.assertEqual({subject for subject, _, _ in found} - {"clock"}, {"devices", "encoder"})


if __name__ == "__main__":
    unittest.main(verbosity=2)
