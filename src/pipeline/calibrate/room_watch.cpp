// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/room_watch.hpp"

#include <fmt/format.h>

#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"
#include "sightline/pipeline/last_poses.hpp"

namespace sightline {
namespace {

constexpr size_t kMaxBytes = size_t{64} << 20;
constexpr double kUnknownSize = 0.2;  // of an object without a mesh [m]

}  // namespace

std::unique_ptr<RoomWatch> RoomWatch::create(const Installation& installation, const Rig& rig,
                                             CameraId camera,
                                             std::shared_ptr<SceneReferences> references) {
  const CameraConfig& config = installation.cameras.at(camera.index());
  if (!installation.watch.enabled || !installation.watch.background || !references ||
      !observes(config.role) || config.calibration.axes) {
    return nullptr;
  }
  std::vector<Extent> extents;
  for (const RigObject& object : rig.objects) {
    Extent extent{Eigen::Vector3d::Zero(), kUnknownSize};
    if (object.views) {
      extent = {object.views->center(), object.views->radius()};
    } else if (object.triangles && object.triangles->radius > 0) {
      extent = {object.triangles->center.cast<double>(), object.triangles->radius};
    }
    extents.push_back(extent);
  }
  return std::unique_ptr<RoomWatch>(new RoomWatch(
      SceneWatch(config.calibration, camera, std::move(references)), std::move(extents)));
}

std::optional<SceneLook> RoomWatch::step(const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  const FrameInfo& info = frame.info();
  if (info.status == FrameStatus::kDamaged || !watch_.due(info.capture)) return std::nullopt;
  balls_.clear();
  for (const PoseTrackPtr& track : tracks) {
    if (!track || track->object().index() >= extents_.size()) continue;
    const PoseAt at = track->at(info.capture);
    if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) continue;
    const Extent& extent = extents_[track->object().index()];
    balls_.push_back({at.estimate.world_from_object * extent.center, extent.radius});
  }
  return watch_.look(frame.half_gray(), info.capture, balls_);
}

std::filesystem::path scene_file(const Installation& installation) {
  const std::filesystem::path folder = state_folder();
  if (folder.empty()) return folder;
  std::error_code error;
  const auto file = std::filesystem::absolute(installation.file, error);
  return folder / fmt::format("rooms_{:016x}.bin", content_hash(file.string()));
}

void read_scene(const std::filesystem::path& file, SceneReferences& references) {
  if (file.empty()) return;
  const auto bytes = read_file(file, kMaxBytes);
  if (!bytes && bytes.error().code == ErrorCode::kNotFound) return;
  const Status done = bytes ? references.add(*bytes, file.string()) : Status(bytes.error());
  if (!done) log::warning("{}", done.error().message());
}

Status write_scene(const std::filesystem::path& file, const SceneReferences& references) {
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  if (error) {
    return make_error(ErrorCode::kIo, file.parent_path().string(), "cannot make the folder: {}",
                      error.message());
  }
  return write_file_atomically(file, references.bytes());
}

}  // namespace sightline
