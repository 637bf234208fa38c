// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "bank_state.hpp"
#include "pose_update.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Innovations of an optimal filter are white. Where a camera goes on pulling the same way, and
/// the others another, its calibration or its stamps are off, by however little it contradicts the
/// single prediction; the filter takes that for new in every frame and claims to know better than
/// it can. docs/estimator.md.

/// Largest systematic covariance that is believed [rad^2, m^2].
Matrix6 systematic_covariance(const EstimatorOptions& options);

/// The pull of camera `index` of the minimum's systems.
Pull pull_of(const PoseMinimum& minimum, size_t index);

/// Adds a look to the camera's memory.
void remember(const Pull& pull, const EstimatorOptions& options, CameraRecord& record);

/// Share of systematic_covariance() that the steady differences between these cameras' pulls need,
/// beyond what white innovations of their size leave; `state.steady` where fewer than two have a
/// memory.
double steady_share(CameraSet cameras, const EstimatorOptions& options, const BankState& state);

}  // namespace sightline::fuse
