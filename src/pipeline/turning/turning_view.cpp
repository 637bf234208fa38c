// SPDX-License-Identifier: Apache-2.0
#include "pipeline/turning/turning_view.hpp"

#include <utility>

namespace sightline::pipeline {
namespace {

/// A measurement of a camera that was believed to be at rest.
class TurnedTerm final : public PoseTerm {
 public:
  TurnedTerm(PoseTermPtr term, const Rigid3& rest_from_world)
      : term_(std::move(term)), rest_from_world_(rest_from_world) {}
  LinearizedTerm linearize(const Rigid3& world_from_object) const override {
    return term_->linearize(rest_from_world_ * world_from_object);
  }
  std::string_view kind() const override { return term_->kind(); }

 private:
  const PoseTermPtr term_;
  const Rigid3 rest_from_world_;
};

void move(const Rigid3& world_from_rest, std::vector<PoseHypothesis>& hypotheses) {
  for (PoseHypothesis& hypothesis : hypotheses) {
    hypothesis.world_from_object = world_from_rest * hypothesis.world_from_object;
  }
}

}  // namespace

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
  const Rigid3 world_from_rest = now_.rest_from_world.inverse();
  for (Observation& observation : observations) {
    for (PoseTermPtr& term : observation.terms) {
      term = std::make_shared<const TurnedTerm>(std::move(term), now_.rest_from_world);
    }
    move(world_from_rest, observation.hypotheses);
    move(world_from_rest, observation.symmetric_hypotheses);
  }
}

}  // namespace sightline::pipeline
