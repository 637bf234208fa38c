// SPDX-License-Identifier: Apache-2.0
#include "cameras/sync_advice.hpp"

#include <fmt/format.h>

#include <cmath>

namespace sightline::cli {
namespace {

bool is_free(const SyncCamera& camera) {
  return camera.settings.trigger.empty() || camera.settings.trigger == "free";
}
bool on_line(const SyncCamera& camera) { return camera.settings.trigger.starts_with("Line"); }
bool on_action(const SyncCamera& camera) { return camera.settings.trigger.starts_with("Action"); }
bool follows_ptp(const SyncCamera& camera) {
  return camera.status && camera.status->ptp == "Slave";
}

void about_ptp(const SyncCamera& camera, std::vector<std::string>& advice) {
  if (!camera.aravis || !camera.settings.ptp || !camera.status) return;
  const std::string& state = camera.status->ptp;
  if (state == "Slave") {
    const double offset_us =
        static_cast<double>(std::abs(camera.status->ptp_offset_ns.value_or(0))) * 1e-3;
    advice.push_back(
        fmt::format("{}: its clock follows the PTP master, {:.1f} us off by its own "
                    "account",
                    camera.name, offset_us));
  } else if (state == "Master") {
    advice.push_back(
        fmt::format("{}: PTP is on, but the camera is the master itself: fine if the other one "
                    "follows it; else "
                    "run a master on this network (ptp4l on the host, or the switch)",
                    camera.name));
  } else {
    advice.push_back(fmt::format(
        "{}: PTP is on, its state is {}: no master has been heard yet. Run one on this network "
        "(ptp4l -i INTERFACE on the host, or the switch), let UDP ports 319 and 320 through, and "
        "wait some seconds",
        camera.name, state.empty() ? "not known" : state));
  }
}

// What hardware triggers need, seen from the camera that waits for one.
void about_line(const SyncCamera& waits, const SyncCamera& other, double rate, double other_rate,
                std::vector<std::string>& advice) {
  if (!on_line(waits)) return;
  const bool from_other = !other.settings.strobe.empty();
  const std::string source = from_other ? fmt::format("{}'s {}", other.name, other.settings.strobe)
                             : on_line(other) ? "the trigger that both wait for"
                                              : "what triggers it";
  if (rate <= 0) {
    advice.push_back(fmt::format(
        "{}: no frame, so no trigger came on {}: check the wire from {}, its ground, the level "
        "that "
        "the input needs, and trigger_edge{}",
        waits.name, waits.settings.trigger, source,
        from_other || on_line(other)
            ? ""
            : fmt::format("; {} has no strobe line set (strobe = \"Line2\")", other.name)));
  } else if (other_rate > 0 && std::abs(other_rate / rate - 2) < 0.1) {
    advice.push_back(fmt::format(
        "{}: it answers every second trigger: exposure and read-out take longer than the trigger's "
        "period. Shorten the exposure, make the region smaller, or slow the trigger down",
        waits.name));
  } else {
    advice.push_back(
        fmt::format("{}: triggered on {} by {}", waits.name, waits.settings.trigger, source));
  }
}

bool ptp_alone(const SyncCamera& a, const SyncCamera& b) {
  return is_free(a) && is_free(b) && follows_ptp(a) && follows_ptp(b);
}

}  // namespace

std::string sync_verdict(const SyncReport& report) {
  if (report.pairs < 5) return "unknown";
  if (std::abs(report.drift) > report.drift_error) return "drifting";
  // What cannot be told apart from a drift that a free camera would have is no proof.
  return report.drift_error < 5e-6 || std::abs(to_seconds(report.phase)) * 20 * report.rate_a_hz < 1
             ? "locked"
             : "unknown";
}

std::vector<std::string> sync_advice(const SyncCamera& a, const SyncCamera& b,
                                     const SyncReport& report) {
  std::vector<std::string> advice;
  for (const SyncCamera* camera : {&a, &b}) {
    if (!camera->problem.empty()) {
      advice.push_back(fmt::format("{}: {}", camera->name, camera->problem));
    }
    about_ptp(*camera, advice);
    if (camera->status && !camera->status->latched && camera->status->delivered > 0) {
      advice.push_back(fmt::format(
          "{}: the camera cannot be asked for its time, so the way of its images to here is only "
          "bounded: {:.1f} ms (transit_us, if you measured it)",
          camera->name, camera->exposure_error_ms));
    }
  }
  about_line(a, b, report.rate_a_hz, report.rate_b_hz, advice);
  about_line(b, a, report.rate_b_hz, report.rate_a_hz, advice);
  for (const SyncCamera* camera : {&a, &b}) {
    if (on_action(*camera) && camera->status && camera->status->delivered == 0) {
      advice.push_back(fmt::format(
          "{}: no action command reaches it: keys {}/{}, and [action] must send to the broadcast "
          "address of its subnet",
          camera->name, camera->settings.action.device_key, camera->settings.action.group_key));
    }
  }
  if (ptp_alone(a, b)) {
    advice.emplace_back(
        "PTP makes the clocks agree, not the exposures: for a fixed phase use a hardware trigger "
        "or "
        "action commands as well");
  } else if (is_free(a) && is_free(b)) {
    advice.push_back(
        fmt::format("both run freely{}: for a fixed phase let one trigger the other (strobe = "
                    "\"Line2\" on one, "
                    "trigger = \"Line1\" on the other, and a wire), or both by action commands "
                    "(docs/cameras.md)",
                    sync_verdict(report) == "drifting" && report.rate_a_hz > 0
                        ? fmt::format(", and pass through each other every {:.0f} s",
                                      1 / report.rate_a_hz / std::abs(report.drift))
                        : ""));
  } else if (is_free(a) != is_free(b) && a.settings.strobe.empty() && b.settings.strobe.empty()) {
    advice.push_back(fmt::format("{} runs freely and has no strobe: nothing ties it to {}",
                                 is_free(a) ? a.name : b.name, is_free(a) ? b.name : a.name));
  }
  advice.emplace_back("poses do not need this: each frame counts at its own time");
  return advice;
}

}  // namespace sightline::cli
