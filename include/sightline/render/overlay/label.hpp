// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// A short UTF-8 text that needs no allocation; what does not fit is cut at a character's edge.
class LabelText {
 public:
  std::string_view view() const { return {bytes_.data(), size_}; }
  void append(std::string_view utf8);
  void clear() { size_ = 0; }

 private:
  std::array<char, 192> bytes_{};
  size_t size_ = 0;
};

/// The label beside an object, two lines: "NAME · STATE" and "RANGE m  σ SIGMA mm  AGE ms". Range
/// is from the camera's center to the object's origin, sigma the largest standard deviation of its
/// position, age how long before `capture` the newest measurement was. A notice follows the state.
LabelText label_text(std::string_view name, const PoseEstimate& estimate,
                     const Rigid3& world_from_camera, Time capture, std::string_view notice = {});

/// "NAME: searching" or "NAME: lost", for the corner.
LabelText status_text(std::string_view name, TrackState state, std::string_view notice = {});

/// "NAME RANGE m", beside the arrow of an object outside the image.
LabelText offscreen_text(std::string_view name, double range);

/// "NAME last seen AGE s ago".
LabelText last_seen_text(std::string_view name, Duration age);

/// What to call an object that has no pose at `capture`: searching if it was never found (or is
/// searched for again), else lost.
TrackState state_without_pose(const PoseTrack* track);

}  // namespace sightline
