// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solved_rig.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "calibration/capture_files.hpp"

namespace sightline::cli {
namespace {

void print(const RigSolution& solution, const RigReport& report) {
  fmt::print("{} corners in the fit, {} left out; RMS {:.6f} px\n", solution.corners,
             solution.rejected, solution.rms_px);
  if (report.held_out_px) fmt::print("held out: {:.4f} px\n", *report.held_out_px);
  if (report.rigidity) {
    fmt::print("lengths on the target: {:.3f} mm RMS ({:.3f} mm of neighbors), scale {:.5f}\n",
               report.rigidity->rms_mm, report.rigidity->adjacent_mm, report.rigidity->scale);
  }
  fmt::print("{:<12} {:>6} {:>9} {:>9} {:>9} {:>8} {:>9} {:>9} {:>10}\n", "camera", "views",
             "fit px", "held px", "half mm", "half deg", "half px", "offset ms", "readout ms");
  const auto text = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.3f}", *value) : std::string("-");
  };
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    const CameraReport& r = report.cameras[c];
    const SolvedCamera& s = solution.cameras[c];
    const auto half = [&](double SplitHalf::*member) {
      return r.split_half ? std::optional<double>((*r.split_half).*member) : std::nullopt;
    };
    fmt::print("{:<12} {:>6} {:>9.3f} {:>9} {:>9} {:>8} {:>9} {:>9.1f} {:>10.1f}\n", r.name,
               s.views, s.camera.rms_px, text(r.held_out_px), text(half(&SplitHalf::center_mm)),
               text(half(&SplitHalf::rotation_deg)), text(half(&SplitHalf::median_px)),
               1e3 * s.time_offset_s, 1e3 * s.camera.readout_s);
  }
  for (const CameraReport& r : report.cameras) {
    for (const std::string& remark : r.remarks) fmt::print("{}: {}\n", r.name, remark);
  }
}

}  // namespace

void print_solved(const CalibrationViews& views, const SolvedRig& solved, bool json,
                  const std::filesystem::path& folder) {
  if (json) {
    fmt::print(
        "{}", report_json(views, solved.solution, solved.report, epoch_of(views, solved.solution)));
    return;
  }
  print(solved.solution, solved.report);
  fmt::print("written: {}/calibration.toml, report.html, report.json, corners.csv\n",
             folder.string());
}

Result<size_t> reference_camera(const CalibrationViews& views, const std::string& name) {
  if (name.empty()) return size_t{0};
  const auto found = std::ranges::find(views.cameras, name, &ViewedCamera::name);
  if (found != views.cameras.end()) return static_cast<size_t>(found - views.cameras.begin());
  return make_error(ErrorCode::kInvalidInput, "--reference", "no camera '{}' took part", name);
}

}  // namespace sightline::cli
