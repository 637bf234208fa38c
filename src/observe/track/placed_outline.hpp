// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "observe/track/contour_lines.hpp"
#include "observe/track/tracker_camera.hpp"

namespace sightline::observe {

/// The prediction as a quadratic cost about its pose: it holds a fit near where lines were placed.
struct PosePrior {
  Rigid3 world_from_object;
  Matrix6 information;

  /// The prediction is never believed better than `min_rotation` [rad] and `min_translation` [m]:
  /// it only places lines.
  PosePrior(const Rigid3& pose, const Matrix6& covariance, double min_rotation,
            double min_translation);
  /// Where a pose lies from the prediction.
  Vector6 offset_of(const Rigid3& pose) const { return difference(world_from_object, pose); }
};

/// The outline of one object, placed at a pose: the lines of the nearest view that are in the image
/// and not hidden. Buffers are kept from frame to frame.
class PlacedOutline {
 public:
  PlacedOutline(const TrackerCamera& camera, const ViewpointModel& views)
      : camera_(&camera), views_(&views) {}

  /// What hides the object in the frame at hand.
  void set_occluders(std::span<const OccludingSphere> spheres) {
    occluders_ = {camera_->scene.tile, spheres};
  }
  /// Where the object is predicted in the frame at hand, and how it moves there (body frame).
  void set_motion(const Rigid3& world_from_object, const Vector6& twist);
  /// Drops what was measured.
  void place(const Rigid3& world_from_object);

  /// Rows are exposed one after the other.
  bool rolling() const { return camera_->camera->readout_s != 0; }
  /// How far a rolling shutter shows a point of a row from where it is when the row of the object's
  /// center is exposed [px], along the direction that `by_pose` is the derivative of:
  ///     d (n . pixel) / d tangent * twist * (time of the row - time of the center's row)
  double rolled_px(const Vector6& by_pose, double row) const;
  /// Takes it off the offsets of the lines measured.
  void correct_for_rolling();

  /// Of the object, in its frame.
  const Eigen::Vector3d& center() const { return views_->center(); }
  const Rigid3& pose() const { return world_from_object_; }
  Rigid3 camera_from_object() const { return camera_->camera_from_world * world_from_object_; }
  View view() const { return views_->view(view_); }
  const Occluders& occluders() const { return occluders_; }
  const RevolvedSurface* revolved() const { return views_->revolved(); }
  std::vector<ContourLine>& lines() { return lines_; }
  const std::vector<ContourLine>& lines() const { return lines_; }

  /// At the object's center.
  double pixels_per_meter() const;
  /// Share of the lines that are independent, if lines closer than `correlation_px` are wrong
  /// together.
  double independent_share(double correlation_px) const;
  /// Box around the lines' centers [px]; there must be some.
  Eigen::AlignedBox2d bounds() const;
  /// How far it lies from the outline at another pose [px], rms over lines.
  double distance_to(const Rigid3& world_from_object) const;

 private:
  const TrackerCamera* camera_;
  const ViewpointModel* views_;
  Occluders occluders_;
  Rigid3 world_from_object_;
  Vector6 twist_ = Vector6::Zero();
  double center_delay_s_ = 0;  ///< of the row of the center as predicted
  size_t view_ = 0;
  std::vector<ContourLine> lines_;
};

}  // namespace sightline::observe
