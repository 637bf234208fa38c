// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/refusals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calibrate/solve/covariance.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kLeastSpreadDeg = 8;     // between the planes of a camera's views
constexpr double kLeastDepthRatio = 1.2;  // of the corners of a camera's views, farthest to nearest
constexpr double kWorstFocalSigma = 0.05;
constexpr double kWorstFit = 0.02;  // RMS over the longer side of the image
constexpr double kExchanged = 3;    // own error over another lens's
constexpr double kPoorFitPx = 1.5;  // below it nobody is accused of anything

template <typename... Args>
Error refuse(std::string where, fmt::format_string<Args...> format, Args&&... args) {
  return make_error(ErrorCode::kInvalidInput, std::move(where), format,
                    std::forward<Args>(args)...);
}

std::vector<size_t> view_counts(const CalibrationViews& views, size_t min_corners) {
  std::vector<size_t> counts(views.cameras.size(), 0);
  for (const TargetView& view : views.views)
    counts[view.camera] += view.corners.size() >= min_corners;
  return counts;
}

bool is_known(const SolveOptions& options, size_t camera) {
  return !options.cameras.empty() && options.cameras[camera].known.has_value();
}

Status check_sizes(const CalibrationViews& views, const SolveOptions& options) {
  if (!options.cameras.empty() && options.cameras.size() != views.cameras.size()) {
    return refuse("", "{} cameras are described, {} took part", options.cameras.size(),
                  views.cameras.size());
  }
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    if (!is_known(options, c)) continue;
    const CameraModel& known = *options.cameras[c].known;
    const ViewedCamera& seen = views.cameras[c];
    if (known.width() == seen.width && known.height() == seen.height) continue;
    return refuse(camera_place(views, c),
                  "its images are {}x{}, but its known lens is for {}x{}: a lens belongs to one "
                  "image size; take images of that size, or solve for the lens",
                  seen.width, seen.height, known.width(), known.height());
  }
  return {};
}

/// A camera of the main group that saw the target nearest (in sets) to when `camera` did.
std::string advice_to_link(const CalibrationViews& views, const std::vector<size_t>& group,
                           size_t camera) {
  size_t nearest = SIZE_MAX, other = 0;
  for (const TargetView& a : views.views) {
    if (a.camera != camera) continue;
    for (const TargetView& b : views.views) {
      if (group[b.camera] == group[camera]) continue;
      const size_t apart = a.set > b.set ? a.set - b.set : b.set - a.set;
      if (apart < nearest) {
        nearest = apart;
        other = b.camera;
      }
    }
  }
  return fmt::format("show the target to {} and {} at the same time, in a few poses",
                     views.cameras[camera].name, views.cameras[other].name);
}

Status check_links(const CalibrationViews& views, const SolveOptions& options) {
  const std::vector<size_t> group = linked_groups(views, options.min_corners);
  for (size_t c = 0; c < group.size(); ++c) {
    if (group[c] == group[options.reference]) continue;
    std::string alone;
    for (size_t i = 0; i < group.size(); ++i) {
      if (group[i] == group[c]) alone += (alone.empty() ? "" : ", ") + views.cameras[i].name;
    }
    return refuse(
        camera_place(views, c),
        "not linked: {} never saw the target together with camera {}, directly or through "
        "others; {}",
        alone, views.cameras[options.reference].name, advice_to_link(views, group, c));
  }
  return {};
}

/// Largest angle between two of the target's planes [deg].
double plane_spread_deg(const Bundle& bundle) {
  double least = 1;
  for (const BundleView& a : bundle.views) {
    const Eigen::Vector3d na = bundle.world_from_target[a.set].rotation * Eigen::Vector3d::UnitZ();
    for (const BundleView& b : bundle.views) {
      const Eigen::Vector3d nb =
          bundle.world_from_target[b.set].rotation * Eigen::Vector3d::UnitZ();
      least = std::min(least, na.dot(nb));
    }
  }
  return std::acos(std::clamp(least, -1.0, 1.0)) * 180 / std::numbers::pi;
}

/// Farthest corner over the nearest one, along the camera's axis.
double depth_ratio(const Bundle& bundle) {
  double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
  for (const BundleView& view : bundle.views) {
    for (const TargetCorner& corner : view.view->corners) {
      const Eigen::Vector2d at = bundle.target->corner(corner.id);
      const double z =
          (bundle.world_from_target[view.set] * Eigen::Vector3d(at.x(), at.y(), 0)).norm();
      nearest = std::min(nearest, z);
      farthest = std::max(farthest, z);
    }
  }
  return farthest / nearest;
}

}  // namespace

std::string camera_place(const CalibrationViews& views, size_t camera) {
  return "camera " + views.cameras[camera].name;
}

Status check_inputs(const CalibrationViews& views, const SolveOptions& options) {
  SL_RETURN_IF_ERROR(check_views(views));
  if (views.cameras.empty()) return refuse("", "no camera to calibrate");
  SL_CHECK(options.reference < views.cameras.size(), "the reference camera is one of the cameras");
  SL_RETURN_IF_ERROR(check_sizes(views, options));
  if (views.cameras.size() > 1 && views.target.same_after_half_turn()) {
    return refuse(views.target.name,
                  "a {} looks the same after half a turn, so that two cameras cannot agree on its "
                  "corners: use one with an odd and an even number of squares, or a ChArUco board",
                  views.target.describe());
  }
  const std::vector<size_t> counts = view_counts(views, options.min_corners);
  for (size_t c = 0; c < counts.size(); ++c) {
    const size_t needed = is_known(options, c) ? 2 : options.min_views;
    if (counts[c] >= needed) continue;
    return refuse(
        camera_place(views, c),
        "too few views: the target was found in {} of {} images with at least {} corners, "
        "{} are needed ({} make a good calibration); show it the {} in more poses",
        counts[c], views.cameras[c].images, options.min_corners, needed, 20,
        views.target.describe());
  }
  return check_links(views, options);
}

Status check_camera(const CalibrationViews& all, size_t camera, const Bundle& alone,
                    double rms_px) {
  const std::string where = camera_place(all, camera);
  const double side = std::max(all.cameras[camera].width, all.cameras[camera].height);
  const bool lens_free = alone.cameras.front().free[0];
  if (!lens_free) return {};
  const double spread = plane_spread_deg(alone);
  const double ratio = depth_ratio(alone);
  const RigCovariance covariance = rig_covariance(alone);
  const double focal = alone.cameras.front().values[0];
  const double focal_sigma = covariance.singular
                                 ? std::numeric_limits<double>::infinity()
                                 : std::sqrt(covariance.matrix(0, 0)) / std::abs(focal);
  if (!(rms_px < kWorstFit * side)) {
    return refuse(where,
                  "the corners do not fit a flat {}: {:.1f} px after the best fit. Is the size in "
                  "squares right, is the layout, is the print flat?",
                  all.target.describe(), rms_px);
  }
  if (spread < kLeastSpreadDeg) {
    return refuse(
        where,
        "no tilt: the planes of its {} views differ by {:.1f} deg at most, so that nothing "
        "tells focal length from distance; tilt the target by 20 to 45 deg, to all sides",
        alone.views.size(), spread);
  }
  if (ratio < kLeastDepthRatio) {
    return refuse(
        where,
        "no change of distance: all corners are within a factor of {:.2f}, so that nothing "
        "tells focal length from distance; bring the target nearer and farther (a factor "
        "of 2), or give the known lens",
        ratio);
  }
  if (!(focal_sigma < kWorstFocalSigma)) {
    return refuse(
        where,
        "the views do not determine its lens: focal length {:.0f} px +- {:.0f} %; they "
        "need tilt (planes differ by {:.0f} deg), change of distance (factor {:.2f}), and "
        "corners all over the image",
        focal, 100 * focal_sigma, spread, ratio);
  }
  return {};
}

Status check_exchanged(const CalibrationViews& views, const SolveOptions& options) {
  const size_t n = views.cameras.size();
  const auto error_with = [&](size_t camera, size_t lens) {
    const CameraModel& model = *options.cameras[lens].known;
    double sum = 0, corners = 0;
    size_t taken = 0;
    for (const TargetView& view : views.views) {
      if (view.camera != camera || view.corners.size() < options.min_corners) continue;
      if (++taken > 20) break;
      const auto pose = target_pose(views.target, Eigen::Vector2d::Zero(), model.parameters().lens,
                                    lens_vector(model), view);
      const auto count = static_cast<double>(view.corners.size());
      const double rms = pose ? pose->rms_px : 1e3;
      sum += rms * rms * count;
      corners += count;
    }
    return std::sqrt(sum / std::max(1.0, corners));
  };
  for (size_t a = 0; a < n; ++a) {
    if (!is_known(options, a)) continue;
    const double own = error_with(a, a);
    if (own < kPoorFitPx) continue;
    for (size_t b = 0; b < n; ++b) {
      if (b == a || !is_known(options, b) || kExchanged * error_with(a, b) > own) continue;
      return refuse(camera_place(views, a),
                    "its images fit the lens of camera {} ({:.2f} px) and not its own ({:.2f} px): "
                    "have the two been exchanged or plugged the other way round?",
                    views.cameras[b].name, error_with(a, b), own);
    }
    if (own > kWorstFit * std::max(views.cameras[a].width, views.cameras[a].height)) {
      return refuse(camera_place(views, a),
                    "the corners do not fit a flat {} through the known lens: {:.1f} px. Is the "
                    "size in squares right, is it the lens of this camera?",
                    views.target.describe(), own);
    }
  }
  return {};
}

}  // namespace sightline::calibrate
