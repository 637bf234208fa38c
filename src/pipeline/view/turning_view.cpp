// SPDX-License-Identifier: Apache-2.0
#include "pipeline/view/turning_view.hpp"

#include <utility>

#include "pipeline/view/moved_term.hpp"

namespace sightline::pipeline {

TurningView::TurningView(const Rigid3& world_from_rest, std::shared_ptr<const RayTable> rays,
                         std::shared_ptr<const std::vector<RenderMesh>> scene)
    : world_from_rest_(world_from_rest), depth_(std::move(rays), std::move(scene)) {}

bool TurningView::look(const FrameInfo& info, std::span<const PoseTrackPtr> tracks) {
  if (!info.place || !info.place->trusted()) {
    before_.reset();
    now_ = {};
    return false;
  }
  if (now_.capture != Time{}) before_ = now_;
  now_ = {info.capture, world_from_rest_ * info.place->world_from_camera.inverse()};
  if (before_ && before_->capture >= now_.capture) before_.reset();
  uncertain_ = info.place->covariance;
  depth_.turn_to(info.place->world_from_camera);
  tracks_.clear();
  for (const PoseTrackPtr& track : tracks) tracks_.push_back(track ? turned(*track) : nullptr);
  return true;
}

// Exact at two times: that of the frame, and that of the one before, from which colors are learned
// with the pose that it has now. Between them nobody asks.
PoseTrackPtr TurningView::turned(const PoseTrack& track) const {
  std::vector<PoseEstimate> history;
  history.reserve(2);
  const auto add = [&](const Look& look) {
    const PoseAt at = track.at(look.capture);
    if (at.source == PoseSource::kNone) return;
    history.push_back(at.estimate);
    history.back().time = look.capture;
    history.back().world_from_object = look.rest_from_world * at.estimate.world_from_object;
  };
  if (before_) add(*before_);
  add(now_);
  // What is not known of the camera's place lets the object pass before it elsewhere, too.
  if (uncertain_ && !history.empty() && history.back().time == now_.capture) {
    PoseEstimate& now = history.back();
    const Rigid3 world_from_object = now_.rest_from_world.inverse() * now.world_from_object;
    now.covariance.topLeftCorner<6, 6>() +=
        world_from_object.inverse().covariance_in_target(*uncertain_);
  }
  return std::make_shared<const PoseTrack>(track.object(), std::move(history), track.noise());
}

void TurningView::bring_back(std::span<Observation> observations) const {
  for (Observation& observation : observations) {
    say_of_pose(now_.rest_from_world, Rigid3(), observation);
  }
}

}  // namespace sightline::pipeline
