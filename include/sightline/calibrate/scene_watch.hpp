// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

namespace calibrate {
struct SceneReference;
}
using SceneReferencePtr = std::shared_ptr<const calibrate::SceneReference>;

/// What one look of a camera at the room says of the camera.
struct SceneLook {
  enum class Kind : uint8_t {
    kTurn,   ///< the room is where `turn` says
    kUnfit,  ///< another image, at rest: it is not the room that this camera has always seen
  };
  CameraId camera;
  Time time{};
  Kind kind = Kind::kTurn;
  /// calibrated_from_now, a rotation vector in the camera's frame [rad]. A shift of the camera by t
  /// before a room z away looks like a turn by t / z.
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int patches = 0;           ///< that say so
  double zoom = 1;           ///< kUnfit: the image is so many times as large as it was; 1: not that
  std::string looks_like{};  ///< kUnfit: the camera whose room it is; empty: none that is known
};

/// A ball that is not part of the room: a tracked object.
struct SceneBall {
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();  ///< [m]
  double radius = 0;                                          ///< [m]
};

/// What every camera of a rig has seen of its room, by name and calibration: a camera with another
/// calibration starts anew. At most 48 patches of 17x17 each. Any thread.
class SceneReferences {
 public:
  SceneReferencePtr find(const CalibratedCamera& camera) const;
  void set(const CalibratedCamera& camera, SceneReferencePtr reference);
  /// Name of another camera, with an image of this size, and what it has seen.
  std::vector<std::pair<std::string, SceneReferencePtr>> others(
      const CalibratedCamera& camera) const;
  /// Cameras of other names are no longer there.
  void keep_only(const std::set<std::string>& names);
  /// Grows with every change.
  uint64_t version() const;

  /// For a file; little-endian, with a check sum.
  std::string bytes() const;
  /// Takes over what bytes() gave; what is there stays. Refused, and nothing taken over: damaged.
  Status add(std::string_view bytes, const std::string& where);

 private:
  struct Entry {
    uint64_t calibration = 0;
    SceneReferencePtr reference;
  };
  mutable std::mutex mutex_;
  std::map<std::string, Entry> entries_;  // by camera
  uint64_t version_ = 0;
};

/// One camera's looks at what stands still around it: well-spread patches of the half-size image,
/// learned in the first seconds (what moves then is not taken), found again once a second, and the
/// turn of the camera that explains where most of them are now. Patches that are gone for minutes
/// are replaced while the camera stands still. docs/calibration.md has the figures.
///
/// Passive, no clock: same images, same looks. One thread at a time. About 0.5 ms a look at
/// 640x480; 5 ms where the image has jumped.
class SceneWatch {
 public:
  SceneWatch(CalibratedCamera camera, CameraId id, std::shared_ptr<SceneReferences> references);
  ~SceneWatch();
  SceneWatch(SceneWatch&&) noexcept;

  /// Whether look() would look at an image of this time: one a second.
  bool due(Time capture) const;
  /// `half_gray`: Frame::half_gray(). `balls`: where nothing belongs to the room. Empty: not due,
  /// still learning, or it cannot tell.
  std::optional<SceneLook> look(const PlaneView& half_gray, Time capture,
                                std::span<const SceneBall> balls);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
