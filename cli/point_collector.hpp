// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "rig.hpp"
#include "sightline/geometry/mesh_distance.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/stereo_points.hpp"
#include "sightline/record/point_cloud.hpp"
#include "sightline/render/point_marks.hpp"

namespace sightline::cli {

/// Reconstructed points against the pose: distances from the mesh, of those points that the pose
/// says are on the object as the first camera of a pair sees it.
struct PointSummary {
  size_t points = 0;
  size_t corners = 0;
  size_t sets = 0;       ///< pairs of pictures that were looked at
  size_t on_object = 0;  ///< of the points
  double median_mm = 0;
  double p90_mm = 0;
};

/// Makes stereo points of every tracked object while a recording is replayed. Pairs of cameras are
/// chosen by where the object is; frames of free-running cameras come together by its motion.
class PointCollector {
 public:
  static Result<std::unique_ptr<PointCollector>> create(const Installation& installation,
                                                        const Rig& rig);

  /// Frames of one capture time, whose CameraId is that of the installation, after fusion.
  void step(std::span<const std::pair<CameraId, FramePtr>> frames,
            std::span<const PoseTrackPtr> tracks);
  /// Marks of the newest points in a camera's picture at `capture`; none older than 50 ms.
  void marks(CameraId camera, Time capture, std::vector<PointMark>& out) const;
  /// Everything so far, coloured by the distance from the first camera of its pair.
  Status write(const std::filesystem::path& path) const;
  PointSummary summary() const;

 private:
  struct Collected {
    ScenePoint point;
    Time time{};
    double depth = 0;
  };
  struct Object {
    ObjectId id;
    Eigen::Vector3d center;
    double radius = 0;
    std::unique_ptr<MeshDistance> surface;
    std::vector<std::unique_ptr<DepthRenderer>> outline;  ///< by CameraId
    std::map<std::pair<size_t, size_t>, Time> done;       ///< newest time of every pair
  };
  void look(Object& object, const PoseTrack& track);
  void find(Object& object, const PoseTrack& track, size_t first, size_t second);
  void judge(const Object& object, const Rigid3& world_from_object, size_t camera,
             const Rigid3& world_from_camera, std::span<const ScenePoint> points);

  std::vector<CalibratedCamera> cameras_;  ///< by CameraId
  std::vector<FramePtr> newest_;           ///< by CameraId
  std::vector<Object> objects_;
  StereoPointFinder finder_;
  std::vector<Collected> collected_;
  std::vector<double> distances_;  ///< [m]
  std::vector<ScenePoint> shown_;
  Time shown_time_{};
  DepthScale scale_;
  size_t sets_ = 0;
};

}  // namespace sightline::cli
