// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <stop_token>

#include "sightline/base/counters.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/model/seams.hpp"
#include "sightline/pipeline/replay_library.hpp"

namespace sightline {

/// Opens the source of a camera, whatever its kind. Any thread.
class SourceFactory {
 public:
  explicit SourceFactory(Registry& registry) : registry_(registry) {}

  using Opener = std::function<Result<std::unique_ptr<FrameSource>>(const std::stop_token& stop)>;
  /// What opens one camera's source, and opens it again: the epoch grows each time, and a device of
  /// another identity than the first is refused as a mismatch (kInvalidInput). For use by one
  /// thread, within this factory's life. `payload`: frames carry their compressed bytes. Capture
  /// times have the time offset of the camera's calibration in them. `axes`: of a camera that
  /// turns, where somebody puts its angles (a recording brings its own); each frame says where the
  /// camera stood.
  Opener opener(const CameraConfig& camera, CameraId id, bool payload,
                std::shared_ptr<const AxisHistory> axes = nullptr);

  /// How the camera's frames are recorded. Cameras that need not be there yet are recorded as I420,
  /// unless they are known to send JPEGs.
  Result<PixelFormat> payload_format(const CameraConfig& camera);

 private:
  Opener timed_opener(const CameraConfig& camera, CameraId id, bool payload);
  Opener bare_opener(const CameraConfig& camera, CameraId id, bool payload);
  Opener network_opener(const CameraConfig& camera, CameraId id);
  Opener aravis_opener(const CameraConfig& camera, CameraId id);

  Registry& registry_;
  ReplayLibrary replays_;
};

}  // namespace sightline
