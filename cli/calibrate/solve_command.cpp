// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "calibrate/calibrate_commands.hpp"
#include "calibrate/solve_arguments.hpp"
#include "report.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline::cli {
namespace {

struct SolveCommandOptions {
  ViewArguments views;
  std::vector<std::string> models;
  std::filesystem::path intrinsics;
  SolveOptions solve;
};

Status run(const SolveCommandOptions& o) {
  SL_ASSIGN(const CalibrationViews views, load_views(o.views));
  SolveOptions options = o.solve;
  SL_ASSIGN(options.cameras, parse_priors(views, o.models, o.intrinsics));
  SL_ASSIGN(const RigSolution s, solve_rig(views, options));
  fmt::print("rms {:.6f} sigma {:.4f} corners {} rejected {} iterations {} bend {} {} mm\n", s.rms_px, s.sigma_px, s.corners, s.rejected, s.iterations, 1e3*s.bend.x(), 1e3*s.bend.y());
  for (const auto& c : s.cameras) {
    fmt::print("{} rms {:.4f} views {} corners {} rej {}\n", c.camera.name, c.camera.rms_px, c.views, c.corners, c.rejected);
    for (const auto& e : c.estimates) fmt::print("  {} {:.4f}+-{:.4f}", e.name, e.value, e.sigma);
    const auto t = c.camera.world_from_camera.translation;
    fmt::print("\n  t {} {} {} norm {}\n", t.x(), t.y(), t.z(), t.norm());
  }
  return {};
}

}  // namespace

void add_calibrate_solve(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<SolveCommandOptions>();
  auto* command = parent.add_subcommand("solve", "lenses and places of all cameras");
  add_view_arguments(*command, options->views);
  command->add_option("--model", options->models, "lens model")->allow_extra_args(false);
  command->add_option("--intrinsics", options->intrinsics, "known lenses");
  command->add_flag("--bend", options->solve.bend, "bend");
  command->add_flag("--time-offsets", options->solve.time_offsets, "offsets");
  command->add_option("--huber", options->solve.huber_px, "");
  command->add_option("--reject", options->solve.reject_sigmas, "");
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = run(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
