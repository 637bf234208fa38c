// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/stamps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/solve/refusals.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kStill = 10;         // [px/s], a target in a hand that holds it still
constexpr double kLeastSigmas = 6;    // of an offset, to be one
constexpr double kLeastEffect = 0.5;  // [px], what the offset does to the camera's corners
constexpr double kLeastGain = 0.95;   // RMS of the fit with offsets, of that without

/// RMS speed of the corners that a camera's part of the solution rests on [px/s].
double corner_speed(const CalibrationViews& views, const RigSolution& solution, size_t camera) {
  double sum = 0;
  size_t count = 0;
  for (size_t v = 0; v < views.views.size(); ++v) {
    if (views.views[v].camera != camera) continue;
    for (size_t i = 0; i < views.views[v].corners.size(); ++i) {
      if (!solution.used[v][i]) continue;
      sum += views.views[v].corners[i].px_per_s.squaredNorm();
      ++count;
    }
  }
  return count == 0 ? 0 : std::sqrt(sum / static_cast<double>(count));
}

}  // namespace

Status check_stamps(const CalibrationViews& views, const SolveOptions& options,
                    const RigSolution& solution) {
  if (options.time_offsets || views.cameras.size() < 2) return {};
  std::vector<double> speeds;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    speeds.push_back(corner_speed(views, solution, c));
  }
  if (*std::max_element(speeds.begin(), speeds.end()) < kStill) return {};
  SolveOptions with_offsets = options;
  with_offsets.time_offsets = true;
  const auto timed = resolve_rig(views, with_offsets, solution);
  if (!timed || timed->rms_px > kLeastGain * solution.rms_px) return {};
  size_t worst = 0;
  double most_px = 0, sigma_s = 0;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    for (const ParameterEstimate& e : timed->cameras[c].estimates) {
      const double effect_px = std::abs(e.value) * speeds[c];
      if (e.name != "time_offset_s" || std::abs(e.value) < kLeastSigmas * e.sigma) continue;
      if (effect_px < std::max(kLeastEffect, most_px)) continue;
      worst = c;
      most_px = effect_px;
      sigma_s = e.sigma;
    }
  }
  if (most_px == 0) return {};
  const double offset_ms = 1e3 * timed->cameras[worst].time_offset_s;
  return make_error(
      ErrorCode::kInvalidInput, camera_place(views, worst),
      "the target was in motion ({:.0f} px/s) and its images are taken {:.1f} ms +- {:.1f} {} than "
      "they are stamped, compared with {}: {:.1f} px in its corners. Hold the target still for "
      "each view, or have the offsets solved for as well (--time-offsets)",
      speeds[worst], std::abs(offset_ms), 1e3 * sigma_s, offset_ms > 0 ? "later" : "earlier",
      views.cameras[options.reference].name, most_px);
}

std::vector<std::string> readout_remarks(const CalibrationViews& views, const SolveOptions& options,
                                         const RigSolution& solution) {
  std::vector<std::string> remarks(views.cameras.size());
  std::vector<double> speeds;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    speeds.push_back(corner_speed(views, solution, c));
  }
  const bool still = *std::max_element(speeds.begin(), speeds.end()) < kStill;
  if (options.readouts || still) return remarks;
  SolveOptions with_readouts = options;
  with_readouts.readouts = true;
  const auto rolling = resolve_rig(views, with_readouts, solution);
  if (!rolling || rolling->rms_px > kLeastGain * solution.rms_px) return remarks;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    const ParameterEstimate& readout = rolling->cameras[c].estimates.back();
    // Of rows all over the image, next to the middle one.
    const double effect_px = std::abs(readout.value) * speeds[c] / std::sqrt(12.0);
    if (std::abs(readout.value) < kLeastSigmas * readout.sigma || effect_px < kLeastEffect)
      continue;
    remarks[c] = fmt::format(
        "its rows are exposed one after the other, the last one {:.1f} ms +- {:.1f} {} the first: "
        "have that solved for as well (--readouts)",
        1e3 * std::abs(readout.value), 1e3 * readout.sigma, readout.value > 0 ? "after" : "before");
  }
  return remarks;
}

}  // namespace sightline::calibrate
