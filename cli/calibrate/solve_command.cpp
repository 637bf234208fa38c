// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <optional>

#include "calibrate/calibrate_commands.hpp"
#include "calibrate/solve_arguments.hpp"
#include "calibrate/solved_rig.hpp"
#include "calibration/capture_files.hpp"
#include "report.hpp"

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

/// The family that predicts what it was not fitted to best; a richer one must be better by 2 %.
Result<SolvedRig> solve_best(const CalibrationViews& views, SolveOptions options) {
  constexpr double kBetter = 0.98;
  std::optional<SolvedRig> best;
  std::optional<Error> refused;
  for (const LensModel lens :
       {LensModel::kBrownConrady, LensModel::kFisheye, LensModel::kRational}) {
    for (CameraPrior& prior : options.cameras) prior.lens = lens;
    auto solved = solve_and_assess(views, options);
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
  SL_ASSIGN(options.reference, reference_camera(views, o.reference));
  SL_ASSIGN(const SolvedRig solved,
            best ? solve_best(views, options) : solve_and_assess(views, options));
  SL_RETURN_IF_ERROR(write_solved(o.out, views, solved));
  print_solved(views, solved, o.json, o.out);
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
  command->add_flag(
      "--readouts", options->solve.readouts,
      "rows of cameras may be exposed one after the other (rolling shutter): solve for "
      "how long that takes (moving target)");
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
