// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/object_fusion.hpp"

#include <algorithm>

#include "sightline/base/check.hpp"

namespace sightline {

Result<std::unique_ptr<ObjectFusion>> ObjectFusion::create(
    const EstimatorOptions& options, std::span<const NamedObject> objects,
    std::span<const ShapeSymmetry> shape_symmetry, std::shared_ptr<TrackBoard> board,
    std::unique_ptr<CalibrationWatch> watch) {
  std::unique_ptr<ObjectFusion> fusion(new ObjectFusion());
  for (size_t i = 0; i < objects.size(); ++i) {
    fusion->shape_symmetry_.push_back(i < shape_symmetry.size() ? shape_symmetry[i]
                                                                : ShapeSymmetry());
    SL_ASSIGN(ObjectEstimator estimator,
              ObjectEstimator::create(options, objects[i].id, fusion->shape_symmetry_.back()));
    fusion->tracks_.push_back(estimator.track());
    fusion->estimators_.push_back(std::move(estimator));
  }
  fusion->options_ = options;
  fusion->board_ = std::move(board);
  fusion->watch_ = std::move(watch);
  return fusion;
}

std::span<const UpdateReport> ObjectFusion::process(std::span<const Observation> observed) {
  const std::span<const Observation> set = with_calibration_covariance(observed);
  reports_.clear();
  verdict_ = false;
  for (size_t i = 0; i < estimators_.size(); ++i) {
    const bool among = std::any_of(set.begin(), set.end(), [&](const Observation& observation) {
      return observation.object.index() == i;
    });
    if (!among) continue;
    reports_.push_back(estimators_[i].process(set));  // it takes what is of its object
    if (!reports_.back().dropped) publish(i);
  }
  look_for_swaps();
  if (watch_) {
    for (const Observation& observation : set) {
      if (turns(observation)) continue;
      verdict_ |= watch_->add(observation, *tracks_[observation.object.index()]);
    }
  }
  return reports_;
}

void ObjectFusion::look_for_swaps() {
  if (!swaps_) return;
  swaps_->update(tracks_);
  for (size_t i = 0; i < estimators_.size(); ++i) {
    estimators_[i].set_possible_swap(swaps_->suspected(ObjectId(static_cast<uint32_t>(i))));
  }
}

bool ObjectFusion::turns(const Observation& observation) const {
  const auto& known = watch_->extra_covariance(observation.camera);
  return observation.calibration_covariance && observation.calibration_covariance != known;
}

namespace {

// What a camera without a vote says of an object: that it has sent a frame.
void take_vote(Observation& observation) {
  observation.terms.clear();
  observation.hypotheses.clear();
  observation.symmetric_hypotheses.clear();
  observation.picture.reset();
}

}  // namespace

// A camera that stands elsewhere than its calibration says loses its vote as far as it is wrong.
std::span<const Observation> ObjectFusion::with_calibration_covariance(
    std::span<const Observation> set) {
  const auto affected = [this](const Observation& o) {
    return watch_->extra_covariance(o.camera) != nullptr;
  };
  if (!watch_ || std::ranges::none_of(set, affected)) return set;
  widened_.assign(set.begin(), set.end());
  for (Observation& o : widened_) {
    if (!turns(o)) o.calibration_covariance = watch_->extra_covariance(o.camera);
    const auto watched = watch_->cameras();
    const size_t camera = o.camera.index();
    if (camera < watched.size() && watched[camera].state == CalibrationState::kUnfit) take_vote(o);
  }
  return widened_;
}

std::span<const ObjectId> ObjectFusion::advance(Time now) {
  changed_.clear();
  for (size_t i = 0; i < estimators_.size(); ++i) {
    const TrackState before = estimators_[i].state();
    estimators_[i].advance(now);
    if (estimators_[i].state() == before) continue;
    publish(i);
    changed_.push_back(tracks_[i]->object());
  }
  return changed_;
}

void ObjectFusion::set_doubted(ObjectId object, bool doubted) {
  estimators_.at(object.index()).set_doubted(doubted);
}

void ObjectFusion::forget(ObjectId object) {
  const size_t index = object.index();
  auto estimator = ObjectEstimator::create(options_, object, shape_symmetry_.at(index));
  SL_CHECK(estimator.has_value(), "options that were good once");
  estimators_[index] = *std::move(estimator);
  if (swaps_) swaps_->forget(object);
  publish(index);
}

bool ObjectFusion::adopt(const PoseTrack& track) {
  ObjectEstimator& estimator = estimators_.at(track.object().index());
  if (has_pose(estimator.state()) || !estimator.adopt(track)) return false;
  publish(track.object().index());
  return true;
}

void ObjectFusion::publish(size_t object) {
  tracks_[object] = estimators_[object].track();
  if (board_) board_->publish(tracks_[object]->object(), tracks_[object]);
}

}  // namespace sightline
