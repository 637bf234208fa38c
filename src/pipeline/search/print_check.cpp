// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/search/print_check.hpp"

#include <algorithm>
#include <utility>

namespace sightline {
namespace {

// What is found by its print is off by 10 mm and 1.5 deg at most (docs/detection.md, "Measured").
constexpr double kElsewhere = 0.5;  // of the radius
constexpr double kTurned = 0.2;     // [rad]
constexpr int kMisses = 4;          // looks in a row that find nothing, until what was found is old
constexpr Duration kPause = std::chrono::seconds(1);
constexpr int kCosts = 10;
constexpr Duration kSecondLook = std::chrono::milliseconds(80);

}  // namespace

bool PrintCheck::refuted_by(const ViewpointModel& views, const Rigid3& pose,
                            const Detection& found) {
  looked_ = true;
  if (found.poses.empty()) {  // blurred or covered for a moment: the next look may do
    if (++missed_ >= kMisses) other_.reset();
    return false;
  }
  missed_ = 0;
  const std::optional<Rigid3> before = std::exchange(other_, std::nullopt);
  const auto differs = [&](const Rigid3& a, const Rigid3& b) {
    return (a * views.center() - b * views.center()).norm() > kElsewhere * views.radius() ||
           views.angle_up_to_symmetry(a, b) > kTurned;
  };
  const Rigid3& there = found.poses.front().world_from_object;
  if (!differs(pose, there)) return false;
  other_ = pose.inverse() * there;
  return before && !differs(*before, *other_);
}

Duration PrintCheck::pause(Duration cost) const {
  return suspected() || !looked_ ? kSecondLook : std::max(kPause, kCosts * cost);
}

}  // namespace sightline
