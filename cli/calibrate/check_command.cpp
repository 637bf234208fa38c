// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "calibrate/calibrate_commands.hpp"
#include "calibrate/solve_arguments.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/check_rig.hpp"
#include "sightline/calibrate/place_world.hpp"

namespace sightline::cli {
namespace {

using Json = nlohmann::ordered_json;

struct CheckCommandOptions {
  ViewArguments views;
  std::filesystem::path calibration, propose;
  bool time_offsets = false, json = false;
};

Json to_json(const RigCheck& check) {
  Json json{{"in_order", check.in_order}};
  if (check.held_out_px) json["held_out_px"] = *check.held_out_px;
  if (check.rigidity) json["rigidity_mm"] = check.rigidity->rms_mm;
  for (const CameraDrift& c : check.cameras) {
    Json camera{{"name", c.name},
                {"moved", c.moved},
                {"anchor", c.anchor},
                {"rotation_deg", c.rotation_deg},
                {"rotation_sigma_deg", c.rotation_sigma_deg},
                {"shift_mm", c.shift_mm},
                {"shift_sigma_mm", c.shift_sigma_mm},
                {"words", c.words}};
    if (c.held_out_px) camera["held_out_px"] = *c.held_out_px;
    json["cameras"].push_back(std::move(camera));
  }
  return json;
}

Status run_check(const CheckCommandOptions& o) {
  SL_ASSIGN(const auto calibration, read_calibration(o.calibration));
  SL_ASSIGN(CalibrationViews views, load_views(o.views));
  for (TargetView& view : views.views) {
    const auto* camera = find_camera(calibration, views.cameras[view.camera].name);
    if (camera != nullptr) view.delay_s += camera->time_offset_s;
  }
  SolveOptions options;
  options.time_offsets = o.time_offsets;
  SL_ASSIGN(const RigCheck check, check_rig(views, calibration, options));
  if (!o.propose.empty()) {
    std::vector<CalibratedCamera> proposed = calibration;
    for (CalibratedCamera& camera : proposed) {
      const CalibratedCamera* now = find_camera(check.now, camera.name);
      if (now != nullptr) camera = *now;
    }
    SL_RETURN_IF_ERROR(write_calibration(o.propose, proposed));
  }
  if (o.json) {
    fmt::print("{}\n", to_json(check).dump(2));
    return {};
  }
  for (const CameraDrift& c : check.cameras) {
    fmt::print("camera {}: {}{}\n", c.name, c.words,
               c.held_out_px ? fmt::format("; held out {:.3f} px", *c.held_out_px) : "");
  }
  if (check.rigidity) fmt::print("lengths on the target: {:.3f} mm RMS\n", check.rigidity->rms_mm);
  fmt::print("{}\n", check.in_order ? "in order" : "NOT in order: a camera has moved");
  return {};
}

struct WorldCommandOptions {
  ViewArguments views;
  std::filesystem::path calibration, out, points;
  std::string motion;
  std::optional<double> length;
};

Result<std::vector<CalibratedCamera>> place_by_motion(
    const WorldCommandOptions& o, const std::vector<CalibratedCamera>& cameras) {
  SL_ASSIGN(const WorldAxis axis, parse_world_axis(o.motion));
  SL_ASSIGN(const CalibrationViews views, load_views(o.views));
  SL_ASSIGN(const MotionPlacement placed, world_of_motion(views, cameras, axis, o.length));
  fmt::print(
      "{} along {:.1f} mm of motion, {} places, {:.2f} mm RMS beside the line; direction +- {:.3f} "
      "deg; up turned by {:.3f} deg\n",
      o.motion, 1e3 * placed.travel, placed.places, placed.rms_mm, placed.sigma_deg,
      placed.up_turned_deg);
  return placed.cameras;
}

Result<std::vector<CalibratedCamera>> place_world(const WorldCommandOptions& o,
                                                  const std::vector<CalibratedCamera>& cameras) {
  if (!o.motion.empty()) return place_by_motion(o, cameras);
  if (o.points.empty()) {
    SL_ASSIGN(const CalibrationViews views, load_views(o.views));
    SL_ASSIGN(WorldPlacement placed, world_of_target(views, cameras));
    return std::move(placed.cameras);
  }
  SL_ASSIGN(const std::string text, read_file(o.points, size_t{16} << 20));
  SL_ASSIGN(const auto sights, parse_surveyed_points(text, o.points.string()));
  SL_ASSIGN(WorldPlacement placed, world_of_points(sights, cameras));
  fmt::print("{} points, {:.2f} mm RMS; the world is {:.5f} times as large as the rig measures\n",
             placed.points, placed.rms_mm, placed.scale);
  return std::move(placed.cameras);
}

Status run_world(const WorldCommandOptions& o) {
  SL_ASSIGN(const auto cameras, read_calibration(o.calibration));
  SL_ASSIGN(const auto placed, place_world(o, cameras));
  SL_RETURN_IF_ERROR(write_calibration(o.out, placed));
  for (const CalibratedCamera& c : placed) {
    const Eigen::Vector3d& t = c.world_from_camera.translation;
    fmt::print("{:<12} at {:8.4f} {:8.4f} {:8.4f} m\n", c.name, t.x(), t.y(), t.z());
  }
  fmt::print("written: {}\n", o.out.string());
  return {};
}

int exit_of(const Status& done) { return done ? 0 : report(done.error()); }

}  // namespace

void add_calibrate_check(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<CheckCommandOptions>();
  auto* command = parent.add_subcommand(
      "check", "new images of a target against the calibration in force: has a camera moved?");
  add_view_arguments(*command, options->views);
  command->add_option("--calibration", options->calibration, "the calibration in force")
      ->required();
  command->add_option("--propose", options->propose,
                      "write the calibration with the places of today (same lenses)");
  command->add_flag("--time-offsets", options->time_offsets,
                    "the stamps of cameras may be late (moving target)");
  command->add_flag("--json", options->json, "as JSON");
  command->callback(
      [options, &chosen] { chosen = [options] { return exit_of(run_check(*options)); }; });
}

void add_calibrate_world(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<WorldCommandOptions>();
  options->views.by_any = true;
  auto* command = parent.add_subcommand(
      "world",
      "puts the world where a target lies on the floor, or where surveyed points say, or turns it "
      "to how a target was moved");
  add_view_arguments(*command, options->views);
  command->add_option("--calibration", options->calibration, "whose world is moved")->required();
  command->add_option("--out", options->out, "calibration.toml to write")->required();
  command->add_option("--points", options->points,
                      "x,y,z,camera,u,v of points that are known in the world, instead of images");
  auto* motion = command->add_option(
      "--motion", options->motion,
      "the target was moved along a straight line, in the order of the images: this axis of the "
      "world (x, y, z, or --motion=-x)");
  command
      ->add_option("--length", options->length,
                   "how far it was moved from end to end [m], to check the scale")
      ->check(CLI::PositiveNumber)
      ->needs(motion);
  command->callback(
      [options, &chosen] { chosen = [options] { return exit_of(run_world(*options)); }; });
}

}  // namespace sightline::cli
