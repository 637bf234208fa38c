// SPDX-License-Identifier: Apache-2.0
// `sightline`: everything about a rig that is not the daemon itself.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <map>
#include <string>
#include <tuple>

#include "commands.hpp"
#include "sightline/base/log.hpp"
#include "version.hpp"

namespace {

using namespace sightline;

// CLI11 reports its own errors with many numbers; ours are 0 and 2 (wrong usage).
int exit_status_of(const CLI::App& app, const CLI::ParseError& error) {
  return app.exit(error) == 0 ? 0 : 2;
}

// Units of length that people keep files in.
CLI::CheckedTransformer unit_of_length() {
  return CLI::CheckedTransformer(
      std::map<std::string, double>{{"m", 1.0}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}});
}

void add_superimpose(CLI::App& app, cli::SuperimposeOptions& options) {
  auto* command = app.add_subcommand(
      "superimpose", "draw points or a mesh, known in one camera's frame, into another's picture");
  command
      ->add_option("--points", options.points,
                   "file of points, x y z a line; edges:FILE or corners:FILE say of what")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--from", options.from,
                      "camera file whose frame the points are in (OpenCV, or FILE.toml#NAME)");
  command->add_option("--to", options.to, "camera file of the picture")->required();
  command->add_option("--image", options.image, "the picture (PNG, JPEG, ...)")->required();
  command->add_option("--out", options.out, "PNG to write")->required();
  command->add_option("--table", options.table,
                      "write the projected points here (default: stdout)");
  command
      ->add_option("--points-frame", options.points_frame,
                   "frame of the points and the pose: from (default), world, or to if they are in "
                   "the third camera's already")
      ->check(CLI::IsMember({"from", "world", "to"}));
  command->add_option("--marker", options.marker, "around the points: rectangle, circle, none")
      ->check(CLI::IsMember({"rectangle", "circle", "none"}));
  auto* mesh = command->add_option("--mesh", options.mesh, "mesh to draw, hidden surfaces removed");
  command
      ->add_option("--pose", options.pose,
                   "of the mesh: tx ty tz qw qx qy qz, or rvec and tvec (6 numbers)")
      ->expected(6, 7)
      ->needs(mesh);
  command->add_option("--style", options.style, "of the mesh: names of the overlay's marks")
      ->delimiter(',')
      ->needs(mesh);
  command->add_option("--scene", options.scene, "mesh in world coordinates that hides things")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--points-unit", options.points_unit, "m (default), cm, mm, in")
      ->transform(unit_of_length());
  command->add_option("--camera-unit", options.camera_unit, "of the poses in OpenCV's files")
      ->transform(unit_of_length());
  command->add_option("--mesh-unit", options.mesh_unit, "of mesh and scene files")
      ->transform(unit_of_length());
  command->add_flag("--skip-behind", options.skip_behind,
                    "leave out points that the camera cannot picture instead of refusing them");
  command->add_flag("--json", options.json, "summary as JSON");
}

void add_view(CLI::App& app, cli::ViewOptions& options) {
  auto* command = app.add_subcommand("view", "the rig of a recording, seen from anywhere");
  command->add_option("RECORDING", options.recording, "recording folder")->required();
  command->add_option("--out", options.out, "FILE.png (one picture) or FILE.mkv (all of it)")
      ->required();
  command->add_option("--config", options.config, "installation file (default: the recording)");
  auto* name =
      command->add_option("--view", options.name, "name of a [[view]] of the installation");
  for (const auto& [option, numbers, text] :
       {std::tuple("--eye", &options.eye, "where to look from, x y z in the world"),
        std::tuple("--target", &options.target,
                   "what to look at (default: where the cameras look)"),
        std::tuple("--up", &options.up, "what is upwards (default 0 0 1)")}) {
    command->add_option(option, *numbers, text)->expected(3)->excludes(name);
  }
  command->add_option("--fov", options.fov_deg, "horizontal, degrees (default 50)")->excludes(name);
  command->add_option("--width", options.width, "default 1280")->excludes(name);
  command->add_option("--height", options.height, "default 720")->excludes(name);
  command
      ->add_option("--at", options.at_s, "seconds since the recording's start (default: its end)")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options.json, "as JSON");
}

void add_teach(CLI::App& app, cli::TeachCommandOptions& options) {
  auto* command =
      app.add_subcommand("teach", "learn what an object's print looks like, to find it by");
  command
      ->add_option("INPUT", options.input,
                   "recording with known poses, or list of pictures (CSV: picture, camera, pose)")
      ->required();
  command->add_option("OUT", options.out, "feature file to write")->required();
  command->add_option("--poses", options.poses,
                      "truth or pose log (default: truth.csv, poses.csv of the recording)");
  command->add_option("--object", options.object,
                      "which of the recording, if there are several; for pictures the object file");
  command->add_option("--calibration", options.calibration, "of the cameras of the pictures");
  command->add_option("--camera", options.cameras, "only this one; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--every", options.every, "N: each Nth picture of a camera (default 5)")
      ->check(CLI::Range(1, 100000));
  command->add_option("--from", options.from_s, "seconds since the recording's start")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--to", options.to_s, "seconds since the recording's start")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options.json, "as JSON");
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
  evaluate_command
      ->add_option("--object", evaluate.object_files,
                   "object file whose symmetry the errors respect; may be repeated")
      ->allow_extra_args(false);
  evaluate_command->add_flag("--json", evaluate.json, "as JSON");

  cli::ReplayOptions replay;
  auto* replay_command = app.add_subcommand("replay", "run a recording through the pipeline");
  replay_command->add_option("RECORDING", replay.recording, "recording folder")->required();
  replay_command->add_option("--config", replay.config,
                             "installation file (default: the recording)");
  replay_command
      ->add_option("--cues", replay.cues,
                   "measure objects only by these: fiducial, region, edge, texture")
      ->delimiter(',');
  replay_command
      ->add_option("--features", replay.features,
                   "find objects by what this file was taught: FILE, or NAME=FILE for one of them")
      ->allow_extra_args(false);
  replay_command->add_option("--poses", replay.poses, "write the pose log here");
  replay_command->add_option("--overlay", replay.overlay,
                             "write CAMERA.mkv as streamed to this folder");
  replay_command->add_option("--overlay-png", replay.overlay_png,
                             "write single pictures to this folder");
  replay_command->add_option("--points", replay.points,
                             "write points that pairs of cameras reconstruct here (PLY)");
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
  cameras_command->add_option("--sync", cameras.sync, "phase and drift between two of these (A B)")
      ->expected(2)
      ->excludes(try_option);
  cameras_command->add_option("--config", cameras.config, "installation file that has the cameras");
  cameras_command->add_option("--seconds", cameras.seconds, "how long (default 5)")
      ->check(CLI::Range(0.1, 86400.0));
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

  cli::SuperimposeOptions superimpose;
  add_superimpose(app, superimpose);
  cli::ViewOptions view;
  add_view(app, view);
  cli::TeachCommandOptions teach;
  add_teach(app, teach);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return exit_status_of(app, error);
  }
  if (verbose) log::set_level(log::Level::kDebug);
  if (seconds_option->count() > 0) record.seconds = seconds;

  if (check_command->parsed()) return cli::check(check);
  if (evaluate_command->parsed()) return cli::evaluate(evaluate);
  if (cameras_command->parsed()) {
    const bool listing = cameras.source.empty() && cameras.sync.empty();
    if (listing && cameras_command->count("--seconds") + cameras_command->count("--config") > 0) {
      std::fputs("sightline: --seconds and --config go with --try or --sync\n", stderr);
      return 2;
    }
    return cli::cameras(cameras);
  }
  if (model_command->parsed()) return cli::model(model);
  if (app.got_subcommand("superimpose")) return cli::superimpose(superimpose);
  if (app.got_subcommand("view")) return cli::view(view);
  if (app.got_subcommand("teach")) return cli::teach(teach);
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
