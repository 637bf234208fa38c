// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <numbers>
#include <optional>

#include "calibrate/calibrate_commands.hpp"
#include "calibrate/solve_arguments.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/axes_report.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/pipeline/turning/head_recordings.hpp"

namespace sightline::cli {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

struct AxesCommandOptions {
  std::vector<std::filesystem::path> recordings;
  std::vector<std::filesystem::path> targets;
  std::filesystem::path calibration, out;
  std::string camera, lens = "hold", scales = "auto", world = "cameras";
  HeadRecordingsOptions views;
  AxesOptions solve;
  bool json = false;
};

Result<HeadSights> look(const AxesCommandOptions& o, const CalibrationTarget& target,
                        const std::vector<CalibratedCamera>& calibration) {
  HeadRecordingsOptions options = o.views;
  options.camera = o.camera;
  std::optional<ProgressBar> bar;
  options.on_progress = [&](size_t done, size_t total) {
    if (done == 1) bar.emplace("target", total);
    bar->set(done);
  };
  return sights_of_head(o.recordings, target, calibration, options);
}

void print(const AxesSolution& s, const AxesReport& r) {
  fmt::print("{} settings at rest, {} left out; {} images in motion; world: {}\n", r.at_rest,
             s.settings_left_out, r.in_motion, s.world);
  fmt::print("{} corners in the fit, {} left out; RMS {:.4f} px\n", s.corners, s.rejected,
             s.rms_px);
  if (r.held_out_px) {
    fmt::print("held out: {:.3f} px, {:.4f} deg, {:.2f} mm at {:.2f} m\n", *r.held_out_px,
               *r.held_out_deg, *r.held_out_mm, r.distance);
  }
  fmt::print("readings: {:.4f} deg from setting to setting (one sigma)\n",
             s.reading_sigma / kDegree);
  fmt::print("{:<38} {:>14} {:>12}\n", "parameter", "value", "one sigma");
  for (const AxesEstimate& e : s.estimates) {
    const bool valued = e.value != 0 || !e.held.empty();
    fmt::print("{:<38} {:>14} {:>12}{}{}\n", e.name,
               valued ? fmt::format("{:.5g} {}", e.value, e.unit) : "",
               e.sigma > 0 ? fmt::format("{:.2g} {}", e.sigma, e.unit) : "held",
               e.held.empty() ? "" : "  ", e.held);
  }
  for (const std::string& remark : r.remarks) fmt::print("{}: {}\n", s.camera.name, remark);
}

/// The reports first: the calibration is what others wait for.
Result<std::string> write(const AxesCommandOptions& o, std::vector<CalibratedCamera> calibration,
                          const AxesSolution& solution, const AxesReport& report) {
  for (CalibratedCamera& camera : calibration) {
    if (camera.name == o.camera) camera = solution.camera;
  }
  const std::string text = format_calibration(calibration);
  const std::string epoch = fmt::format("{:016x}", content_hash(text));
  std::error_code error;
  std::filesystem::create_directories(o.out, error);
  if (error) {
    return make_error(ErrorCode::kIo, o.out.string(), "cannot make it: {}", error.message());
  }
  SL_RETURN_IF_ERROR(
      write_file_atomically(o.out / "axes_report.json", axes_report_json(solution, report, epoch)));
  SL_RETURN_IF_ERROR(
      write_file_atomically(o.out / "axes_report.html", axes_report_html(solution, report, epoch)));
  SL_RETURN_IF_ERROR(write_calibration(o.out / "calibration.toml", calibration));
  return epoch;
}

Status run(const AxesCommandOptions& o) {
  SL_ASSIGN(const auto calibration, read_calibration(o.calibration));
  std::error_code error;
  if (std::filesystem::equivalent(o.out / "calibration.toml", o.calibration, error)) {
    return make_error(ErrorCode::kInvalidInput, "--out",
                      "{} has the calibration that is read: name another folder", o.out.string());
  }
  SL_ASSIGN(const CalibrationTarget target, read_targets(o.targets));
  SL_ASSIGN(const HeadSights sights, look(o, target, calibration));
  AxesOptions options = o.solve;
  options.refine_lens = o.lens == "refine";
  options.scales = o.scales == "hold"   ? AxesScales::kHold
                   : o.scales == "free" ? AxesScales::kFree
                                        : AxesScales::kAuto;
  options.world_of_target = o.world == "target";
  SL_ASSIGN(const AxesSolution solution, solve_axes(sights, calibration, options));
  const AxesReport report = assess_axes(solution);
  SL_ASSIGN(const std::string epoch, write(o, calibration, solution, report));
  if (o.json) {
    fmt::print("{}", axes_report_json(solution, report, epoch));
    return {};
  }
  print(solution, report);
  fmt::print("written: {}/calibration.toml, axes_report.html, axes_report.json\n", o.out.string());
  return {};
}

}  // namespace

void add_calibrate_axes(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<AxesCommandOptions>();
  auto* command = parent.add_subcommand("axes",
                                        "axes, scales, play, latency and zoom of a camera on a pan "
                                        "and tilt head, from recordings of a "
                                        "target that stands still while the head turns");
  command
      ->add_option(
          "RECORDING", options->recordings,
          "recordings of the camera with the angles of its head (axes.csv); the target may "
          "be elsewhere in each")
      ->required();
  command->add_option("--camera", options->camera, "the camera on the head")->required();
  command
      ->add_option("--calibration", options->calibration,
                   "calibration.toml with its lens, and with the cameras that stand still")
      ->required();
  command
      ->add_option("--target", options->targets,
                   "target file; may be repeated: further boards, and tags that stand in the room "
                   "(fixed = true, world_from_target where their place is known)")
      ->required()
      ->allow_extra_args(false);
  command
      ->add_option("--out", options->out,
                   "folder for calibration.toml, axes_report.html and axes_report.json")
      ->required();
  command->add_option("--lens", options->lens, "hold (default) the lens, or refine it, too")
      ->check(CLI::IsMember({"hold", "refine"}));
  command->add_flag("--zoom", options->solve.zoom,
                    "make a zoom table: settings at two or more values of the zoom");
  command
      ->add_option(
          "--scales", options->scales,
          "angle per reading: free, solved for; hold, readings are degrees, only their signs "
          "are found; auto (default): free, and 1 where it may be that and the lens is solved "
          "for, too")
      ->check(CLI::IsMember({"auto", "free", "hold"}));
  command
      ->add_option("--world", options->world,
                   "cameras (default): that of the cameras that stand still and of known targets; "
                   "target: that of the first target, its print up")
      ->check(CLI::IsMember({"cameras", "target"}));
  command
      ->add_option("--corner-window", options->views.window,
                   "half side of the window in which corners are refined [px] (default: from the "
                   "size of the squares)")
      ->check(CLI::Range(1, 50));
  command->add_option("--every", options->views.every, "look at every N-th image of a camera")
      ->check(CLI::PositiveNumber);
  command->add_flag("--json", options->json, "print the report as JSON");
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = run(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
