// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/frozen_observation.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <limits>

namespace sightline {
namespace {

constexpr size_t kMostReferences = 6;
constexpr int kMostSteps = 5;
constexpr double kConverged = 1e-5;                           // [rad, m]
constexpr double kFarRotation = 0.35, kFarTranslation = 0.1;  // [rad, m] from the prediction
constexpr double kSameRotation = 0.01, kSameTranslation = 0.002;
constexpr double kMetersPerRadian = 0.25;  // of distances between references

FrozenKind kind_of(const PoseTerm& term) {
  const std::string_view kind = term.kind();
  if (kind == "fiducial") return FrozenKind::kFiducial;
  if (kind == "texture") return FrozenKind::kTexture;
  // Claims go by them as by an outline; that they may tell turns about an axis is given up.
  if (kind == "sparse_texture") return FrozenKind::kOutline;
  if (kind == "region" || kind == "edge" || kind == "detection") return FrozenKind::kOutline;
  return FrozenKind::kOther;
}

void add(const LinearizedTerm& term, LinearizedTerm& sum) {
  sum.information += term.information;
  sum.gradient += term.gradient;
  sum.cost += term.cost;
  sum.quality += term.quality * term.residuals;
  sum.residuals += term.residuals;
}

bool is_finite(const LinearizedTerm& term) {
  return std::isfinite(term.cost) && term.gradient.allFinite() && term.information.allFinite();
}

std::vector<FrozenPart> parts_at(const Rigid3& pose, const std::vector<PoseTermPtr>& terms) {
  std::array<LinearizedTerm, kFrozenKinds> sums;
  for (const PoseTermPtr& term : terms) {
    const LinearizedTerm part = term->linearize(pose);
    if (part.residuals <= 0) continue;
    if (!is_finite(part)) return {};
    add(part, sums.at(static_cast<size_t>(kind_of(*term))));
  }
  std::vector<FrozenPart> parts;
  for (size_t kind = 0; kind < kFrozenKinds; ++kind) {
    LinearizedTerm& sum = sums.at(kind);
    if (sum.residuals <= 0) continue;
    sum.quality /= sum.residuals;
    sum.information = (0.5 * (sum.information + sum.information.transpose())).eval();
    parts.push_back({static_cast<FrozenKind>(kind), sum});
  }
  return parts;
}

// The minimum of the terms and of what the track expects: where the fusion will end up, about. The
// nearer the reference, the less it matters that the terms are curved.
Rigid3 best_next_to(const PoseEstimate& expected, const std::vector<PoseTermPtr>& terms) {
  const Rigid3& start = expected.world_from_object;
  const Matrix6 weight = expected.own_covariance().ldlt().solve(Matrix6::Identity());
  if (!weight.allFinite()) return start;
  Rigid3 pose = start;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vector6 x = difference(start, pose);
    const Matrix6 jacobian = right_jacobian_inverse(x);
    Matrix6 information = jacobian.transpose() * weight * jacobian;
    Vector6 gradient = jacobian.transpose() * (weight * x);
    for (const PoseTermPtr& term : terms) {
      const LinearizedTerm part = term->linearize(pose);
      if (part.residuals <= 0) continue;
      if (!is_finite(part)) return start;
      information += part.information;
      gradient += part.gradient;
    }
    const Vector6 move = -information.ldlt().solve(gradient);
    if (!move.allFinite()) return start;
    pose = pose * Rigid3::exp(move);
    if (rotation_angle(start, pose) > kFarRotation ||
        translation_distance(start, pose) > kFarTranslation) {
      return start;
    }
    if (move.cwiseAbs().maxCoeff() < kConverged) break;
  }
  return pose;
}

void add_reference(const Rigid3& pose, const std::vector<PoseTermPtr>& terms,
                   std::vector<FrozenAt>& at) {
  if (at.size() >= kMostReferences) return;
  for (const FrozenAt& other : at) {
    if (rotation_angle(other.reference, pose) < kSameRotation &&
        translation_distance(other.reference, pose) < kSameTranslation) {
      return;
    }
  }
  std::vector<FrozenPart> parts = parts_at(pose, terms);
  if (!parts.empty()) at.push_back({pose, std::move(parts)});
}

PoseTermPtr terms_of(const std::vector<FrozenAt>& all, FrozenKind kind) {
  std::vector<FrozenTerms::At> at;
  bool any = false;
  for (const FrozenAt& one : all) {
    LinearizedTerm term;  // where it says nothing it has to say so
    for (const FrozenPart& part : one.parts) {
      if (part.kind == kind) term = part.term;
    }
    any = any || term.residuals > 0;
    at.push_back({one.reference, FrozenTerm(one.reference, term)});
  }
  if (!any) return nullptr;
  return std::make_shared<const FrozenTerms>(std::move(at), kind);
}

}  // namespace

std::string_view FrozenTerms::kind() const {
  static constexpr std::array<std::string_view, kFrozenKinds> kNames = {"frozen", "region",
                                                                        "fiducial", "texture"};
  return kNames.at(static_cast<size_t>(kind_));
}

LinearizedTerm FrozenTerms::linearize(const Rigid3& world_from_object) const {
  const At* nearest = nullptr;
  double least = std::numeric_limits<double>::max();
  for (const At& at : at_) {
    const double distance =
        rotation_angle(at.reference, world_from_object) +
        translation_distance(at.reference, world_from_object) / kMetersPerRadian;
    if (distance >= least) continue;
    least = distance;
    nearest = &at;
  }
  return nearest == nullptr ? LinearizedTerm{} : nearest->term.linearize(world_from_object);
}

std::optional<CellObservation> freeze(const Observation& observation, const PoseTrack* track) {
  CellObservation out;
  out.capture_error = observation.capture_error;
  out.stream_epoch = observation.epoch;
  out.frame = observation.sequence;
  out.hypotheses = observation.hypotheses;
  out.symmetric_hypotheses = observation.symmetric_hypotheses;
  out.picture = observation.picture;
  out.print = observation.print;
  out.refutes = observation.refutes;
  if (observation.calibration_covariance) {
    out.calibration_covariance = *observation.calibration_covariance;
  }
  if (observation.terms.empty()) return out;
  if (track != nullptr) {
    const PoseAt expected = track->at(observation.capture);
    if (expected.source != PoseSource::kNone) {
      add_reference(best_next_to(expected.estimate, observation.terms), observation.terms, out.at);
    }
  }
  for (const auto* list : {&observation.hypotheses, &observation.symmetric_hypotheses}) {
    for (const PoseHypothesis& hypothesis : *list) {
      add_reference(hypothesis.world_from_object, observation.terms, out.at);
    }
  }
  if (out.at.empty()) return std::nullopt;
  return out;
}

Observation thaw(CellObservation observation, ObjectId object, CameraId camera, Time capture) {
  Observation out;
  out.object = object;
  out.camera = camera;
  out.epoch = observation.stream_epoch;
  out.sequence = observation.frame;
  out.capture = capture;
  out.capture_error = observation.capture_error;
  for (size_t i = 0; i < kFrozenKinds; ++i) {
    auto term = terms_of(observation.at, static_cast<FrozenKind>(i));
    if (term) out.terms.push_back(std::move(term));
  }
  out.hypotheses = std::move(observation.hypotheses);
  out.symmetric_hypotheses = std::move(observation.symmetric_hypotheses);
  out.picture = observation.picture;
  out.print = observation.print;
  out.refutes = observation.refutes;
  if (observation.calibration_covariance) {
    out.calibration_covariance =
        std::make_shared<const Matrix6>(*observation.calibration_covariance);
  }
  return out;
}

}  // namespace sightline
