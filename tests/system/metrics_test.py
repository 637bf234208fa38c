#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What /metrics says, against the tools of Prometheus where they are installed: histograms of every stage that add up,
the encoder in use, rules that hold, a dashboard that asks for what there is, and a real server that scrapes."""
import glob
import json
import os
import re
import shutil
import subprocess
import unittest
import urllib.parse
import urllib.request

from support import ROOT, WAIT_S, DaemonCase, fixed_port, read_text, wait_until

MONITORING = os.path.join(ROOT, "docs", "monitoring")
STAGES = ("captured", "observed", "fused", "drawn", "encoded", "sent")
HAS_PROMETHEUS = shutil.which("promtool") and shutil.which("prometheus")
# Families that are there only with a device, a recording or a fault of some kind.
SOMETIMES = {"sightline_recording", "sightline_source_lost_total"}


def families(text):
    return set(re.findall(r"^# TYPE (\S+)", text, re.MULTILINE))


class Metrics(DaemonCase):
    def watched(self):
        daemon = self.start()
        viewer = daemon.pull("left", frames=60)
        self.assertEqual(viewer.wait(timeout=WAIT_S), 0)
        return daemon

    def test_every_stage_of_a_watched_camera_has_a_histogram(self):
        daemon = self.watched()
        means = {}
        for stage in STAGES:
            labels = dict(camera="left", stage=stage)
            text = daemon.get("/metrics")
            pattern = rf'^sightline_latency_seconds_bucket{{camera="left",stage="{stage}",le="([^"]+)"}} (\d+)$'
            buckets = re.findall(pattern, text, re.MULTILINE)
            counts = [int(count) for _, count in buckets]
            bounds = [float(bound) for bound, _ in buckets]
            self.assertEqual(counts, sorted(counts), stage)
            self.assertEqual(bounds, sorted(bounds), stage)
            self.assertEqual(bounds[-1], float("inf"))
            total = daemon.metric("sightline_latency_seconds_count", **labels)
            self.assertGreater(total, 30, stage)
            self.assertGreater(total, counts[0] - 1)
            means[stage] = daemon.metric("sightline_latency_seconds_sum", **labels) / total
            self.assertGreaterEqual(means[stage], 0, stage)
        self.assertEqual(min(means, key=means.get), "captured")
        print("mean age [ms]: " + ", ".join(f"{stage} {1e3 * mean:.1f}" for stage, mean in means.items()))
        # Nobody watched this one.
        self.assertEqual(daemon.metric("sightline_latency_seconds_count", camera="right", stage="encoded"), 0)
        encoder = daemon.state()["cameras"][0]["encoder"]
        self.assertEqual(daemon.metric("sightline_encoder", camera="left", encoder=encoder), 1)
        self.assertGreater(daemon.metric("sightline_encoded_bytes_total", camera="left"), 10000)
        self.assertEqual(daemon.stop(), 0)

    def test_how_well_objects_are_known_and_how_full_queues_are(self):
        daemon = self.start()
        known = lambda name, **labels: daemon.find_metric(name, object="carton", **labels)
        wait_until(lambda: known("sightline_object_measured_by", camera="left") == 1, "left takes part")
        # Of one frame with few residuals it may be as small as it likes: over a second it is not.
        residuals = []
        def seen_for_a_second():
            residuals.append(known("sightline_object_residual_sigmas"))
            return len(set(residuals)) >= 10
        wait_until(seen_for_a_second, "the residuals of ten frames")
        self.assertTrue(0.05 < max(residuals) and min(residuals) > 0 and sorted(residuals)[len(residuals) // 2] < 5, residuals)
        self.assertTrue(1e-5 < known("sightline_object_sigma_meters") < 0.1)
        self.assertTrue(1e-5 < known("sightline_object_sigma_radians") < 0.5)
        # Three cameras at 30 Hz: within half a second something has waited.
        wait_until(lambda: daemon.metric("sightline_queue_depth", queue="fuse") >= 1, "observations wait")
        self.assertEqual(daemon.metric("sightline_queue_depth", queue="rec:viewing"), 0)
        self.assertIsNone(daemon.find_metric("sightline_queue_depth", queue="record"))
        self.assertEqual(daemon.stop(), 0)

    def asked_for(self):
        """Names of metrics in rules and dashboard."""
        rules = read_text(os.path.join(MONITORING, "alerts.yml"))
        dashboard = json.loads(read_text(os.path.join(MONITORING, "dashboard.json")))
        expressions = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
        self.assertGreater(len(expressions), 10)
        return set(re.findall(r"sightline_[a-z_]+", rules + " ".join(expressions)))

    def test_rules_and_dashboard_ask_for_what_there_is(self):
        daemon = self.watched()
        there = families(daemon.get("/metrics"))
        histograms = {name + end for name in there for end in ("_bucket", "_sum", "_count")}
        self.assertEqual(self.asked_for() - there - histograms - SOMETIMES, set())
        documented = read_text(os.path.join(ROOT, "docs", "operation.md"))
        short = {"sightline_measurements_gated_total", "sightline_measurements_late_total"}
        self.assertEqual([name for name in sorted(there - short) if f"`{name}" not in documented], [])

    @unittest.skipUnless(HAS_PROMETHEUS, "no prometheus on this machine (scripts/deps installs it)")
    def test_the_tools_of_prometheus_accept_it(self):
        daemon = self.watched()
        checked = subprocess.run(["promtool", "check", "metrics"], input=daemon.get("/metrics"), capture_output=True, text=True,
                                 timeout=WAIT_S, check=False)
        self.assertEqual((checked.returncode, checked.stdout + checked.stderr), (0, ""))
        for order in (["check", "rules", "alerts.yml"], ["test", "rules", "alerts_test.yml"], ["check", "config", "prometheus.yml"]):
            checked = subprocess.run(["promtool", *order], cwd=MONITORING, capture_output=True, text=True, timeout=WAIT_S, check=False)
            self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)

    @unittest.skipUnless(HAS_PROMETHEUS, "no prometheus on this machine (scripts/deps installs it)")
    def test_a_prometheus_scrapes_it(self):
        daemon = self.watched()
        config = read_text(os.path.join(MONITORING, "prometheus.yml"))
        config = config.replace("127.0.0.1:8080", f"127.0.0.1:{daemon.http}").replace("5s", "1s")
        for rules in glob.glob(os.path.join(MONITORING, "alerts.yml")):
            shutil.copy(rules, self.folder)
        port = fixed_port()
        with open(self.path("prometheus.log"), "w", encoding="utf-8") as log:
            server = subprocess.Popen(["prometheus", f"--config.file={self.write('prometheus.yml', config)}",
                                       f"--storage.tsdb.path={self.path('data')}", f"--web.listen-address=127.0.0.1:{port}"],
                                      stdout=log, stderr=log, cwd=self.folder)
        self.addCleanup(server.wait, timeout=WAIT_S)
        self.addCleanup(server.kill)

        def query(expression):
            address = f"http://127.0.0.1:{port}/api/v1/query?" + urllib.parse.urlencode({"query": expression})
            try:
                with urllib.request.urlopen(address, timeout=WAIT_S) as answer:
                    return [float(one["value"][1]) for one in json.load(answer)["data"]["result"]]
            except OSError:
                return []

        wait_until(lambda: query('up{job="sightline"}') == [1], "it is scraped")
        frames = 'histogram_quantile(0.5, sum by (camera, le) (rate(sightline_latency_seconds_bucket{stage="captured"}[10s])))'
        wait_until(lambda: len(query(frames)) == 3 and all(value < 1 for value in query(frames)), "quantiles come out")


if __name__ == "__main__":
    unittest.main(verbosity=2)
