// SPDX-License-Identifier: Apache-2.0
#include "pipeline/rolling_view.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "sightline/geometry/rolling_shutter.hpp"

namespace sightline::pipeline {
namespace {

// As far back as who looks at a frame asks: colors are learned from the frame before.
constexpr Duration kAskedFor = std::chrono::milliseconds(300);

/// A measurement of the object where it was `moved` from the pose that is asked about.
class MovedTerm final : public PoseTerm {
 public:
  MovedTerm(PoseTermPtr term, const Rigid3& moved)
      : term_(std::move(term)), moved_(moved), tangent_(moved.inverse().adjoint()) {}

  // X exp(d) moved = X moved exp(Ad(moved^-1) d)
  LinearizedTerm linearize(const Rigid3& world_from_object) const override {
    LinearizedTerm out = term_->linearize(world_from_object * moved_);
    out.information = tangent_.transpose() * out.information * tangent_;
    out.gradient = tangent_.transpose() * out.gradient;
    return out;
  }
  std::string_view kind() const override { return term_->kind(); }

 private:
  const PoseTermPtr term_;
  const Rigid3 moved_;
  const Matrix6 tangent_;
};

// The same, with what it says of a time said `delay` before.
PoseTrackPtr sooner(const PoseTrack& track, Time capture, Duration delay) {
  const std::vector<PoseEstimate>& all = track.history();
  auto first = std::lower_bound(all.begin(), all.end(), capture - kAskedFor,
                                [](const PoseEstimate& e, Time time) { return e.time < time; });
  if (first != all.begin()) --first;
  std::vector<PoseEstimate> history(first, all.end());
  for (PoseEstimate& estimate : history) {
    estimate.time -= delay;
    estimate.last_measured -= delay;
  }
  return std::make_shared<const PoseTrack>(track.object(), std::move(history), track.noise());
}

void move(const Rigid3& motion, std::vector<PoseHypothesis>& hypotheses) {
  for (PoseHypothesis& hypothesis : hypotheses) {
    hypothesis.world_from_object = hypothesis.world_from_object * motion;
  }
}

}  // namespace

RollingView::RollingView(CalibratedCamera camera, std::vector<Eigen::Vector3d> centers)
    : camera_(std::move(camera)), centers_(std::move(centers)) {}

Duration RollingView::delay_of(ObjectId object, const Rigid3& world_from_object) const {
  if (object.index() >= centers_.size()) return Duration(0);
  const Eigen::Vector3d center = world_from_object * centers_[object.index()];
  return from_seconds(row_delay_s(camera_, camera_.world_from_camera.inverse() * center));
}

void RollingView::look(const FrameInfo& info, std::span<const PoseTrackPtr> tracks) {
  if (info.place) camera_.world_from_camera = info.place->world_from_camera;
  tracks_.assign(tracks.begin(), tracks.end());
  motions_.clear();
  for (PoseTrackPtr& track : tracks_) {
    if (!track) continue;
    const PoseAt at = track->at(info.capture);
    if (at.source == PoseSource::kNone) continue;
    const Duration delay = delay_of(track->object(), at.estimate.world_from_object);
    const PoseAt then = track->at(info.capture + delay);
    if (then.source == PoseSource::kNone || delay == Duration(0)) continue;
    motions_.push_back({track->object(),
                        at.estimate.world_from_object.inverse() * then.estimate.world_from_object});
    track = sooner(*track, info.capture, delay);
  }
}

void RollingView::bring_back(std::span<Observation> observations) const {
  for (Observation& observation : observations) {
    const auto known = std::ranges::find(motions_, observation.object, &Motion::object);
    if (known == motions_.end()) continue;
    for (PoseTermPtr& term : observation.terms) {
      term = std::make_shared<const MovedTerm>(std::move(term), known->moved);
    }
    move(known->moved.inverse(), observation.hypotheses);
    move(known->moved.inverse(), observation.symmetric_hypotheses);
  }
}

}  // namespace sightline::pipeline
