// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/calibrate/scene_watch.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/pipeline/rig.hpp"

namespace sightline {

/// One camera's looks at its room, without the objects that are tracked in it. One thread at a
/// time.
class RoomWatch {
 public:
  /// Null where nobody watches over the cameras, or not by their background, or this one does not
  /// observe.
  static std::unique_ptr<RoomWatch> create(const Installation& installation, const Rig& rig,
                                           CameraId camera,
                                           std::shared_ptr<SceneReferences> references);

  /// A frame, with the newest tracks; costs nothing but once a second.
  std::optional<SceneLook> step(const Frame& frame, std::span<const PoseTrackPtr> tracks);

 private:
  struct Extent {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of the bounding sphere, object frame
    double radius = 0;
  };
  RoomWatch(SceneWatch watch, std::vector<Extent> extents)
      : watch_(std::move(watch)), extents_(std::move(extents)) {}

  SceneWatch watch_;
  std::vector<Extent> extents_;  // by ObjectId
  std::vector<SceneBall> balls_;
};

/// Where a daemon keeps what the cameras of an installation have seen of their room; one file for
/// each installation file. Empty: there is no state folder.
std::filesystem::path scene_file(const Installation& installation);
/// Of no file nothing; of a damaged one nothing, and the log has a warning.
void read_scene(const std::filesystem::path& file, SceneReferences& references);
/// Replaces the file, after its folder is made: aside, synced, renamed.
Status write_scene(const std::filesystem::path& file, const SceneReferences& references);

}  // namespace sightline
