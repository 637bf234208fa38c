// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/lines/trail.hpp"

#include <algorithm>
#include <optional>

namespace sightline::render {
namespace {

/// The line through the points so far; a gap begins it anew.
class FadingLine {
 public:
  FadingLine(const FrameTarget& target, const Subject& subject)
      : target_(target), subject_(subject) {}

  void gap() { begun_ = false; }
  /// `age`: 0 now .. 1 gone. Points that are close to the one before are left out, but the last.
  void add(const std::optional<Eigen::Vector2d>& pixel, double age, bool last) {
    if (!pixel) return gap();
    const draw::Point here = pixel->cast<float>();
    constexpr float kShortest = 3;
    if (begun_ && !last && (here - previous_).norm() < kShortest) return;
    if (begun_) {
      const auto opacity = static_cast<float>(std::clamp(1 - age, 0.0, 1.0));
      draw::line(target_.canvas, previous_, here,
                 {subject_.line_style.color, subject_.line_style.line_px, opacity, false});
    }
    previous_ = here;
    begun_ = true;
  }

 private:
  const FrameTarget& target_;
  const Subject& subject_;
  draw::Point previous_ = draw::Point::Zero();  // no optional: g++ 12 for arm64 warns of its value
  bool begun_ = false;
};

}  // namespace

void draw_trail(const FrameTarget& target, const CameraModel& model,
                const Rigid3& camera_from_world, const Subject& subject, Time capture) {
  const double span = subject.style().trail_seconds;
  if (span <= 0 || subject.track == nullptr) return;
  FadingLine line(target, subject);
  const Eigen::Vector3d center = subject.object->mesh->center.cast<double>();
  for (const PoseEstimate& past : subject.track->history()) {
    if (past.time >= capture) break;
    const double age = to_seconds(capture - past.time);
    if (age > span) continue;
    if (has_pose(past.state)) {
      line.add(model.project(camera_from_world * (past.world_from_object * center)), age / span,
               false);
    } else {
      line.gap();
    }
  }
  line.add(model.project(subject.center), 0, true);
}

}  // namespace sightline::render
