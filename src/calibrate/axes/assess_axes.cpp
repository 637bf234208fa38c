// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/calibrate/axes_report.hpp"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kGoodPx = 1, kNotGoodPx = 3;  // held out
constexpr double kGoodPlaceMm = 5;             // one sigma, at a meter
constexpr double kGoodFocal = 0.005;
constexpr double kGoodShareLeftOut = 0.25;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::optional<double> rms_of(const AxesSolution& solution,
                             std::optional<double> SolvedSetting::*member) {
  double squares = 0, count = 0;
  for (const SolvedSetting& s : solution.settings) {
    if (!(s.*member)) continue;
    squares += *(s.*member) * *(s.*member);
    ++count;
  }
  return count > 0 ? std::optional(std::sqrt(squares / count)) : std::nullopt;
}

void measure(const AxesSolution& solution, AxesReport& r) {
  std::vector<double> directions, places, distances;
  double squares = 0;
  r.pan_from_deg = r.tilt_from_deg = 1e9;
  r.pan_to_deg = r.tilt_to_deg = -1e9;
  for (const SolvedSetting& s : solution.settings) {
    if (!s.used) continue;
    if (s.moving) {
      ++r.in_motion;
      squares +=
          s.angle_error_deg[0] * s.angle_error_deg[0] + s.angle_error_deg[1] * s.angle_error_deg[1];
      continue;
    }
    ++r.at_rest;
    r.pan_from_deg = std::min(r.pan_from_deg, s.pan_deg);
    r.pan_to_deg = std::max(r.pan_to_deg, s.pan_deg);
    r.tilt_from_deg = std::min(r.tilt_from_deg, s.tilt_deg);
    r.tilt_to_deg = std::max(r.tilt_to_deg, s.tilt_deg);
    const Eigen::Vector2d sigma = solution.place_sigma(s.pan_deg * kDegree, s.tilt_deg * kDegree);
    directions.push_back(sigma[0] / kDegree);
    places.push_back(1e3 * sigma[1]);
    if (s.held_out_mm && *s.held_out_deg > 0) {
      distances.push_back(1e-3 * *s.held_out_mm / (*s.held_out_deg * kDegree));
    }
  }
  r.direction_deg = median(directions);
  r.place_mm = median(places);
  if (!directions.empty()) {
    r.direction_worst_deg = std::ranges::max(directions);
    r.place_worst_mm = std::ranges::max(places);
  }
  r.distance = median(distances);
  r.motion_deg = r.in_motion > 0 ? std::sqrt(squares / static_cast<double>(2 * r.in_motion)) : 0;
}

void lower(AxesReport& r, CalibrationGrade grade, std::string remark) {
  r.grade = std::max(r.grade, grade);
  r.remarks.push_back(std::move(remark));
}

void judge_fit(const AxesSolution& solution, AxesReport& r) {
  if (r.held_out_px && *r.held_out_px > kNotGoodPx) {
    lower(
        r, CalibrationGrade::kNotGood,
        fmt::format("settings that were left out are {:.1f} px off: does the target stand firmly, "
                    "does the head come to rest at each setting, is the lens right (--lens "
                    "refine)?",
                    *r.held_out_px));
  } else if (r.held_out_px && *r.held_out_px > kGoodPx) {
    lower(r, CalibrationGrade::kUsable,
          fmt::format("settings that were left out are {:.2f} px off: more of them, at rest for a "
                      "second each",
                      *r.held_out_px));
  }
  if (!solution.lens_refined && solution.rms_px > 1) {
    lower(r, CalibrationGrade::kUsable,
          fmt::format("corners are {:.2f} px off with the lens as it was given: --lens refine",
                      solution.rms_px));
  }
  double focal = 0;  // of it, one sigma
  for (size_t l = 0; l < solution.lens_sigmas.size(); ++l) {
    const auto& zoom = solution.camera.axes->zoom;
    focal =
        std::max(focal, solution.lens_sigmas[l].fx /
                            (zoom.empty() ? solution.camera.model.parameters().fx : zoom[l].fx));
  }
  if (focal > kGoodFocal) {
    // A camera before or behind its axes shows what a longer or shorter lens does.
    lower(r, CalibrationGrade::kUsable,
          fmt::format(
              "the focal length is known to {:.1f} % only (one sigma): another recording with "
              "the target at half or twice the distance tells it from how far the camera "
              "stands off its axes",
              100 * focal));
  }
  const double all = static_cast<double>(r.at_rest + solution.settings_left_out);
  if (static_cast<double>(solution.settings_left_out) > kGoodShareLeftOut * all) {
    lower(r, CalibrationGrade::kNotGood,
          fmt::format("{} of {} settings do not agree with the others and were left out: what the "
                      "head says is not where it is",
                      solution.settings_left_out, all));
  } else if (solution.settings_left_out > 0) {
    r.remarks.push_back(
        fmt::format("{} of {} settings do not agree with the others and were left "
                    "out (red)",
                    solution.settings_left_out, all));
  }
  const double turned = 1e3 * r.direction_worst_deg * kDegree * r.distance;
  if (r.place_worst_mm > kGoodPlaceMm * std::max(1.0, r.distance) ||
      turned > kGoodPlaceMm * r.distance) {
    lower(
        r, CalibrationGrade::kUsable,
        fmt::format("in the world the camera's place is known to {:.1f} mm and its direction to "
                    "{:.2f} deg only (one sigma): the target nearer or larger, tilted, at several "
                    "places, seen by more cameras that stand still",
                    r.place_worst_mm, r.direction_worst_deg));
  }
}

void judge_readings(const AxesSolution& solution, AxesReport& r) {
  for (const AxesEstimate& e : solution.estimates) {
    if (e.held.empty()) continue;
    if (e.name == "latency" && e.sigma == 0 && e.value <= 0 && r.in_motion == 0) {
      lower(r, CalibrationGrade::kUsable, "latency is not known: " + e.held);
    } else if (e.name == "latency") {
      r.remarks.push_back("latency is held: " + e.held);
    } else if (e.name.starts_with("play")) {
      r.remarks.push_back(e.name + " is not known: " + e.held);
    }
  }
  const double scatter = solution.reading_sigma / kDegree;
  if (scatter > 0.1) {
    lower(r, CalibrationGrade::kUsable,
          fmt::format("the readings are {:.2f} degrees off from setting to setting (one sigma): a "
                      "loose axis, play, or a head that did not come to rest",
                      scatter));
  }
}

}  // namespace

AxesReport assess_axes(const AxesSolution& solution) {
  AxesReport r;
  measure(solution, r);
  r.held_out_px = rms_of(solution, &SolvedSetting::held_out_px);
  r.held_out_deg = rms_of(solution, &SolvedSetting::held_out_deg);
  r.held_out_mm = rms_of(solution, &SolvedSetting::held_out_mm);
  judge_fit(solution, r);
  judge_readings(solution, r);
  r.remarks.insert(r.remarks.end(), solution.remarks.begin(), solution.remarks.end());
  const std::string range = fmt::format(
      "readings of pan from {:.1f} to {:.1f} and of tilt from "
      "{:.1f} to {:.1f} degrees",
      r.pan_from_deg, r.pan_to_deg, r.tilt_from_deg, r.tilt_to_deg);
  std::string verdict = "not good: do not use it";
  if (r.grade != CalibrationGrade::kNotGood) {
    verdict = fmt::format(
        "{} at {}: what was left out is predicted to {:.3f} deg, {:.2f} mm at {:.2f} m; in the "
        "world "
        "its direction is known to {:.3f} deg and its place to {:.1f} mm (one sigma)",
        r.grade == CalibrationGrade::kGood ? "good" : "usable", range, r.held_out_deg.value_or(0),
        r.held_out_mm.value_or(0), r.distance, r.direction_worst_deg, r.place_worst_mm);
  }
  r.remarks.insert(r.remarks.begin(), verdict);
  return r;
}

}  // namespace sightline
