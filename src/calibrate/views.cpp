// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/views.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "sightline/calibrate/target_file.hpp"

namespace sightline {
namespace {

template <typename... Args>
Error refuse(std::string where, fmt::format_string<Args...> format, Args&&... args) {
  return make_error(ErrorCode::kInvalidInput, std::move(where), format,
                    std::forward<Args>(args)...);
}

std::string place(const CalibrationViews& views, const TargetView& view) {
  std::string where = "camera " + views.cameras[view.camera].name;
  if (!view.source.empty()) where += ", " + view.source;
  return where;
}

/// Sign of the linear part of the affine map from the target to the image.
double handedness(const CalibrationTarget& target, const TargetView& view) {
  Eigen::Vector2d mean_target = Eigen::Vector2d::Zero(), mean_pixel = Eigen::Vector2d::Zero();
  const double n = static_cast<double>(view.corners.size());
  for (const TargetCorner& c : view.corners) {
    mean_target += target.corner(c.id) / n;
    mean_pixel += c.pixel / n;
  }
  Eigen::Matrix2d cross = Eigen::Matrix2d::Zero();
  for (const TargetCorner& c : view.corners) {
    cross += (c.pixel - mean_pixel) * (target.corner(c.id) - mean_target).transpose();
  }
  return cross.determinant();
}

Status check_view(const CalibrationViews& all, const TargetView& view) {
  if (view.camera >= all.cameras.size() || view.set >= all.sets) {
    return refuse("", "a view names camera {} of {} and set {} of {}", view.camera,
                  all.cameras.size(), view.set, all.sets);
  }
  if (!std::isfinite(view.delay_s)) {
    return refuse(place(all, view), "its time is not a finite number");
  }
  const ViewedCamera& camera = all.cameras[view.camera];
  std::set<int> ids;
  for (const TargetCorner& c : view.corners) {
    if (c.id < 0 || c.id >= all.target.corner_count()) {
      return refuse(place(all, view), "corner {} is not one of the {} of a {}", c.id,
                    all.target.corner_count(), all.target.describe());
    }
    if (!ids.insert(c.id).second) return refuse(place(all, view), "corner {} is there twice", c.id);
    if (!c.pixel.allFinite() || !c.px_per_s.allFinite() || !c.px_per_s2.allFinite()) {
      return refuse(place(all, view), "corner {} is not a finite number (NaN or infinite)", c.id);
    }
    if (c.pixel.x() < -0.5 || c.pixel.y() < -0.5 || c.pixel.x() > camera.width - 0.5 ||
        c.pixel.y() > camera.height - 0.5) {
      return refuse(
          place(all, view),
          "corner {} at ({:.1f}, {:.1f}) lies outside the image of {}x{}: is it the image "
          "size of this camera?",
          c.id, c.pixel.x(), c.pixel.y(), camera.width, camera.height);
    }
  }
  return {};
}

/// A print seen from its front has its corners turning one way; one view may be an accident.
Status check_handedness(const CalibrationViews& all) {
  std::vector<int> right(all.cameras.size(), 0), wrong(all.cameras.size(), 0);
  for (const TargetView& view : all.views) {
    if (view.corners.size() < 4) continue;
    const double sign = handedness(all.target, view);
    (sign > 0 ? right : wrong)[view.camera] += sign != 0;
  }
  for (size_t c = 0; c < all.cameras.size(); ++c) {
    if (wrong[c] == 0 || wrong[c] <= right[c]) continue;
    return refuse("camera " + all.cameras[c].name,
                  "mirrored: in {} of {} views the corners run the other way round, as if the "
                  "target were seen from behind. Switch off the mirror image of the camera, or the "
                  "print (or its target file) is flipped",
                  wrong[c], wrong[c] + right[c]);
  }
  return {};
}

}  // namespace

Status check_views(const CalibrationViews& views) {
  std::set<std::string> names;
  for (const ViewedCamera& camera : views.cameras) {
    if (camera.images > 0 && (camera.width < 1 || camera.height < 1)) {
      return refuse("camera " + camera.name, "its image size is not known");
    }
    if (!names.insert(camera.name).second) {
      return refuse("camera " + camera.name, "two cameras have this name");
    }
  }
  std::set<std::pair<size_t, size_t>> seen;
  for (const TargetView& view : views.views) {
    SL_RETURN_IF_ERROR(check_view(views, view));
    if (!seen.insert({view.camera, view.set}).second) {
      return refuse(place(views, view), "has two views in set {}", view.set);
    }
  }
  return check_handedness(views);
}

std::vector<size_t> linked_groups(const CalibrationViews& views, size_t min_corners) {
  std::vector<size_t> group(views.cameras.size());
  std::iota(group.begin(), group.end(), size_t{0});
  std::vector<size_t> first(views.sets, SIZE_MAX);
  for (const TargetView& view : views.views) {
    if (view.corners.size() < min_corners) continue;
    if (first[view.set] == SIZE_MAX) first[view.set] = view.camera;
    const size_t a = group[first[view.set]], b = group[view.camera];
    std::replace(group.begin(), group.end(), std::max(a, b), std::min(a, b));
  }
  return group;
}

}  // namespace sightline
