// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/capture_guide.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::calibrate {

inline constexpr int kCellColumns = 10, kCellRows = 8;  // as the report counts them

/// One view that was taken of a camera.
struct TakenView {
  std::vector<TargetCorner> corners;
  std::optional<Rigid3> camera_from_target;  ///< as far as the lens is known
  std::vector<Eigen::Vector2d> outline;      ///< of the target, closed [px]; for the picture
};

/// What has been taken of one camera, and what that covers.
class CameraRecord {
 public:
  CameraRecord(const CalibrationTarget& target, const CameraPrior& prior);

  Status set_size(const std::string& name, int width, int height);
  int width() const { return width_; }
  int height() const { return height_; }
  bool lens_known() const { return prior_.known.has_value(); }

  /// Whether the pose differs from all that were taken.
  bool is_new(const std::vector<TargetCorner>& corners, const CaptureGuideOptions& options) const;
  void take(const std::vector<TargetCorner>& corners);
  /// A lens that is known better; poses are found anew.
  void set_lens(const CameraModel& lens);

  const std::vector<TakenView>& views() const { return views_; }
  int cell(int column, int row) const {
    return cells_[static_cast<size_t>(row * kCellColumns + column)];
  }
  double coverage() const;
  /// Share of a region's cells that have corners.
  double coverage(const ImageRegion& region) const;
  double depth_ratio() const;
  /// Largest angle towards a side [deg].
  double tilt_deg(TiltSide side) const;
  /// Longest side of the target's largest view over the image's width.
  double largest_share() const;

 private:
  std::optional<Rigid3> pose(const std::vector<TargetCorner>& corners) const;
  void guess_lens();

  CalibrationTarget target_;
  CameraPrior prior_;
  int width_ = 0, height_ = 0;
  LensVector lens_{};         // the best that is known of it
  bool lens_solved_ = false;  // otherwise guessed anew with each view
  std::vector<TakenView> views_;
  std::array<int, kCellColumns * kCellRows> cells_{};
};

/// The ninth of the image in which a cell's middle lies.
ImageRegion region_of_cell(int column, int row);

}  // namespace sightline::calibrate
