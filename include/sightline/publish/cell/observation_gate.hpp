// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {

/// What becomes of an observation of another host.
enum class CellVerdict : uint8_t {
  kTaken,
  kLate,              ///< older than the age limit
  kFuture,            ///< captured later than now: one of the two clocks is wrong
  kDuplicate,         ///< was here, or one that was sent after it
  kOldBoot,           ///< of a daemon that has been started anew since
  kForeign,           ///< of a camera or an object that nobody here knows, or of another host's
  kOtherCalibration,  ///< the host believes the camera to be elsewhere, or of another lens
  kMalformed,         ///< not to be read
  kClock,             ///< this host's own clock is not fit: nobody's times mean anything here
  kSuperseded         ///< of a cell that keeps the object no more: another one does
};
inline constexpr size_t kCellVerdicts = 10;
/// "taken", "late", ... as the label of metrics.
std::string_view to_string(CellVerdict verdict);

/// Lets through what is new, in time and of this cell. Passive; one thread at a time.
class ObservationGate {
 public:
  struct Camera {
    CameraId id;
    RemoteCamera camera;
  };
  ObservationGate(std::vector<Camera> cameras, std::vector<std::string> objects,
                  Duration age_limit);

  struct Pass {
    CellVerdict verdict = CellVerdict::kForeign;
    CameraId camera;  ///< the two are set unless foreign
    ObjectId object;
  };
  /// `fit`: this host's clock; `slack`: how far the two hosts' clocks may be apart; `cell`: at
  /// whose topic it stood, as RemoteCamera says it.
  Pass check(const CellObservation& observation, int64_t now_utc_ns, bool fit, Duration slack,
             std::string_view cell = {});

  /// Capture times that are later than now by more than this and the slack are wrong, however
  /// uncertain their host calls them.
  static constexpr Duration kCaptureSlack = std::chrono::milliseconds(5);

 private:
  struct Host {
    uint64_t boot = 0;
    std::set<uint64_t> earlier;  // boots
    // By camera and object: the newest that was let through.
    std::map<std::pair<uint32_t, uint32_t>, uint64_t> sequence;
  };
  const std::vector<Camera> cameras_;
  const std::vector<std::string> objects_;
  const Duration age_limit_;
  std::map<std::pair<std::string, std::string>, Host> hosts_;  // by cell and name; of cameras_ only
};

}  // namespace sightline
