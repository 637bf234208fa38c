// SPDX-License-Identifier: Apache-2.0
#include "calibrate/capture/camera_record.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calibrate/capture/sight_window.hpp"
#include "calibrate/solve/target_pose.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kUsualFocal = 0.9;  // of the width, until views tell
constexpr size_t kNextGuess = 6, kMostForLens = 24;
constexpr size_t kViewsForLens = 4;  // fewer do not tell a focal length
constexpr size_t kLeastCommon = 4;

TargetView as_view(const std::vector<TargetCorner>& corners) { return {0, 0, 0, corners, {}}; }

/// Mean way of the corners that both show; nothing if they are too few.
std::optional<double> way_px(const std::vector<TargetCorner>& a,
                             const std::vector<TargetCorner>& b) {
  double sum = 0;
  size_t count = 0;
  for (const TargetCorner& corner : a) {
    const TargetCorner* other = find_corner(b, corner.id);
    if (other == nullptr) continue;
    sum += (corner.pixel - other->pixel).norm();
    ++count;
  }
  if (count < kLeastCommon) return std::nullopt;
  return sum / static_cast<double>(count);
}

/// Corners of the pattern through the homography of what was seen.
std::vector<Eigen::Vector2d> outline_of(const CalibrationTarget& target,
                                        const std::vector<TargetCorner>& corners) {
  std::vector<Eigen::Vector2d> from, to, out;
  for (const TargetCorner& corner : corners) {
    from.push_back(target.corner(corner.id));
    to.push_back(corner.pixel);
  }
  const auto h = homography(from, to);
  if (!h) return out;
  const Eigen::Vector2d size = target.size();
  for (const Eigen::Vector2d& share : {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0),
                                       Eigen::Vector2d(1, 1), Eigen::Vector2d(0, 1)}) {
    const Eigen::Vector3d p = *h * Eigen::Vector2d(share.cwiseProduct(size)).homogeneous();
    const Eigen::Vector3d at_first = *h * from.front().homogeneous();
    if (p.z() * at_first.z() <= 0) return {};
    out.emplace_back(p.hnormalized());
  }
  return out;
}

}  // namespace

ImageRegion region_of_cell(int column, int row) {
  return {(2 * column + 1) * 3 / (2 * kCellColumns), (2 * row + 1) * 3 / (2 * kCellRows)};
}

CameraRecord::CameraRecord(const CalibrationTarget& target, const CameraPrior& prior)
    : target_(target), prior_(prior) {}

Status CameraRecord::set_size(const std::string& name, int width, int height) {
  const bool same = width == width_ && height == height_;
  if (width_ > 0 && !same) {
    return make_error(ErrorCode::kInvalidInput, "camera " + name,
                      "its images were {}x{} and are {}x{} now: a calibration belongs to one image "
                      "size",
                      width_, height_, width, height);
  }
  if (same) return {};
  if (prior_.known && (prior_.known->width() != width || prior_.known->height() != height)) {
    return make_error(ErrorCode::kInvalidInput, "camera " + name,
                      "its images are {}x{}, but its known lens is for {}x{}: set the camera to "
                      "that size, or solve for the lens",
                      width, height, prior_.known->width(), prior_.known->height());
  }
  width_ = width;
  height_ = height;
  if (prior_.known) {
    lens_ = lens_vector(*prior_.known);
    lens_solved_ = true;
  } else {
    lens_[0] = lens_[1] = kUsualFocal * width;
    lens_[2] = (width - 1) / 2.0;
    lens_[3] = (height - 1) / 2.0;
  }
  return {};
}

std::optional<Rigid3> CameraRecord::pose(const std::vector<TargetCorner>& corners) const {
  const LensModel model = prior_.known ? prior_.known->parameters().lens : prior_.lens;
  const auto found = target_pose(target_, Eigen::Vector2d::Zero(), model, lens_, as_view(corners));
  if (!found) return std::nullopt;
  return found->camera_from_target;
}

bool CameraRecord::is_new(const std::vector<TargetCorner>& corners,
                          const CaptureGuideOptions& options) const {
  const double diagonal = std::hypot(width_, height_);
  std::optional<Rigid3> now;  // found when first asked for
  return std::ranges::all_of(views_, [&](const TakenView& view) {
    const auto way = way_px(corners, view.corners);
    const double apart = way ? *way / (options.new_share * diagonal) : 1;
    if (apart >= 1 || !view.camera_from_target) return apart >= 1;
    if (!now) now = pose(corners);
    if (!now) return false;
    const Eigen::Vector3d a = now->rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d b = view.camera_from_target->rotation * Eigen::Vector3d::UnitZ();
    return apart + std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * kDegrees / options.new_deg >= 1;
  });
}

void CameraRecord::take(const std::vector<TargetCorner>& corners) {
  for (const TargetCorner& corner : corners) {
    const int column = static_cast<int>((corner.pixel.x() + 0.5) / width_ * kCellColumns);
    const int row = static_cast<int>((corner.pixel.y() + 0.5) / height_ * kCellRows);
    ++cells_[static_cast<size_t>(std::clamp(row, 0, kCellRows - 1) * kCellColumns +
                                 std::clamp(column, 0, kCellColumns - 1))];
  }
  views_.push_back({corners, std::nullopt, outline_of(target_, corners)});
  // A guess takes tens of milliseconds, and hardly changes any more with many views.
  const bool tells = views_.size() == kViewsForLens || views_.size() % kNextGuess == 0;
  if (!lens_solved_ && tells && views_.size() <= kMostForLens) {
    guess_lens();
    for (TakenView& view : views_) view.camera_from_target = pose(view.corners);
  } else {
    views_.back().camera_from_target = pose(corners);
  }
}

void CameraRecord::guess_lens() {
  std::vector<TargetView> views;
  for (const TakenView& view : views_) views.push_back(as_view(view.corners));
  std::vector<const TargetView*> pointers;
  for (const TargetView& view : views) pointers.push_back(&view);
  if (const auto guess = initial_lens(target_, prior_.lens, width_, height_, pointers)) {
    lens_ = *guess;
  }
}

void CameraRecord::set_lens(const CameraModel& lens) {
  if (prior_.known) return;
  prior_.lens = lens.parameters().lens;
  lens_ = lens_vector(lens);
  lens_solved_ = true;
  for (TakenView& view : views_) view.camera_from_target = pose(view.corners);
}

double CameraRecord::coverage() const {
  return static_cast<double>(std::ranges::count_if(cells_, [](int n) { return n > 0; })) /
         static_cast<double>(cells_.size());
}

double CameraRecord::coverage(const ImageRegion& region) const {
  int covered = 0, all = 0;
  for (int row = 0; row < kCellRows; ++row) {
    for (int column = 0; column < kCellColumns; ++column) {
      if (region_of_cell(column, row) != region) continue;
      ++all;
      covered += cell(column, row) > 0;
    }
  }
  return static_cast<double>(covered) / all;
}

double CameraRecord::depth_ratio() const {
  const Eigen::Vector2d middle = target_.size() / 2;
  double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
  for (const TakenView& view : views_) {
    if (!view.camera_from_target) continue;
    const double d = (*view.camera_from_target * Eigen::Vector3d(middle.x(), middle.y(), 0)).norm();
    nearest = std::min(nearest, d);
    farthest = std::max(farthest, d);
  }
  return farthest > 0 ? farthest / nearest : 1;
}

double CameraRecord::tilt_deg(TiltSide side) const {
  const Eigen::Vector2d middle = target_.size() / 2;
  double most = 0;
  for (const TakenView& view : views_) {
    if (!view.camera_from_target) continue;
    const Rigid3& pose = *view.camera_from_target;
    const Eigen::Vector3d sight = (pose * Eigen::Vector3d(middle.x(), middle.y(), 0)).normalized();
    const Eigen::Vector3d normal = pose.rotation * Eigen::Vector3d::UnitZ();
    // A side comes nearer where the normal leans to: depth changes by -n e / n s along e.
    const Eigen::Vector3d lean = normal - normal.dot(sight) * sight;
    const double along = side == TiltSide::kLeft    ? -lean.x()
                         : side == TiltSide::kRight ? lean.x()
                         : side == TiltSide::kTop   ? -lean.y()
                                                    : lean.y();
    most = std::max(most, std::atan2(along, normal.dot(sight)) * kDegrees);
  }
  return most;
}

double CameraRecord::largest_share() const {
  double longest = 0;
  for (const TakenView& view : views_) {
    for (size_t i = 0; i + 1 < view.outline.size(); ++i) {
      longest = std::max(longest, (view.outline[i + 1] - view.outline[i]).norm());
    }
  }
  return longest / width_;
}

}  // namespace sightline::calibrate
