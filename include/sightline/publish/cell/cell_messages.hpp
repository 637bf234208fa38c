// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/publish/cell/cell_options.hpp"

namespace sightline {

/// What the estimator has to tell apart of an observation's terms.
enum class FrozenKind : uint8_t { kOther, kOutline, kFiducial, kTexture };
constexpr size_t kFrozenKinds = 4;

/// The terms of an observation that are of one kind, summed and linearized at a pose.
struct FrozenPart {
  FrozenKind kind = FrozenKind::kOther;
  LinearizedTerm term;
};

/// What the terms say near one pose.
struct FrozenAt {
  Rigid3 reference;  ///< world_from_object
  std::vector<FrozenPart> parts;
};

/// An observation on the wire: numbers instead of what can look again.
struct CellObservation {
  std::string object, camera, host;
  uint64_t boot = 0;         ///< of the daemon that sends it: another one after each start
  uint64_t calibration = 0;  ///< hash of the camera's lens and place
  uint64_t sequence = 0;     ///< grows with each that the daemon sends
  int64_t capture_utc_ns = 0;
  Duration capture_error{0};  ///< of the capture time, the sender's clock included
  uint32_t stream_epoch = 0;
  uint64_t frame = 0;
  std::vector<FrozenAt> at;
  std::vector<PoseHypothesis> hypotheses, symmetric_hypotheses;
  std::optional<PictureAgreement> picture{};
  PrintSeen print = PrintSeen::kNone;
  bool refutes = false;
  bool doubted = false;  ///< the sender's search doubts the pose in force
  std::optional<Matrix6> calibration_covariance{};  ///< of Observation
};

/// An estimate on the wire. `estimate.object` and `estimate.cameras` are not set: ids differ from
/// host to host; times are the sender's UTC.
struct CellTrack {
  std::string object, host;
  uint64_t boot = 0;
  uint64_t sequence = 0;
  int64_t time_utc_ns = 0, last_measured_utc_ns = 0;
  PoseEstimate estimate;
  std::vector<std::string> cameras;  ///< whose measurements were accepted
  uint64_t term = 0;                 ///< of the cell's holding of the object; 0: it is alone
};

struct CellHostState {
  std::string host;
  uint64_t boot = 0;
  bool online = false;
  CellRole role = CellRole::kBoth;
  int64_t since_utc_ns = 0;  ///< start of the daemon
  struct Camera {
    std::string name;
    uint64_t calibration = 0;
    bool away = false;  ///< no frame comes from it

    bool operator==(const Camera&) const = default;
  };
  std::vector<Camera> cameras;
  Duration clock_bound{0};
  bool clock_fit = false;
  std::string clock;  ///< what it goes by, or what is wrong with it
  /// Address of its page for browsers, "https://hall-2:9754/"; empty: none that others reach.
  std::string page;
  uint64_t beat = 0;  ///< of a claim: grows with each that the daemon says
  /// Of a claim: what became of other hosts' observations since the start, by CellVerdict.
  std::vector<uint64_t> observations;
};

/// What is longer is not read.
constexpr size_t kMostCellBytes = size_t{16} << 10;
/// The newest format; others are refused.
constexpr uint32_t kCellVersion = 1;

std::string encode(const CellObservation& observation);
std::string encode(const CellTrack& track);
std::string encode(const CellHostState& state);

/// Refuse, with what is wrong, whatever is not complete: sizes, numbers that are not finite,
/// rotations that are none, information and covariance that are not positive semidefinite, names
/// that an installation would not take either, text that is not UTF-8.
Result<CellObservation> decode_observation(std::string_view bytes);
Result<CellTrack> decode_track(std::string_view bytes);
Result<CellHostState> decode_host_state(std::string_view bytes);

/// Whether this program was built with what the above needs.
bool cell_available();

}  // namespace sightline
