// SPDX-License-Identifier: Apache-2.0
// `sightline`: everything about a rig that is not the daemon itself.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "commands.hpp"
#include "sightline/base/log.hpp"
#include "version.hpp"

namespace {

using namespace sightline;

// CLI11 reports its own errors with many numbers; ours are 0 and 2 (wrong usage).
int exit_status_of(const CLI::App& app, const CLI::ParseError& error) {
  return app.exit(error) == 0 ? 0 : 2;
}

int run(int argc, char** argv) {
  CLI::App app{"Sightline: live annotated video streams of a known object, for fixed camera rigs"};
  app.set_version_flag("--version", std::string("sightline ") + kVersion);
  app.require_subcommand(1);
  bool verbose = false;
  app.add_flag("-v,--verbose", verbose, "say more on stderr");

  cli::CheckOptions check;
  auto* check_command = app.add_subcommand("check", "validate an installation file");
  check_command->add_option("FILE", check.file, "installation file, or a recording")->required();
  check_command->add_flag("--json", check.json, "errors and summary as JSON");

  cli::EvaluateCommandOptions evaluate;
  auto* evaluate_command = app.add_subcommand("evaluate", "errors of a pose log against the truth");
  evaluate_command->add_option("TRUTH", evaluate.truth, "truth.csv")->required();
  evaluate_command->add_option("POSES", evaluate.poses, "poses.csv")->required();
  evaluate_command->add_option("--object", evaluate.object_file,
                               "object file whose symmetry the errors respect");
  evaluate_command->add_flag("--json", evaluate.json, "as JSON");

  cli::ReplayOptions replay;
  auto* replay_command = app.add_subcommand("replay", "run a recording through the pipeline");
  replay_command->add_option("RECORDING", replay.recording, "recording folder")->required();
  replay_command->add_option("--config", replay.config,
                             "installation file (default: the recording)");
  replay_command->add_option("--poses", replay.poses, "write the pose log here");
  replay_command->add_option("--overlay", replay.overlay,
                             "write CAMERA.mkv as streamed to this folder");
  replay_command->add_option("--overlay-png", replay.overlay_png,
                             "write single pictures to this folder");
  replay_command->add_flag("--realtime", replay.realtime, "at the recording's own pace");
  replay_command->add_flag("--json", replay.json, "summary as JSON");

  cli::RecordOptions record;
  double seconds = 0;
  auto* record_command = app.add_subcommand("record", "record an installation's cameras");
  record_command->add_option("--config", record.config, "installation file")->required();
  record_command->add_option("OUT", record.out, "folder to make")->required();
  auto* seconds_option =
      record_command->add_option("--seconds", seconds, "stop after so long (default: Ctrl-C)")
          ->check(CLI::PositiveNumber);

  cli::CamerasOptions cameras;
  auto* cameras_command = app.add_subcommand("cameras", "list what is plugged in, or try a camera");
  auto* try_option = cameras_command->add_option(
      "--try", cameras.source, "grab from this source (or camera of --config) and measure");
  cameras_command->add_option("--config", cameras.config, "installation file that has the camera")
      ->needs(try_option);
  cameras_command->add_option("--seconds", cameras.seconds, "how long (default 5)")
      ->check(CLI::Range(0.1, 86400.0))
      ->needs(try_option);
  cameras_command->add_option("--save", cameras.save, "write the last picture as PNG")
      ->needs(try_option);
  cameras_command->add_flag("--json", cameras.json, "as JSON");

  cli::ModelOptions model;
  auto* model_command =
      app.add_subcommand("model", "make and inspect the viewpoint model of an object");
  model_command->add_option("FILE", model.file, "object file, or mesh")->required();
  model_command->add_option("--meters-per-unit", model.meters_per_unit, "of a mesh (default 1)")
      ->check(CLI::PositiveNumber);
  model_command->add_option("--sheet", model.sheet, "write a contact sheet (PNG)");
  auto* cache_option = model_command->add_option("--cache", model.cache, "cache folder");
  model_command->add_flag("--no-cache", model.no_cache, "make it anew, write nothing")
      ->excludes(cache_option);
  model_command->add_flag("--json", model.json, "as JSON");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return exit_status_of(app, error);
  }
  if (verbose) log::set_level(log::Level::kDebug);
  if (seconds_option->count() > 0) record.seconds = seconds;

  if (check_command->parsed()) return cli::check(check);
  if (evaluate_command->parsed()) return cli::evaluate(evaluate);
  if (cameras_command->parsed()) return cli::cameras(cameras);
  if (model_command->parsed()) return cli::model(model);
  if (replay_command->parsed()) return cli::replay(replay);
  return cli::record(record);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sightline: unexpected: %s\n", error.what());
    return 1;
  }
}
