// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/camera_file.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/record/overlay_video.hpp"
#include "sightline/record/still_picture.hpp"
#include "sightline/render/point_marks.hpp"
#include "superimpose.hpp"

namespace sightline::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr Rgb kMarkerColor{70, 225, 120};
constexpr float kMarkerWidth = 2;
constexpr double kMarkerMargin = 8;  // px between the points and the marker
constexpr double kDepthTolerance = 0.01;

struct Outcome {
  std::vector<PointFile> files;
  std::vector<SuperimposedPoint> points;
  std::shared_ptr<Picture> picture;
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

Result<CalibratedCamera> read_target(const SuperimposeOptions& options, const Picture& picture) {
  CameraFileDefaults defaults{picture.width(), picture.height(), options.camera_unit};
  SL_ASSIGN(CalibratedCamera camera, read_camera(options.to, defaults));
  if (camera.model.width() == picture.width() && camera.model.height() == picture.height()) {
    return camera;
  }
  return make_error(ErrorCode::kInvalidInput, options.image.string(),
                    "is {} x {} pixels, but {} was calibrated at {} x {}: use the picture as the "
                    "camera gave it, or a calibration of this size",
                    picture.width(), picture.height(), options.to, camera.model.width(),
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

// 7 numbers as in pose logs (tx ty tz qw qx qy qz), or 6 as OpenCV gives them (rvec, tvec).
Result<Rigid3> parse_pose(const std::vector<double>& n) {
  if (n.size() == 6) {
    Vector6 tangent = Vector6::Zero();
    tangent.head<3>() = Eigen::Vector3d(n[0], n[1], n[2]);
    return Rigid3(Rigid3::exp(tangent).rotation, {n[3], n[4], n[5]});
  }
  if (n.size() != 7) {
    return wrong_usage(fmt::format(
        "--pose has {} numbers; give 7 (tx ty tz qw qx qy qz) or 6 (rvec and tvec)", n.size()));
  }
  const Eigen::Quaterniond q(n[3], n[4], n[5], n[6]);
  if (!(std::abs(q.norm() - 1) < 1e-2)) {
    return wrong_usage(fmt::format(
        "--pose: the quaternion qw qx qy qz has length {:.3f}, not 1: are the numbers in order?",
        q.norm()));
  }
  return Rigid3(q, {n[0], n[1], n[2]});
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
    if (point.in_picture()) pixels.push_back(point.pixel);
  }
  const MutableI420View view = outcome.picture->mutable_view();
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
    SL_ASSIGN(const Rigid3 pose, parse_pose(options.pose));
    SL_ASSIGN(const OverlayStyle style, mesh_style(options.style));
    const PlacedMesh object{std::move(mesh), world_from_points * pose};
    SL_RETURN_IF_ERROR(draw_placed_mesh(object, scene, camera, rays, style, *outcome.picture));
    surfaces.push_back(object);
  }
  hide_points(surfaces, camera, rays, kDepthTolerance, outcome.points);
  draw_superimposed(outcome.files, outcome.points, *outcome.picture);
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
  SL_ASSIGN(const auto image, read_picture(options.image));
  SL_ASSIGN(const CalibratedCamera camera, read_target(options, *image));
  SL_ASSIGN(const Rigid3 world_from_points, frame_of(options, camera));
  Outcome outcome;
  for (const std::string& argument : options.points) {
    SL_ASSIGN(PointFile file, read_point_file(argument, options.points_unit));
    outcome.files.push_back(std::move(file));
  }
  SL_ASSIGN(outcome.points,
            superimpose_points(outcome.files, world_from_points, camera, options.skip_behind));
  outcome.picture = std::make_shared<Picture>(image->width(), image->height());
  copy_i420(image->view(), outcome.picture->mutable_view());
  SL_RETURN_IF_ERROR(draw_all(options, camera, world_from_points, outcome));
  SL_RETURN_IF_ERROR(write_png(options.out, outcome.picture->view()));
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

}  // namespace

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

}  // namespace sightline::cli
