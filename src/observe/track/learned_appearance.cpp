// SPDX-License-Identifier: Apache-2.0
#include "observe/track/learned_appearance.hpp"

#include <utility>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

bool held_by_others(const PoseEstimate& estimate, const TrackerOptions& options) {
  constexpr DegradedReasons kFewer = kWeakPosition | kOneCamera;  // as one camera alone is
  const bool held =
      estimate.state == TrackState::kTracking ||
      (estimate.state == TrackState::kDegraded && (estimate.degraded_reasons & ~kFewer) == 0);
  return held && estimate.own_sigma_rotation() < options.held_pose.rotation &&
         estimate.own_sigma_translation() < options.held_pose.translation;
}

LearnedAppearance::LearnedAppearance(const TrackerCamera& camera, CameraId id,
                                     const TrackedObject& object)
    : camera_(camera), id_(id) {
  if (object.modalities.texture && object.depth) {
    texture_ = std::make_unique<TexturePoints>(camera.camera->model, object.depth);
  }
}

void LearnedAppearance::initialize(const Frame& frame, const PlacedOutline& outline,
                                   size_t aspect) {
  forget();
  collect_colors(ColorReader(frame.i420()), outline.lines(), tuning::kLearnGapPx,
                 tuning::kLearnReachPx, pending_.foreground, pending_.background);
  pending_.any = false;  // their place was taken
  provisional_ = from_detection_ =
      colors_.learn(aspect, pending_.foreground, pending_.background, 1.0f);
}

void LearnedAppearance::forget() {
  colors_.forget();
  local_colors_.forget();
  if (texture_) texture_->forget();
  provisional_ = from_detection_ = false;
}

bool LearnedAppearance::learn_pending(const PoseTrack& track, const PlacedOutline& outline) {
  const TrackerOptions& options = camera_.options;
  const bool replace = std::exchange(pending_.replace, false);
  if (!std::exchange(pending_.any, false)) return false;
  const PoseAt at = track.at(pending_.capture);
  const PoseEstimate& estimate = at.estimate;
  const bool counted = (estimate.cameras & camera_bit(id_)) != 0;
  if (at.source == PoseSource::kEstimated && has_pose(estimate.state)) {
    missed_ = counted ? 0 : missed_ + (held_by_others(estimate, options) ? 1 : 0);
  }
  const bool ambiguous =
      estimate.state == TrackState::kDegraded && estimate.degraded_reasons == kAmbiguous;
  // What is certain must not be mixed with what may be of a symmetric pose.
  const bool tracked = estimate.state == TrackState::kTracking;
  const bool follows = from_detection_ && has_pose(estimate.state);
  const bool allowed = tracked || follows || (ambiguous && (provisional_ || !known()));
  if (at.source != PoseSource::kEstimated || !allowed || !counted ||
      outline.distance_to(estimate.world_from_object) > options.learn_distance_px) {
    if (texture_) texture_->drop_candidates();
    return false;
  }
  provisional_ |= ambiguous;
  from_detection_ &= !tracked;
  // Points of texture stay where the pose puts them: it has to be known.
  if (texture_ && estimate.own_sigma_rotation() < options.texture_pose.rotation &&
      estimate.own_sigma_translation() < options.texture_pose.translation) {
    texture_->keep_candidates(camera_.camera_from_world * estimate.world_from_object);
  } else if (texture_) {
    texture_->drop_candidates();
  }
  if (replace) colors_.forget();
  if (pending_.local) {
    const auto rate = static_cast<float>(options.learning_rate);
    local_colors_.learn(pending_.counts, rate, tuning::kFreshLocalShare);
  } else if (pending_.clear && local_colors_.known()) {
    local_colors_.forget();
  }
  const double rate = from_detection_ ? tuning::kInitialRate : options.learning_rate;
  return colors_.learn(pending_.aspect, pending_.foreground, pending_.background,
                       static_cast<float>(rate));
}

void LearnedAppearance::review(const PoseAt& at, const Rigid3& measured) {
  if (!provisional_) return;
  const bool there = at.source != PoseSource::kNone && has_pose(at.estimate.state);
  if (!there || rotation_angle(at.estimate.world_from_object, measured) > tuning::kSymmetricJump) {
    forget();
  } else if (at.estimate.state == TrackState::kTracking) {
    provisional_ = false;
  }
}

bool LearnedAppearance::misses_object(const PoseEstimate& estimate) const {
  return missed_ >= tuning::kBlindFrames && held_by_others(estimate, camera_.options);
}

void LearnedAppearance::note_missed(const PoseEstimate& estimate) {
  missed_ += held_by_others(estimate, camera_.options) ? 1 : 0;
}

void LearnedAppearance::note_seen(const Frame& frame, const PlacedOutline& outline, size_t aspect,
                                  const ObjectTracker::TrackResult& result, bool replace) {
  collect_colors(ColorReader(frame.i420()), outline.lines(), tuning::kLearnGapPx,
                 tuning::kLearnReachPx, pending_.foreground, pending_.background);
  if (result.local_colors) {
    collect_local_colors(ColorReader(frame.i420()), outline.lines(), outline.center(),
                         tuning::kLearnGapPx, tuning::kLearnReachPx, pending_.counts);
  }
  if (texture_ && !result.by_print) {
    const Eigen::AlignedBox2d box = outline.bounds();
    texture_->note_candidates(frame.gray(), static_cast<int>(box.min().x()),
                              static_cast<int>(box.min().y()), static_cast<int>(box.max().x()),
                              static_cast<int>(box.max().y()));
  }
  pending_.any = true;
  pending_.local = result.local_colors;
  pending_.clear = !result.local_colors && result.evidence >= tuning::kClearEvidence;
  pending_.replace = replace;
  pending_.capture = frame.info().capture;
  pending_.aspect = aspect;
}

}  // namespace sightline::observe
