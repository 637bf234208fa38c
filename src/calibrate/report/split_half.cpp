// SPDX-License-Identifier: Apache-2.0
#include "calibrate/report/split_half.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calibrate/report/rig_bundle.hpp"

namespace sightline::calibrate {
namespace {

constexpr int kColumns = 16, kRows = 12;

/// part_from_whole: the rigid motion that brings the target's corners of one solution onto those of
/// the other (Umeyama, 1991, without scale).
Rigid3 overlay(const CalibrationViews& views, const RigSolution& whole, const RigSolution& part) {
  std::vector<Eigen::Vector3d> from, to;
  const int last = views.target.corner_count() - 1;
  for (size_t set = 0; set < views.sets; ++set) {
    if (!whole.world_from_target[set] || !part.world_from_target[set]) continue;
    for (const int id : {0, last / 3, 2 * last / 3, last}) {
      const Eigen::Vector2d at = views.target.corner(id);
      from.push_back(*whole.world_from_target[set] * Eigen::Vector3d(at.x(), at.y(), 0));
      to.push_back(*part.world_from_target[set] * Eigen::Vector3d(at.x(), at.y(), 0));
    }
  }
  if (from.size() < 4) return {};
  const auto count = static_cast<Eigen::Index>(from.size());
  const Eigen::Map<const Eigen::Matrix3Xd> a(from.front().data(), 3, count);
  const Eigen::Map<const Eigen::Matrix3Xd> b(to.front().data(), 3, count);
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, false);
  return {Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>())), m.topRightCorner<3, 1>()};
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Where the two show a point that `a` shows at `pixel`, so far away [px between].
double difference_at(const CalibratedCamera& in_a, const CalibratedCamera& in_b,
                     const Rigid3& b_from_a, const Eigen::Vector2d& pixel, double distance) {
  const auto ray = in_a.model.unproject(pixel);
  if (!ray) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::Vector3d point = in_a.world_from_camera * Eigen::Vector3d(*ray * distance);
  const auto other = in_b.model.project(in_b.world_from_camera.inverse() * (b_from_a * point));
  return other ? (*other - pixel).norm() : std::numeric_limits<double>::quiet_NaN();
}

void fill_map(const CalibratedCamera& in_a, const CalibratedCamera& in_b, const Rigid3& b_from_a,
              double distance, SplitHalf& half) {
  half.columns = kColumns;
  half.rows = kRows;
  const double width = in_a.model.width() - 1, height = in_a.model.height() - 1;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      half.px.push_back(difference_at(
          in_a, in_b, b_from_a, {width * column / (kColumns - 1.0), height * row / (kRows - 1.0)},
          distance));
    }
  }
}

}  // namespace

CalibrationViews half_of(const CalibrationViews& views, const RigSolution& solution, bool odd,
                         std::vector<char>& sets) {
  sets.assign(views.sets, 0);
  bool turn = false;
  for (size_t set = 0; set < views.sets; ++set) {
    if (!solution.world_from_target[set]) continue;
    sets[set] = turn == odd;
    turn = !turn;
  }
  // A target that stands in the room has one set for all time: both halves need it, and neither is
  // tested with it.
  CalibrationViews half = views;
  std::erase_if(half.views, [&](const TargetView& view) {
    const bool fixed = !view.corners.empty() && views.target.part(view.corners[0].id).fixed;
    if (fixed) sets[view.set] = 0;
    return !fixed && !sets[view.set];
  });
  return half;
}

std::vector<SplitHalf> compare(const CalibrationViews& views, const RigSolution& whole,
                               const RigSolution& a, const RigSolution& b) {
  const Rigid3 a_from_whole = overlay(views, whole, a), b_from_whole = overlay(views, whole, b);
  std::vector<SplitHalf> out;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    const CalibratedCamera &in_a = a.cameras[c].camera, &in_b = b.cameras[c].camera;
    SplitHalf half;
    half.center_mm = 1e3 * translation_distance(in_a.world_from_camera, in_b.world_from_camera);
    half.rotation_deg =
        rotation_angle(in_a.world_from_camera, in_b.world_from_camera) * 180 / std::numbers::pi;
    std::vector<double> px, mm, distances;
    for (const TargetView& view : views.views) {
      if (view.camera != c || !whole.world_from_target[view.set]) continue;
      for (const TargetCorner& corner : view.corners) {
        const Eigen::Vector2d at = views.target.corner(corner.id);
        const Eigen::Vector3d point =
            *whole.world_from_target[view.set] * Eigen::Vector3d(at.x(), at.y(), 0);
        const Eigen::Vector3d point_in_a =
            in_a.world_from_camera.inverse() * (a_from_whole * point);
        const auto pixel_a = in_a.model.project(point_in_a);
        const auto pixel_b =
            in_b.model.project(in_b.world_from_camera.inverse() * (b_from_whole * point));
        if (!pixel_a || !pixel_b) continue;
        px.push_back((*pixel_a - *pixel_b).norm());
        distances.push_back(point_in_a.norm());
        mm.push_back(1e3 * px.back() * distances.back() / in_a.model.parameters().fx);
      }
    }
    if (!px.empty()) {
      half.worst_px = *std::max_element(px.begin(), px.end());
      half.worst_mm = *std::max_element(mm.begin(), mm.end());
      fill_map(in_a, in_b, b_from_whole * a_from_whole.inverse(), median(std::move(distances)),
               half);
    }
    half.median_px = median(std::move(px));
    half.median_mm = median(std::move(mm));
    out.push_back(half);
  }
  return out;
}

}  // namespace sightline::calibrate
