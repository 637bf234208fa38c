// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "fuse/bank_state.hpp"
#include "fuse/update/pose_update.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Innovations of an optimal filter are white. Where those of one camera keep their direction, and
/// those of the others another one, its calibration or its time stamps are off, even if no single
/// one is beyond the gate; the filter takes the bias for new information in every frame and claims
/// a covariance that it cannot have. docs/estimator.md.

/// Largest systematic covariance that is believed [rad^2, m^2].
Matrix6 systematic_covariance(const EstimatorOptions& options);

/// The innovation of camera `index` of the minimum's systems.
InformationInnovation innovation_of(const PoseMinimum& minimum, size_t index);

/// Adds the innovation of a frame to the camera's means.
void add_innovation(const InformationInnovation& innovation, CameraRecord& record);

/// Share of systematic_covariance() by which these cameras differ in every frame, as their mean
/// innovations tell (maximum likelihood, beside what is left of a mean of white ones);
/// `state.bias_share` while fewer than two have enough frames.
double bias_share(CameraSet cameras, const EstimatorOptions& options, const BankState& state);

/// What an outline in one camera alone errs by over many frames, which nobody contradicts: a
/// multiple of what its frames claim [rad^2, m^2, tangent at `world_from_object`]; zero while it
/// has too few frames.
Matrix6 persistent_covariance(const CameraRecord& record, const Rigid3& world_from_object);

}  // namespace sightline::fuse
