// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "sightline/model/frame.hpp"
#include "sightline/pipeline/object_points.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/record/point_cloud.hpp"
#include "sightline/render/overlay/point_marks.hpp"

namespace sightline {

/// Reconstructed points against the pose: distances from the mesh, of those points that the pose
/// says are on the object as the first camera of a pair sees it.
struct PointSummary {
  size_t points = 0;
  size_t corners = 0;
  size_t sets = 0;       ///< pairs of images that were looked at
  size_t on_object = 0;  ///< of the points
  double median_mm = 0;
  double p90_mm = 0;
};

/// Collects the stereo points of every tracked object while a recording is replayed.
class PointCollector {
 public:
  PointCollector(const Installation& installation, const Rig& rig);

  /// Frames of one capture time of cameras that observe, after fusion.
  void step(std::span<const CameraFrame> frames, std::span<const PoseTrackPtr> tracks);
  /// Marks of the newest points in a camera's image at `capture`; none older than 50 ms.
  void marks(CameraId camera, Time capture, std::vector<PointMark>& out) const;
  /// The newest points, as a view from anywhere shows them; null: none of the last 50 ms.
  ScenePointsPtr points_at(Time time) const;
  /// Everything so far, colored by the distance from the first camera of its pair.
  Status write(const std::filesystem::path& path) const;
  PointSummary summary() const;

 private:
  struct Collected {
    ScenePoint point;
    Time time{};
    double depth = 0;
  };
  void keep(const ObjectPoints::Found& found);

  std::vector<CalibratedCamera> cameras_;  ///< by CameraId
  ObjectPoints finder_;
  std::vector<ObjectPoints::Found> found_;  ///< of the newest step
  std::vector<Collected> collected_;
  std::vector<double> distances_;  ///< [m]
  ScenePoints shown_;
  DepthScale scale_;
  size_t sets_ = 0;
};

}  // namespace sightline
