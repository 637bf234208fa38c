// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.hpp"
#include "pose_argument.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/camera_file.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/record/overlay_video.hpp"
#include "sightline/record/still_image.hpp"
#include "sightline/render/overlay/point_marks.hpp"
#include "superimpose.hpp"

namespace sightline::cli {
namespace {

struct SuperimposeOptions {
  std::vector<std::string> points;    ///< FILE, edges:FILE, corners:FILE
  std::string from;                   ///< camera whose frame the points are in
  std::string to;                     ///< camera of the image
  std::string points_frame = "from";  ///< or "world", or "to"
  std::filesystem::path image, out;
  std::filesystem::path table;       ///< CSV; empty: to stdout
  std::string marker = "rectangle";  ///< or "circle", or "none"
  std::filesystem::path mesh;        ///< empty: none
  std::vector<double> pose;          ///< of the mesh, in the frame of the points
  std::vector<std::string> style = {"fill", "outline", "wireframe"};  ///< of the mesh
  std::vector<std::filesystem::path> scene;                           ///< meshes in the world
  double points_unit = 1, camera_unit = 1, mesh_unit = 1;             ///< [m]
  bool skip_behind = false;
  bool json = false;
};

using Json = nlohmann::ordered_json;

constexpr Rgb kMarkerColor{70, 225, 120};
constexpr float kMarkerWidth = 2;
constexpr double kMarkerMargin = 8;  // px between the points and the marker
constexpr double kDepthTolerance = 0.01;

struct Outcome {
  std::vector<PointFile> files;
  std::vector<SuperimposedPoint> points;
  std::shared_ptr<Image> image;
};

Error wrong_usage(std::string text) {
  return Error{ErrorCode::kInvalidInput, std::move(text), "superimpose"};
}

// "corners:FILE", "edges:FILE", or FILE whose name says which.
Result<PointFile> read_point_file(const std::string& argument, double meters_per_unit) {
  PointFile file;
  file.name = argument;
  const auto named = [&](const std::string& prefix, PointKind kind) {
    if (!argument.starts_with(prefix)) return false;
    file.kind = kind;
    file.name = argument.substr(prefix.size());
    return true;
  };
  if (!named("edges:", PointKind::kEdge) && !named("corners:", PointKind::kCorner) &&
      !named("points:", PointKind::kPoint)) {
    const std::string stem = std::filesystem::path(argument).stem().string();
    if (stem.find("corner") != std::string::npos) file.kind = PointKind::kCorner;
    if (stem.find("edge") != std::string::npos) file.kind = PointKind::kEdge;
  }
  SL_ASSIGN(file.list, read_points(file.name, meters_per_unit));
  return file;
}

Result<std::shared_ptr<const RenderMesh>> load(const std::filesystem::path& path,
                                               double meters_per_unit) {
  MeshOptions options;
  options.meters_per_unit = meters_per_unit;
  SL_ASSIGN(const TriangleMesh mesh, read_mesh(path, options));
  return std::make_shared<const RenderMesh>(make_render_mesh(mesh));
}

Result<CalibratedCamera> read_target(const SuperimposeOptions& options, const Image& image) {
  CameraFileDefaults defaults{image.width(), image.height(), options.camera_unit};
  SL_ASSIGN(CalibratedCamera camera, read_camera(options.to, defaults));
  if (camera.model.width() == image.width() && camera.model.height() == image.height()) {
    return camera;
  }
  return make_error(ErrorCode::kInvalidInput, options.image.string(),
                    "is {} x {} pixels, but {} was calibrated at {} x {}: use the image as the "
                    "camera gave it, or a calibration of this size",
                    image.width(), image.height(), options.to, camera.model.width(),
                    camera.model.height());
}

// world_from_(the frame that points and mesh pose are given in).
Result<Rigid3> frame_of(const SuperimposeOptions& options, const CalibratedCamera& target) {
  if (options.points_frame != "from" && !options.from.empty()) {
    return wrong_usage("--from is of no use with --points-frame " + options.points_frame +
                       ": leave one of them out");
  }
  if (options.points_frame == "world") return Rigid3();
  if (options.points_frame == "to") return target.world_from_camera;
  if (options.from.empty()) {
    return wrong_usage(
        "say with --from whose frame the points are in, or with --points-frame that they are in "
        "the world's (world) or already in the third camera's (to)");
  }
  // The size matters to nothing here; a file that does not say it is fine.
  SL_ASSIGN(const CalibratedCamera from,
            read_camera(options.from,
                        {target.model.width(), target.model.height(), options.camera_unit}));
  return from.world_from_camera;
}

Result<OverlayStyle> mesh_style(const std::vector<std::string>& names) {
  OverlayStyle style = bare_style();
  for (const std::string& name : names) {
    bool* flag = style_flag(style, name);
    if (flag == nullptr) {
      std::string known;
      for (const std::string_view each : style_names()) known += fmt::format(" {}", each);
      return wrong_usage(fmt::format("--style: '{}' is none of:{}", name, known));
    }
    *flag = true;
  }
  return style;
}

void draw_marker(const SuperimposeOptions& options, const Outcome& outcome) {
  std::vector<Eigen::Vector2d> pixels;
  for (const SuperimposedPoint& point : outcome.points) {
    if (point.in_image()) pixels.push_back(point.pixel);
  }
  const MutableI420View view = outcome.image->mutable_view();
  if (options.marker == "circle") {
    draw_bounding_circle(view, pixels, kMarkerColor, kMarkerWidth, kMarkerMargin);
  } else if (options.marker == "rectangle") {
    draw_bounding_rectangle(view, pixels, kMarkerColor, kMarkerWidth, kMarkerMargin);
  }
}

Status draw_all(const SuperimposeOptions& options, const CalibratedCamera& camera,
                const Rigid3& world_from_points, Outcome& outcome) {
  const auto rays = RayTable::build(camera.model);
  std::vector<PlacedMesh> scene;
  for (const auto& path : options.scene) {
    SL_ASSIGN(auto mesh, load(path, options.mesh_unit));
    scene.push_back({std::move(mesh), Rigid3()});
  }
  std::vector<PlacedMesh> surfaces = scene;
  if (!options.mesh.empty()) {
    SL_ASSIGN(auto mesh, load(options.mesh, options.mesh_unit));
    SL_ASSIGN(const Rigid3 pose, parse_pose(options.pose, "superimpose --pose"));
    SL_ASSIGN(const OverlayStyle style, mesh_style(options.style));
    const PlacedMesh object{std::move(mesh), world_from_points * pose};
    SL_RETURN_IF_ERROR(draw_placed_mesh(object, scene, camera, rays, style, *outcome.image));
    surfaces.push_back(object);
  }
  hide_points(surfaces, camera, rays, kDepthTolerance, outcome.points);
  draw_superimposed(outcome.files, outcome.points, *outcome.image);
  draw_marker(options, outcome);
  return {};
}

Result<Outcome> run(const SuperimposeOptions& options) {
  if (options.points.empty() && options.mesh.empty()) {
    return wrong_usage("nothing to superimpose: give --points FILE, or --mesh FILE with --pose");
  }
  if (!options.mesh.empty() && options.pose.empty()) {
    return wrong_usage("--mesh needs --pose: where it stands in the frame of --points-frame");
  }
  SL_ASSIGN(const auto image, read_image(options.image));
  SL_ASSIGN(const CalibratedCamera camera, read_target(options, *image));
  SL_ASSIGN(const Rigid3 world_from_points, frame_of(options, camera));
  Outcome outcome;
  for (const std::string& argument : options.points) {
    SL_ASSIGN(PointFile file, read_point_file(argument, options.points_unit));
    outcome.files.push_back(std::move(file));
  }
  SL_ASSIGN(outcome.points,
            superimpose_points(outcome.files, world_from_points, camera, options.skip_behind));
  outcome.image = std::make_shared<Image>(image->width(), image->height());
  copy_i420(image->view(), outcome.image->mutable_view());
  SL_RETURN_IF_ERROR(draw_all(options, camera, world_from_points, outcome));
  SL_RETURN_IF_ERROR(write_png(options.out, outcome.image->view()));
  if (!options.table.empty()) {
    SL_RETURN_IF_ERROR(
        write_file_atomically(options.table, format_table(outcome.files, outcome.points)));
  }
  return outcome;
}

Json summary(const SuperimposeOptions& options, const Outcome& outcome) {
  Json states = Json::object();
  for (const SuperimposedPoint& point : outcome.points) {
    Json& count = states[std::string(to_string(point.state))];
    count = count.is_null() ? 1 : count.get<int>() + 1;
  }
  return Json{{"out", options.out.string()},
              {"points", outcome.points.size()},
              {"states", states},
              {"mesh", !options.mesh.empty()}};
}

int superimpose(const SuperimposeOptions& options) {
  const auto outcome = run(options);
  if (!outcome) return report(outcome.error());
  const Json json = summary(options, *outcome);
  if (options.json) {
    fmt::print("{}\n", json.dump(2));
    return 0;
  }
  if (options.table.empty()) fmt::print("{}", format_table(outcome->files, outcome->points));
  std::string text = fmt::format("{}: {} points", options.out.string(), outcome->points.size());
  for (const auto& [state, count] : json["states"].items()) {
    text += fmt::format(", {} {}", count.get<int>(), state);
  }
  fmt::print(stderr, "{}{}\n", text, options.mesh.empty() ? "" : ", and the mesh");
  return 0;
}

// Units of length that people keep files in.
CLI::CheckedTransformer unit_of_length() {
  return CLI::CheckedTransformer(
      std::map<std::string, double>{{"m", 1.0}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}});
}

}  // namespace

void add_superimpose(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<SuperimposeOptions>();
  auto* command = app.add_subcommand(
      "superimpose", "draw points or a mesh, known in one camera's frame, into another's image");
  command
      ->add_option("--points", options->points,
                   "file of points, x y z a line; edges:FILE or corners:FILE say of what")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--from", options->from,
                      "camera file whose frame the points are in (OpenCV, or FILE.toml#NAME)");
  command->add_option("--to", options->to, "camera file of the image")->required();
  command->add_option("--image", options->image, "the image (PNG, JPEG, ...)")->required();
  command->add_option("--out", options->out, "PNG to write")->required();
  command->add_option("--table", options->table,
                      "write the projected points here (default: stdout)");
  command
      ->add_option("--points-frame", options->points_frame,
                   "frame of the points and the pose: from (default), world, or to if they are in "
                   "the third camera's already")
      ->check(CLI::IsMember({"from", "world", "to"}));
  command->add_option("--marker", options->marker, "around the points: rectangle, circle, none")
      ->check(CLI::IsMember({"rectangle", "circle", "none"}));
  auto* mesh =
      command->add_option("--mesh", options->mesh, "mesh to draw, hidden surfaces removed");
  command
      ->add_option("--pose", options->pose,
                   "of the mesh: tx ty tz qw qx qy qz, or rvec and tvec (6 numbers)")
      ->expected(6, 7)
      ->needs(mesh);
  command->add_option("--style", options->style, "of the mesh: names of the overlay's marks")
      ->delimiter(',')
      ->needs(mesh);
  command->add_option("--scene", options->scene, "mesh in world coordinates that hides things")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--points-unit", options->points_unit, "m (default), cm, mm, in")
      ->transform(unit_of_length());
  command->add_option("--camera-unit", options->camera_unit, "of the poses in OpenCV's files")
      ->transform(unit_of_length());
  command->add_option("--mesh-unit", options->mesh_unit, "of mesh and scene files")
      ->transform(unit_of_length());
  command->add_flag("--skip-behind", options->skip_behind,
                    "leave out points that the camera cannot image instead of refusing them");
  command->add_flag("--json", options->json, "summary as JSON");
  command->callback([options, &chosen] { chosen = [options] { return superimpose(*options); }; });
}

}  // namespace sightline::cli
