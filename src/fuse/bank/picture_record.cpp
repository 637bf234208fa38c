// SPDX-License-Identifier: Apache-2.0
#include "fuse/bank/picture_record.hpp"

#include <algorithm>
#include <bit>

namespace sightline::fuse {
namespace {

constexpr Duration kLately = std::chrono::seconds(1);
constexpr float kPictureGain = 0.5F;  // of one camera's fading mean
// Frames that are accepted come twice as often as looks at a place where nothing is seen.
constexpr float kSeenGain = 0.15F, kAbsentGain = 0.3F;
// Share of the silhouette, mean over the cameras: at right poses 0.10 at most, in all recordings
// (docs/tracking.md).
constexpr float kUnexplained = 0.20F, kExplained = 0.12F;
// Share of the cameras. With one of two covered the other one is believed, also after a frame of it
// was missed: so both are above a half.
constexpr float kAbsent = 0.60F, kPresent = 0.53F;
constexpr int kFewest = 2;  // pictures, or looks, of all cameras together

void forget_pictures(BankState& state) {
  state.unexplained = state.absent = state.flat_print = state.solid = false;
  for (CameraRecord& record : state.cameras) record.picture = record.absence = {};
}

void add(Time time, float value, float gain, FadingShare& share) {
  share.mean += (share.count == 0 ? 1.0F : gain) * (value - share.mean);
  ++share.count;
  share.newest = time;
}

// The mean over the cameras that said something lately is above the limit.
bool exceeds(Time time, const BankState& state, FadingShare CameraRecord::*share, float limit) {
  float sum = 0;
  int cameras = 0, count = 0;
  for (CameraSet left = state.known; left != 0; left &= left - 1) {
    const CameraRecord& record = state.cameras[static_cast<size_t>(std::countr_zero(left))];
    const FadingShare& own = record.*share;
    if (own.count == 0 || time - own.newest > kLately) continue;
    sum += own.mean;
    count += own.count;
    ++cameras;
  }
  return count >= kFewest && sum > static_cast<float>(cameras) * limit;
}

}  // namespace

void record_pictures(Time time, std::span<const Observation> set, const Outcome* best,
                     BankState& state) {
  if (state.count == 0 || state.started || state.reset) forget_pictures(state);
  for (const Observation& observation : set) {
    const bool accepted = best != nullptr && (best->accepted & camera_bit(observation.camera)) != 0;
    state.flat_print |= accepted && observation.print == PrintSeen::kFlat;
    state.solid |= accepted && observation.print == PrintSeen::kSolid;
    if (observation.calibration_covariance != nullptr) continue;  // it looks at the wrong place
    CameraRecord& record = state.cameras[camera_slot(observation.camera)];
    const auto& picture = observation.picture;
    if (accepted) {
      add(time, 0, kSeenGain, record.absence);
      if (!picture) continue;
      add(time, std::min(1.0F, picture->unexplained + picture->missing), kPictureGain,
          record.picture);
    } else if (picture && observation.terms.empty()) {
      add(time, 1, kAbsentGain, record.absence);
    }
  }
  state.unexplained =
      exceeds(time, state, &CameraRecord::picture, state.unexplained ? kExplained : kUnexplained);
  state.absent = exceeds(time, state, &CameraRecord::absence, state.absent ? kPresent : kAbsent);
}

}  // namespace sightline::fuse
