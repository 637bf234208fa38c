// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>

#include "sightline/config/installation.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

/// Opens the sources that play recordings; cameras of one recording share its clock and so stay in
/// step, also when one of them is opened again. Any thread.
class ReplayLibrary {
 public:
  /// Makes the source of one camera. `payload`: frames carry their compressed bytes (for
  /// recording).
  Result<std::unique_ptr<FrameSource>> open(const CameraConfig& camera, CameraId id, bool payload);

  /// How the camera's pictures come, for the recording writer.
  Result<PixelFormat> payload_format(const CameraConfig& camera);

 private:
  struct Entry {
    std::shared_ptr<const Recording> recording;
    std::shared_ptr<const ReplayClock> clock;
  };
  Result<Entry> entry(const std::filesystem::path& folder);

  std::mutex mutex_;
  std::map<std::filesystem::path, Entry> entries_;
};

}  // namespace sightline
