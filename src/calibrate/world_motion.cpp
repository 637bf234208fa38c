// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "calibrate/solve/corner_at_set.hpp"
#include "calibrate/solve/target_pose.hpp"
#include "sightline/calibrate/place_world.hpp"
#include "sightline/geometry/triangulation.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr size_t kFewestPlaces = 5, kFewestCorners = 6;
constexpr double kShortest = 0.05;  // [m]
constexpr double kWorstSigma_deg = 0.5;
constexpr double kMostBow = 0.005;   // of the way; at its ends that is one degree
constexpr double kMostStray = 0.02;  // RMS, of the way
constexpr double kOneWay = 0.8;      // correlation with the order
constexpr double kNearUp_deg = 20;
constexpr double kWorstScale = 0.02;
constexpr double kHanging = 0.5;  // of a camera's upward direction

/// A view of one set, its corners where they were at the set's time.
struct Sight {
  const CalibratedCamera* camera;
  TargetView view;
};

std::vector<std::vector<Sight>> sights_by_set(const CalibrationViews& views,
                                              const std::vector<CalibratedCamera>& cameras) {
  std::vector<std::vector<Sight>> sets(views.sets);
  for (const TargetView& view : views.views) {
    const auto camera =
        std::ranges::find(cameras, views.cameras[view.camera].name, &CalibratedCamera::name);
    if (camera == cameras.end()) continue;
    Sight sight{&*camera, view};
    for (TargetCorner& corner : sight.view.corners) {
      corner.pixel = pixel_at_set(view, corner, *camera);
    }
    // The first of several targets is the one that is moved.
    std::erase_if(sight.view.corners, [&](const TargetCorner& corner) {
      return corner.id >= views.target.own_corner_count();
    });
    if (sight.view.corners.size() >= kFewestCorners) sets[view.set].push_back(std::move(sight));
  }
  return sets;
}

std::optional<Rigid3> triangulated_pose(const CalibrationTarget& target,
                                        const std::vector<Sight>& sights) {
  std::map<int, std::vector<PointSight>> by_corner;
  for (const Sight& sight : sights) {
    for (const TargetCorner& corner : sight.view.corners) {
      by_corner[corner.id].push_back({sight.camera, corner.pixel, 0.5});
    }
  }
  std::vector<Eigen::Vector3d> from, to;
  for (const auto& [id, rays] : by_corner) {
    if (rays.size() < 2) continue;
    const auto point = triangulate(rays);
    if (!point) continue;
    from.emplace_back(target.corner(id).x(), target.corner(id).y(), 0);
    to.push_back(point->point_in_world);
  }
  if (from.size() < kFewestCorners) return std::nullopt;
  const auto count = static_cast<Eigen::Index>(from.size());
  const Eigen::Map<const Eigen::Matrix3Xd> a(from.front().data(), 3, count);
  const Eigen::Map<const Eigen::Matrix3Xd> b(to.front().data(), 3, count);
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, false);
  return Rigid3(Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>())),
                m.topRightCorner<3, 1>());
}

std::optional<Rigid3> single_pose(const CalibrationTarget& target,
                                  const std::vector<Sight>& sights) {
  const auto best = std::ranges::max_element(
      sights, {}, [](const Sight& sight) { return sight.view.corners.size(); });
  const CameraModel& lens = best->camera->model;
  const auto pose = target_pose(target, Eigen::Vector2d::Zero(), lens.parameters().lens,
                                lens_vector(lens), best->view);
  if (!pose) return std::nullopt;
  return best->camera->world_from_camera * pose->camera_from_target;
}

/// Where the middle of the target was, set by set.
std::vector<Eigen::Vector3d> places_of(const CalibrationViews& views,
                                       const std::vector<CalibratedCamera>& cameras) {
  const Eigen::Vector2d middle = views.target.size() / 2;
  std::vector<Eigen::Vector3d> places;
  for (const std::vector<Sight>& sights : sights_by_set(views, cameras)) {
    if (sights.empty()) continue;
    auto pose = triangulated_pose(views.target, sights);
    if (!pose) pose = single_pose(views.target, sights);
    if (pose) places.push_back(*pose * Eigen::Vector3d(middle.x(), middle.y(), 0));
  }
  return places;
}

/// A straight line through places, and how far they are from one.
struct Line {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< the way they went
  double travel = 0, rms = 0;                            ///< [m]
  double sigma_rad = 0;                                  ///< of the direction, about either axis
  double bow = 0, bow_sigma = 0;                         ///< of an arc through them [m]
  double one_way = 0;                                    ///< correlation of way and order
};

Line fit_line(const std::vector<Eigen::Vector3d>& places) {
  const auto n = static_cast<Eigen::Index>(places.size());
  const Eigen::Map<const Eigen::Matrix3Xd> points(places.front().data(), 3, n);
  const Eigen::Matrix3Xd spread = points.colwise() - points.rowwise().mean();
  const Eigen::JacobiSVD<Eigen::Matrix3Xd> svd(spread, Eigen::ComputeFullU);
  Eigen::Matrix3d axes = svd.matrixU();
  Line line;
  const Eigen::VectorXd order = Eigen::VectorXd::LinSpaced(n, -0.5 * static_cast<double>(n - 1),
                                                           0.5 * static_cast<double>(n - 1));
  Eigen::VectorXd along = spread.transpose() * axes.col(0);
  const double agreement = along.dot(order);
  line.one_way = std::abs(agreement) / std::max(1e-12, along.norm() * order.norm());
  if (agreement < 0) {
    axes.col(0) *= -1;
    along *= -1;
  }
  line.direction = axes.col(0);
  line.travel = along.maxCoeff() - along.minCoeff();
  const Eigen::MatrixX2d beside = spread.transpose() * axes.rightCols<2>();
  line.rms = std::sqrt(beside.squaredNorm() / static_cast<double>(n));
  // Two parameters of a line for each of two axes, three of an arc.
  const double free_of_line = 2 * static_cast<double>(n) - 4;
  line.sigma_rad = std::sqrt(beside.squaredNorm() / free_of_line / along.squaredNorm());
  Eigen::MatrixX3d arc(n, 3);
  arc << Eigen::VectorXd::Ones(n), along, along.cwiseAbs2();
  const Eigen::Matrix3d inverse = (arc.transpose() * arc).inverse();
  const Eigen::Matrix<double, 3, 2> fitted = inverse * arc.transpose() * beside;
  const double left = (beside - arc * fitted).squaredNorm() / (free_of_line - 2);
  const double quarter = 0.25 * line.travel * line.travel;
  line.bow = fitted.row(2).norm() * quarter;
  line.bow_sigma = std::sqrt(left * inverse(2, 2)) * quarter;
  return line;
}

Status check(const std::vector<Eigen::Vector3d>& places, const Line& line) {
  const auto refuse = [](const std::string& words) {
    return make_error(ErrorCode::kInvalidInput, "motion", "{}", words);
  };
  const double mm = 1e3 * line.travel;
  if (line.travel < kShortest) {
    return refuse(
        fmt::format("the target was moved by {:.1f} mm only, {:.0f} mm or more are needed", mm,
                    1e3 * kShortest));
  }
  if (line.one_way < kOneWay) {
    return refuse(
        fmt::format("the target went back and forth over {:.0f} mm: which way is the axis? Move it "
                    "one way, and stop there",
                    mm));
  }
  if (line.bow > kMostBow * line.travel && line.bow > 3 * line.bow_sigma) {
    return refuse(
        fmt::format("the way is curved: an arc that rises by {:.1f} mm over {:.0f} mm; guide the "
                    "target along something straight",
                    1e3 * line.bow, mm));
  }
  if (line.rms > kMostStray * line.travel) {
    return refuse(
        fmt::format("the way is not straight: {:.1f} mm RMS beside a line of {:.0f} mm; guide the "
                    "target along something straight",
                    1e3 * line.rms, mm));
  }
  if (line.sigma_rad > kWorstSigma_deg * kDegree) {
    return refuse(
        fmt::format("{:.0f} mm in {} places are too little: the direction is known to {:.1f} deg "
                    "only; move the target farther",
                    mm, places.size(), line.sigma_rad / kDegree));
  }
  return {};
}

/// Columns: the new axes in the world of before.
Result<Eigen::Matrix3d> axes_along(const Eigen::Vector3d& along, int index) {
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  // What stays as near as it can: z, or x if z is the one that is given.
  const int kept = index == 2 ? 0 : 2;
  Eigen::Vector3d keep = index == 2 ? Eigen::Vector3d::UnitX() : up;
  const double from_up = std::acos(std::min(1.0, std::abs(along.dot(up)))) / kDegree;
  if (index != 2 && from_up < kNearUp_deg) {
    return make_error(ErrorCode::kInvalidInput, "motion",
                      "goes {:.0f} deg from the world's z: {} cannot be that; --motion z, or place "
                      "the floor first",
                      from_up, index == 0 ? "x" : "y");
  }
  if (std::abs(along.dot(keep)) > 0.99) keep = Eigen::Vector3d::UnitY();
  Eigen::Matrix3d axes;
  axes.col(index) = along;
  axes.col(kept) = (keep - along.dot(keep) * along).normalized();
  const int third = 3 - index - kept;
  axes.col(third) = axes.col((third + 1) % 3).cross(axes.col((third + 2) % 3));
  return axes;
}

}  // namespace

Result<WorldAxis> parse_world_axis(std::string_view text) {
  WorldAxis axis;
  std::string_view name = text;
  if (name.starts_with('-')) {
    axis.sign = -1;
    name.remove_prefix(1);
  }
  constexpr std::string_view kNames = "xyz";
  const size_t index = name.size() == 1 ? kNames.find(name.front()) : std::string_view::npos;
  if (index == std::string_view::npos) {
    return make_error(ErrorCode::kInvalidInput, "--motion", "'{}' is not x, y, z, -x, -y or -z",
                      text);
  }
  axis.index = static_cast<int>(index);
  return axis;
}

Result<MotionPlacement> world_of_motion(const CalibrationViews& views,
                                        const std::vector<CalibratedCamera>& cameras,
                                        WorldAxis axis, std::optional<double> length) {
  SL_RETURN_IF_ERROR(check_views(views));
  const std::vector<Eigen::Vector3d> places = places_of(views, cameras);
  if (places.size() < kFewestPlaces) {
    return make_error(ErrorCode::kInvalidInput, "motion",
                      "the cameras of the calibration saw the target at {} places, {} or more are "
                      "needed",
                      places.size(), kFewestPlaces);
  }
  const Line line = fit_line(places);
  SL_RETURN_IF_ERROR(check(places, line));
  const double scale = length ? *length / line.travel : 1;
  if (std::abs(scale - 1) > kWorstScale) {
    return make_error(ErrorCode::kInvalidInput, "motion",
                      "the rig measures {:.1f} mm, not {:.1f}: wrong units, or the target's "
                      "squares are not the size that its file says",
                      1e3 * line.travel, 1e3 * *length);
  }
  SL_ASSIGN(const Eigen::Matrix3d axes, axes_along(axis.sign * line.direction, axis.index));
  const Rigid3 old_from_new(Eigen::Quaterniond(axes), Eigen::Vector3d::Zero());
  MotionPlacement out{cameras,
                      places.size(),
                      line.travel,
                      1e3 * line.rms,
                      line.sigma_rad / kDegree,
                      std::acos(std::clamp(axes(2, 2), -1.0, 1.0)) / kDegree};
  for (CalibratedCamera& c : out.cameras) {
    c.world_from_camera = old_from_new.inverse() * c.world_from_camera;
    if (c.axes) c.axes->world_from_base = old_from_new.inverse() * c.axes->world_from_base;
  }
  const auto hanging = std::ranges::count_if(out.cameras, [](const CalibratedCamera& c) {
    return (c.world_from_camera.rotation * Eigen::Vector3d::UnitY()).z() > kHanging;
  });
  if (axis.index == 2 && 2 * static_cast<size_t>(hanging) > cameras.size()) {
    return make_error(ErrorCode::kInvalidInput, "motion",
                      "{} of {} cameras would hang upside down: was the target moved downwards "
                      "(--motion={})?",
                      hanging, cameras.size(), axis.sign > 0 ? "-z" : "z");
  }
  return out;
}

}  // namespace sightline
