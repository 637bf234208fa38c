// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>

#include "calibrate/calibrate_commands.hpp"
#include "calibrate/solve_arguments.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline::cli {
namespace {

struct SolveCommandOptions {
  ViewArguments views;
  std::vector<std::string> models;
  std::filesystem::path intrinsics;
  std::filesystem::path out = "calibration";
  std::string reference;
  bool json = false;
  SolveOptions solve;
};

std::vector<CalibratedCamera> cameras_of(const RigSolution& solution) {
  std::vector<CalibratedCamera> cameras;
  for (const SolvedCamera& solved : solution.cameras) cameras.push_back(solved.camera);
  return cameras;
}

void print(const RigSolution& solution, const RigReport& report) {
  fmt::print("{} corners in the fit, {} left out; RMS {:.6f} px\n", solution.corners,
             solution.rejected, solution.rms_px);
  if (report.held_out_px) fmt::print("held out: {:.4f} px\n", *report.held_out_px);
  if (report.rigidity) {
    fmt::print("lengths on the target: {:.3f} mm RMS ({:.3f} mm of neighbors), scale {:.5f}\n",
               report.rigidity->rms_mm, report.rigidity->adjacent_mm, report.rigidity->scale);
  }
  fmt::print("{:<12} {:>6} {:>9} {:>9} {:>9} {:>8} {:>9} {:>9}\n", "camera", "views", "fit px",
             "held px", "half mm", "half deg", "half px", "offset ms");
  const auto text = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.3f}", *value) : std::string("-");
  };
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    const CameraReport& r = report.cameras[c];
    const SolvedCamera& s = solution.cameras[c];
    const auto half = [&](double SplitHalf::*member) {
      return r.split_half ? std::optional<double>((*r.split_half).*member) : std::nullopt;
    };
    fmt::print("{:<12} {:>6} {:>9.3f} {:>9} {:>9} {:>8} {:>9} {:>9.1f}\n", r.name, s.views,
               s.camera.rms_px, text(r.held_out_px), text(half(&SplitHalf::center_mm)),
               text(half(&SplitHalf::rotation_deg)), text(half(&SplitHalf::median_px)),
               1e3 * s.time_offset_s);
  }
  for (const CameraReport& r : report.cameras) {
    for (const std::string& remark : r.remarks) fmt::print("{}: {}\n", r.name, remark);
  }
}

/// UTC, as TOML writes dates.
std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

/// calibration.toml last: it is in force once it is there, and what explains it is there by then.
Status write(const std::filesystem::path& folder, const CalibrationViews& views,
             const RigSolution& solution, const RigReport& report, const std::string& epoch) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    return make_error(ErrorCode::kIo, folder.string(), "cannot make it: {}", error.message());
  SL_RETURN_IF_ERROR(write_file_atomically(folder / "corners.csv", format_views(views)));
  SL_RETURN_IF_ERROR(
      write_file_atomically(folder / "report.json", report_json(views, solution, report, epoch)));
  SL_RETURN_IF_ERROR(
      write_file_atomically(folder / "report.html", report_html(views, solution, report, epoch)));
  const std::string text =
      format_solution(solution, today(), fmt::format("epoch {}, see corners.csv", epoch));
  SL_RETURN_IF_ERROR(parse_calibration(text, "the calibration"));
  return write_file_atomically(folder / "calibration.toml", text);
}

struct Solved {
  RigSolution solution;
  RigReport report;
};

Result<Solved> solve(const CalibrationViews& views, const SolveOptions& options) {
  SL_ASSIGN(RigSolution solution, solve_rig(views, options));
  SL_ASSIGN(RigReport report, assess_rig(views, options, solution));
  return Solved{std::move(solution), std::move(report)};
}

/// The family that predicts what it was not fitted to best; a richer one must be better by 2 %.
Result<Solved> solve_best(const CalibrationViews& views, SolveOptions options) {
  constexpr double kBetter = 0.98;
  std::optional<Solved> best;
  std::optional<Error> refused;
  for (const LensModel lens :
       {LensModel::kBrownConrady, LensModel::kFisheye, LensModel::kRational}) {
    for (CameraPrior& prior : options.cameras) prior.lens = lens;
    auto solved = solve(views, options);
    const char* const name = lens == LensModel::kBrownConrady ? "brown_conrady"
                             : lens == LensModel::kFisheye    ? "fisheye"
                                                              : "rational";
    if (!solved) {
      std::fprintf(stderr, "%s: %s\n", name, solved.error().message().c_str());
      if (!refused) refused = solved.error();
      continue;
    }
    const double error = solved->report.held_out_px.value_or(1e9);
    std::fprintf(stderr, "%s: held out %.4f px, fit %.4f px\n", name, error,
                 solved->solution.rms_px);
    if (!best || error < kBetter * best->report.held_out_px.value_or(1e9)) {
      best = *std::move(solved);
    }
  }
  if (!best) return *refused;
  return *std::move(best);
}

Status run(const SolveCommandOptions& o) {
  SL_ASSIGN(const CalibrationViews views, load_views(o.views));
  SolveOptions options = o.solve;
  const bool best = o.models == std::vector<std::string>{"best"};
  SL_ASSIGN(options.cameras,
            parse_priors(views, best ? std::vector<std::string>() : o.models, o.intrinsics));
  if (!o.reference.empty()) {
    const auto found = std::find_if(views.cameras.begin(), views.cameras.end(),
                                    [&](const ViewedCamera& c) { return c.name == o.reference; });
    if (found == views.cameras.end()) {
      return make_error(ErrorCode::kInvalidInput, "--reference", "no camera '{}' took part",
                        o.reference);
    }
    options.reference = static_cast<size_t>(found - views.cameras.begin());
  }
  SL_ASSIGN(const Solved solved, best ? solve_best(views, options) : solve(views, options));
  const RigSolution& solution = solved.solution;
  const RigReport& report = solved.report;
  const std::string epoch = fmt::format(
      "{:016x}", content_hash(format_views(views) + format_calibration(cameras_of(solution))));
  SL_RETURN_IF_ERROR(write(o.out, views, solution, report, epoch));
  if (o.json) {
    fmt::print("{}", report_json(views, solution, report, epoch));
  } else {
    print(solution, report);
    fmt::print("written: {}/calibration.toml, report.html, report.json, corners.csv\n",
               o.out.string());
  }
  return {};
}

}  // namespace

void add_calibrate_solve(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<SolveCommandOptions>();
  auto* command = parent.add_subcommand(
      "solve", "lenses and places of all cameras, from images of a target, with a report");
  add_view_arguments(*command, options->views);
  command->add_option("--out", options->out,
                      "folder for calibration.toml, report.html, report.json and corners.csv "
                      "(default: calibration)");
  command
      ->add_option("--model", options->models,
                   "brown_conrady (default), rational or fisheye; NAME=MODEL for one camera; best: "
                   "tries all three and takes what predicts best")
      ->allow_extra_args(false);
  command->add_option("--intrinsics", options->intrinsics,
                      "calibration.toml whose lenses are held; only the places are solved for");
  command->add_option("--reference", options->reference,
                      "camera whose frame becomes the world's (default: the first)");
  command->add_flag("--bend", options->solve.bend, "the target may be bent: solve for that, too");
  command->add_flag("--time-offsets", options->solve.time_offsets,
                    "the stamps of cameras may be late: solve for that, too (moving target)");
  command->add_option("--huber", options->solve.huber_px,
                      "robust loss beyond so many pixels (default: none)");
  command->add_option("--reject", options->solve.reject_sigmas,
                      "leave out corners farther off than so many robust sigmas (default 6; 0: "
                      "none)");
  command->add_flag("--json", options->json, "print the report as JSON");
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = run(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
