// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/detection_judge.hpp"

#include <algorithm>
#include <memory>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/judge/rival_places.hpp"
#include "observe/terms/detection_term.hpp"
#include "sightline/observe/terms/observation_header.hpp"

namespace sightline::observe {
namespace {

// Whether a camera has something to say of the pose.
bool measured_by(const DetectorFrames& frames, size_t camera, const JudgedPose& pose) {
  if (!pose.contour.empty()) return pose.contour[camera] >= kMinCameraContour;
  if (pose.proposal == nullptr) {
    return camera_evidence(pose.fit.cameras[camera]) >= kMinCameraEvidence;
  }
  return pose.proposal->terms[frames.camera_index(camera)] != nullptr;
}

}  // namespace

double camera_evidence(const CameraFit& fit) {
  return std::max(0.0, fit.share() * fit.contrast - kClutterEvidence);
}

JudgedPose DetectionJudge::judge(PoseFit fit, const ProposedPose* proposal) const {
  JudgedPose out;
  for (const CameraFit& camera : fit.cameras) {
    const double evidence = camera_evidence(camera);
    out.evidence += evidence;
    if (evidence >= kMinCameraEvidence) ++out.cameras;
  }
  out.evidence -= kTwistPenalty * 2 * twist_cost(fit.motion.twist);
  out.outline = out.evidence;
  out.fit = std::move(fit);
  out.proposal = proposal;
  if (proposal != nullptr) out.evidence += proposal->evidence;
  if (proposal != nullptr && proposal->confirmed) out.evidence += options_.accept;
  return out;
}

bool DetectionJudge::acceptable(const JudgedPose& pose, size_t cameras) const {
  if (pose.proposal != nullptr && pose.proposal->confirmed) return true;
  if (pose.proposal != nullptr && pose.proposal->evidence >= options_.accept / 2) {
    return pose.outline >= kMinCameraEvidence;
  }
  const size_t needed = std::min<size_t>(2, cameras);
  return pose.evidence >= options_.accept * static_cast<double>(needed) / 2 &&
         static_cast<size_t>(pose.cameras) >= needed;
}

bool DetectionJudge::clear(const JudgedPose& pose, size_t cameras) const {
  return acceptable(pose, cameras) && pose.evidence > kClearlyAccepted * options_.accept;
}

bool DetectionJudge::same_hypothesis(const JudgedPose& a, const JudgedPose& b) const {
  const Rigid3 &first = a.fit.motion.world_from_object, &second = b.fit.motion.world_from_object;
  const double distance = (first * center_ - second * center_).norm();
  const double angle = rotation_angle(first, second);
  const bool proposed = a.proposal != nullptr && b.proposal != nullptr;
  return distance < (proposed ? kSameProposedDistance : kSameFittedDistance) * radius_ &&
         angle < (proposed ? kSameProposedAngle : kSameFittedAngle);
}

bool DetectionJudge::elsewhere(const PoseFit& a, const PoseFit& b) const {
  const Rigid3 &first = a.motion.world_from_object, &second = b.motion.world_from_object;
  return (first * center_ - second * center_).norm() > kOtherPlace * radius_;
}

void DetectionJudge::decide(const DetectorFrames& frames, std::vector<JudgedPose>& judged,
                            Detection& out) const {
  if (judged.empty()) return;
  std::stable_sort(judged.begin(), judged.end(), [](const JudgedPose& a, const JudgedPose& b) {
    return a.evidence > b.evidence;
  });
  const JudgedPose& best = judged.front();
  if (best.proposal != nullptr && !acceptable(best, frames.size())) {
    out.runner_up = best.evidence;
    return;
  }
  RivalPlaces rivals(kOtherPlace * radius_, alike_);
  std::vector<const JudgedPose*> accepted;
  for (const JudgedPose& pose : judged) {
    const bool known = std::any_of(accepted.begin(), accepted.end(), [&](const JudgedPose* other) {
      return same_hypothesis(pose, *other);
    });
    if (known) continue;
    // A proposal that no outline speaks for is no answer, but leaves the answer in doubt.
    const bool possible = (acceptable(pose, frames.size()) || pose.proposal != nullptr) &&
                          pose.evidence >= options_.margin * best.evidence;
    // Clutter has many such places, the object one.
    if (possible && elsewhere(pose.fit, best.fit)) {
      rivals.add(pose.fit.motion.world_from_object * center_, pose.evidence);
      if (rivals.strongest() == 0) continue;
      out.runner_up = rivals.strongest();
      return;
    }
    if (possible && accepted.size() < kMaxAccepted) {
      accepted.push_back(&pose);
    } else {
      out.runner_up = std::max(out.runner_up, pose.evidence);
    }
  }
  report(frames, accepted, out);
}

double DetectionJudge::best_rival(const std::vector<ContourPose>& poses) const {
  RivalPlaces rivals(kOtherPlace * radius_, alike_);
  for (const ContourPose& pose : poses) {
    if (!elsewhere(pose.fit, poses.front().fit)) continue;
    rivals.add(pose.fit.motion.world_from_object * center_,
               pose.score * pose.extent / poses.front().extent);
  }
  return rivals.strongest();
}

void DetectionJudge::decide_by_contour(const DetectorFrames& frames,
                                       const std::vector<ContourPose>& poses, double min_score,
                                       double max_rival, Detection& out) const {
  if (poses.empty() || poses.front().score < min_score) return;
  const ContourPose& best = poses.front();
  std::vector<JudgedPose> here;
  for (const ContourPose& pose : poses) {
    if (elsewhere(pose.fit, best.fit) || pose.score < options_.margin * best.score) continue;
    here.push_back({pose.fit, pose.score, pose.score, 0, nullptr, pose.cameras});
  }
  const double rival = best_rival(poses);
  out.runner_up = std::max(out.runner_up, rival);
  if (rival > max_rival * best.score) return;
  std::vector<const JudgedPose*> accepted;
  for (JudgedPose& pose : here) {
    const bool known = std::any_of(accepted.begin(), accepted.end(), [&](const JudgedPose* other) {
      return same_hypothesis(pose, *other);
    });
    if (known || accepted.size() == kMaxAccepted) continue;
    pose.cameras = static_cast<int>(std::count_if(pose.contour.begin(), pose.contour.end(),
                                                  [](double c) { return c >= kMinCameraContour; }));
    accepted.push_back(&pose);
  }
  out.by_contour = true;
  out.contour_score = best.score;
  report(frames, accepted, out);
}

void DetectionJudge::report(const DetectorFrames& frames,
                            const std::vector<const JudgedPose*>& accepted, Detection& out) const {
  if (accepted.empty()) return;
  for (const JudgedPose* pose : accepted) {
    const RigMotion& motion = pose->fit.motion;
    out.poses.push_back({motion.world_from_object, motion.twist, pose->evidence, pose->cameras});
  }
  for (size_t i = 0; i < frames.size(); ++i) {
    if (!measured_by(frames, i, *accepted.front())) continue;
    out.observations.push_back(observation_of(frames, i, accepted));
  }
  std::stable_sort(
      out.observations.begin(), out.observations.end(),
      [](const Observation& a, const Observation& b) { return a.capture < b.capture; });
}

Observation DetectionJudge::observation_of(const DetectorFrames& frames, size_t camera,
                                           const std::vector<const JudgedPose*>& poses) const {
  const CameraId id = frames.cameras()[frames.camera_index(camera)].id;
  Observation out = make_observation(frames.info(camera), id, object_);
  std::vector<FrozenTerm> terms;
  int residuals = 0;
  for (const JudgedPose* pose : poses) {
    const Rigid3 here = pose->fit.motion.at(frames.fit_cameras()[camera].seconds);
    LinearizedTerm term = measurement(frames, camera, *pose, here);
    if (!terms.empty()) {  // this image knows no difference
      term.cost = out.hypotheses.front().cost;
      term.residuals = residuals;
    }
    residuals = term.residuals;
    terms.emplace_back(here, term);
    out.hypotheses.push_back({here, term.cost});
  }
  out.terms.push_back(std::make_shared<const DetectionTerm>(std::move(terms)));
  return out;
}

LinearizedTerm DetectionJudge::measurement(const DetectorFrames& frames, size_t camera,
                                           const JudgedPose& pose, const Rigid3& here) const {
  if (pose.proposal != nullptr && pose.proposal->terms[frames.camera_index(camera)] != nullptr) {
    return pose.proposal->terms[frames.camera_index(camera)]->linearize(here);
  }
  return measurement(pose.fit.cameras[camera]);
}

// The lines' information with the noise they have, and as if they were no more than they are
// worth. All cameras were fitted together, so the gradient is zero.
LinearizedTerm DetectionJudge::measurement(const CameraFit& fit) const {
  LinearizedTerm out;
  const double sigma = options_.sigma_px / fit.pixel_size;  // of its pixels
  out.information = fit.term.information * (options_.independent / (sigma * sigma));
  out.residuals = std::max(6, static_cast<int>(options_.independent * fit.agreeing));
  out.cost = 0.5 * out.residuals;
  out.quality = fit.share();
  return out;
}

}  // namespace sightline::observe
