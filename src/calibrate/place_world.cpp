// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/place_world.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include "calibrate/solve/target_pose.hpp"
#include "sightline/geometry/triangulation.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kWorstScale = 0.02;
constexpr std::string_view kHeader = "x,y,z,camera,u,v";

std::vector<CalibratedCamera> moved(const std::vector<CalibratedCamera>& cameras,
                                    const Rigid3& new_from_old) {
  std::vector<CalibratedCamera> out = cameras;
  for (CalibratedCamera& c : out) {
    c.world_from_camera = new_from_old * c.world_from_camera;
    if (c.axes) c.axes->world_from_base = new_from_old * c.axes->world_from_base;
  }
  return out;
}

Result<double> number(std::string_view field, const std::string& where, size_t line) {
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error == std::errc() && end == field.data() + field.size() && std::isfinite(value)) {
    return value;
  }
  return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where, line),
                    "'{}' is not a number", field);
}

/// Rigid motion from points to points, and the scale that was left out.
struct Overlay {
  Rigid3 to_from;
  double scale = 1, rms = 0;
};
Overlay overlay(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
  const Eigen::Matrix4d m = Eigen::umeyama(from, to, false);
  Overlay out;
  out.to_from = Rigid3(Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>())),
                       m.topRightCorner<3, 1>());
  const Eigen::Matrix4d scaled = Eigen::umeyama(from, to, true);
  out.scale = std::cbrt(scaled.topLeftCorner<3, 3>().determinant());
  double sum = 0;
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    sum += (out.to_from * Eigen::Vector3d(from.col(i)) - to.col(i)).squaredNorm();
  }
  out.rms = std::sqrt(sum / static_cast<double>(from.cols()));
  return out;
}

}  // namespace

Result<std::vector<SurveyedSight>> parse_surveyed_points(std::string_view text,
                                                         const std::string& where) {
  std::vector<SurveyedSight> sights;
  for (size_t line = 1; !text.empty(); ++line) {
    const size_t end = text.find('\n');
    std::string_view row = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    if (row.ends_with('\r')) row.remove_suffix(1);
    if (line == 1 && row != kHeader) {
      return make_error(ErrorCode::kInvalidInput, where + ":1", "the header must be '{}'", kHeader);
    }
    if (line == 1 || row.empty() || row.front() == '#') continue;
    std::vector<std::string_view> fields;
    for (std::string_view rest = row;;) {
      const size_t comma = rest.find(',');
      fields.push_back(rest.substr(0, comma));
      if (comma == std::string_view::npos) break;
      rest = rest.substr(comma + 1);
    }
    if (fields.size() != 6) {
      return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where, line),
                        "has {} fields, not '{}'", fields.size(), kHeader);
    }
    SurveyedSight sight;
    sight.camera = fields[3];
    for (int i = 0; i < 3; ++i) {
      SL_ASSIGN(sight.point_in_world[i], number(fields[static_cast<size_t>(i)], where, line));
    }
    SL_ASSIGN(sight.pixel.x(), number(fields[4], where, line));
    SL_ASSIGN(sight.pixel.y(), number(fields[5], where, line));
    sights.push_back(std::move(sight));
  }
  return sights;
}

Result<WorldPlacement> world_of_target(const CalibrationViews& views,
                                       const std::vector<CalibratedCamera>& cameras) {
  SL_RETURN_IF_ERROR(check_views(views));
  const TargetView* best = nullptr;
  const CalibratedCamera* camera = nullptr;
  for (const TargetView& view : views.views) {
    const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const CalibratedCamera& c) {
      return c.name == views.cameras[view.camera].name;
    });
    if (found == cameras.end() || view.corners.size() < 6) continue;
    const bool better = best == nullptr || view.set < best->set ||
                        (view.set == best->set && view.corners.size() > best->corners.size());
    if (!better) continue;
    best = &view;
    camera = &*found;
  }
  if (best == nullptr) {
    return make_error(ErrorCode::kInvalidInput, views.target.name,
                      "no camera of the calibration sees the target on the floor");
  }
  const auto pose = target_pose(views.target, Eigen::Vector2d::Zero(),
                                camera->model.parameters().lens, lens_vector(camera->model), *best);
  if (!pose) {
    return make_error(ErrorCode::kInvalidInput, "camera " + camera->name,
                      "the corners do not fit a {}", views.target.describe());
  }
  // From x right, y down, z into the print to x right, y up, z out of it: half a turn about x.
  const Rigid3 target_from_world(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  const Rigid3 old_from_new =
      camera->world_from_camera * pose->camera_from_target * target_from_world;
  WorldPlacement out{moved(cameras, old_from_new.inverse()), best->corners.size(), 0, 1};
  const auto below = std::count_if(out.cameras.begin(), out.cameras.end(), [](const auto& c) {
    return c.world_from_camera.translation.z() < 0;
  });
  if (2 * static_cast<size_t>(below) > cameras.size()) {
    return make_error(ErrorCode::kInvalidInput, "camera " + camera->name,
                      "{} of {} cameras would be below the floor: does the target lie face up?",
                      below, cameras.size());
  }
  return out;
}

Result<WorldPlacement> world_of_points(const std::vector<SurveyedSight>& sights,
                                       const std::vector<CalibratedCamera>& cameras) {
  std::map<std::array<double, 3>, std::vector<PointSight>> by_point;
  for (const SurveyedSight& sight : sights) {
    const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const CalibratedCamera& c) {
      return c.name == sight.camera;
    });
    if (found == cameras.end()) {
      return make_error(ErrorCode::kInvalidInput, "camera " + sight.camera,
                        "is not in the calibration");
    }
    const Eigen::Vector3d& p = sight.point_in_world;
    by_point[{p.x(), p.y(), p.z()}].push_back({&*found, sight.pixel, 0.5});
  }
  std::vector<Eigen::Vector3d> from, to;
  for (const auto& [point, rays] : by_point) {
    if (rays.size() < 2) continue;
    SL_ASSIGN(const TriangulatedPoint found, triangulate(rays));
    from.push_back(found.point_in_world);
    to.emplace_back(point[0], point[1], point[2]);
  }
  if (from.size() < 3) {
    return make_error(ErrorCode::kInvalidInput, "points",
                      "{} points are seen by two cameras; three or more are needed, not on a line",
                      from.size());
  }
  const auto count = static_cast<Eigen::Index>(from.size());
  const Eigen::Map<const Eigen::Matrix3Xd> a(from.front().data(), 3, count);
  const Eigen::Map<const Eigen::Matrix3Xd> b(to.front().data(), 3, count);
  const Eigen::Matrix3Xd spread = b.colwise() - b.rowwise().mean();
  const Eigen::Vector3d extents = Eigen::JacobiSVD<Eigen::Matrix3Xd>(spread).singularValues();
  if (extents[1] < 0.01 * extents[0]) {
    return make_error(ErrorCode::kInvalidInput, "points",
                      "lie on a line: a turn about it is not determined");
  }
  const Overlay fit = overlay(a, b);
  if (std::abs(fit.scale - 1) > kWorstScale) {
    return make_error(ErrorCode::kInvalidInput, "points",
                      "the world is {:.4f} times as large as the rig measures it: wrong units, or "
                      "the target's squares are not the size that its file says",
                      fit.scale);
  }
  return WorldPlacement{moved(cameras, fit.to_from), from.size(), 1e3 * fit.rms, fit.scale};
}

}  // namespace sightline
