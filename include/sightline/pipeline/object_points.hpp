// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "sightline/geometry/mesh_distance.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/scene_points.hpp"
#include "sightline/observe/stereo/stereo_points.hpp"
#include "sightline/pipeline/rig.hpp"

namespace sightline {

/// Stereo points of tracked objects from the newest frame of each camera: pairs are chosen by where
/// the object is, of the cameras that observe and whose frames come; frames of free-running cameras
/// come together by its motion. One thread at a time; deterministic.
class ObjectPoints {
 public:
  ObjectPoints(const Installation& installation, const Rig& rig);

  /// The newest good frame of a camera; an older one is let go. Those of cameras that only stream
  /// are not looked at.
  void add_frame(CameraId camera, const FramePtr& frame);
  void let_go();

  /// What one pair of images gave of one object.
  struct Found {
    ObjectId object;
    Time time{};               ///< of the later image; the points are where the object was then
    CameraSet cameras = 0;     ///< the pair
    Rigid3 world_from_object;  ///< then
    CalibratedCamera first;    ///< the pair's first camera, from where the object was seen then
    std::vector<ScenePoint> points;
    /// Distances from the mesh at the estimated pose [m], of the points that it says are on the
    /// object as the first camera sees it.
    std::vector<double> distances;
  };
  /// Looks at every pair that has new images and appends what was found.
  void find(std::span<const PoseTrackPtr> tracks, std::vector<Found>& out);

 private:
  struct Object {
    ObjectId id;
    Eigen::Vector3d center;
    double radius = 0;
    std::unique_ptr<MeshDistance> surface;
    std::vector<std::unique_ptr<DepthRenderer>> outline;  ///< by CameraId
    std::map<std::pair<size_t, size_t>, Time> done;       ///< newest time of every pair
  };
  void choose_cameras();
  void find_pairs(Object& object, const PoseTrack& track, std::vector<Found>& out);
  void find_pair(Object& object, const PoseTrack& track, size_t first, size_t second,
                 std::vector<Found>& out);
  void measure(const Object& object, const Rigid3& world_from_object, size_t camera, Found& found);

  std::vector<CalibratedCamera> cameras_;  ///< by CameraId
  std::vector<bool> observing_;            ///< by CameraId
  std::vector<FramePtr> newest_;           ///< by CameraId
  std::vector<size_t> chosen_;             ///< CameraIds of those with a fresh frame, ascending
  std::vector<CalibratedCamera> chosen_cameras_;
  std::vector<Object> objects_;
  StereoPointFinder finder_;
};

}  // namespace sightline
