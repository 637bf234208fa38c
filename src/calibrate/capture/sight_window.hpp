// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "sightline/calibrate/capture_guide.hpp"

namespace sightline::calibrate {

/// What a camera saw while the target stood still, or at one moment.
struct SteadyView {
  Time from{}, to{};                  ///< of the images that it is made of
  Time capture{};                     ///< their middle
  std::vector<TargetCorner> corners;  ///< means; of a moving target with motion
  double edge_px = 0;                 ///< median; 0: unknown
};

/// The last images of one camera.
class SightWindow {
 public:
  enum class State : uint8_t {
    kNotSeen,
    kTooShort,  ///< not for long enough, or not in all of the newest images
    kMoving,
    kSteady
  };

  void add(const TargetSight& sight);

  /// Whether the target stands still in the newest images, for so long, and how it looks then.
  State steady(const CaptureGuideOptions& options, Duration still, double width_px,
               SteadyView& out) const;
  /// The image nearest to `at` that has neighbors before and after, with the corners' motion
  /// between these. Empty if none is within half a period, or one of the three does not show it.
  std::optional<SteadyView> moment(Time at, size_t min_corners) const;

  /// Whether it shows the target now, `now` being the newest image of any camera.
  bool sees_it(Time now, size_t min_corners) const;
  Duration period() const;  ///< between images, median; 0: unknown

 private:
  std::deque<TargetSight> sights_;
};

const TargetCorner* find_corner(const std::vector<TargetCorner>& corners, int id);

}  // namespace sightline::calibrate
