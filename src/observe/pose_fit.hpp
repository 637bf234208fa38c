// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "edge_maps.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_term.hpp"
#include "sightline/observe/background_model.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

/// One camera's picture at half size, and when it was taken.
struct FitCamera {
  const CalibratedCamera* camera = nullptr;
  Rigid3 camera_from_world;
  const SmallPicture* picture = nullptr;
  const EdgePicture* edges = nullptr;
  double seconds = 0;                         ///< capture after the reference time
  const ForegroundMap* foreground = nullptr;  ///< of the picture's size; null: not known
};

/// What one camera says of a fitted pose.
struct CameraFit {
  int lines = 0;     ///< samples that project into the picture
  int agreeing = 0;  ///< that have an edge of their direction close by
  /// How unlike the two sides of the outline are, 0..1: in their colours, or in that one is new and
  /// the other background.
  double inside_outside = 0;
  LinearizedTerm term;  ///< at this camera's own time; `cost` and `information` of the lines
  double share() const { return lines > 0 ? static_cast<double>(agreeing) / lines : 0; }
};

struct PoseFit {
  Rigid3 world_from_object;         ///< at the reference time
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s], body frame
  std::vector<CameraFit> cameras;

  Rigid3 at(double seconds) const;
};

/// Moves a pose and its twist onto the edges of all pictures: for every sample of the outline and
/// of the creases the best edge along its normal, Gauss-Newton on the distances (Drummond and
/// Cipolla, PAMI 2002), each camera at its own time. Where the outline finds no edge, the border of
/// what is new in the picture is one. `reach` [half-size px]: how far the first step looks.
class PoseFitter {
 public:
  PoseFitter(const ViewpointModel& model, std::span<const FitCamera> cameras)
      : model_(model), cameras_(cameras) {}

  PoseFit fit(const Rigid3& start, const Vector6& twist, double reach) const;
  /// What the pictures say of a pose as it is.
  PoseFit look(const Rigid3& world_from_object, const Vector6& twist) const;

 private:
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  using Vector12 = Eigen::Matrix<double, 12, 1>;
  struct Line;

  void add_lines(const FitCamera& camera, const Rigid3& world_from_object, double reach,
                 double sigma, CameraFit& out) const;
  double inside_outside(const FitCamera& camera, const Rigid3& world_from_object) const;

  const ViewpointModel& model_;
  std::span<const FitCamera> cameras_;
};

}  // namespace sightline
