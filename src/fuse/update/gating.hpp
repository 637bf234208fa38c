// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "fuse/bank_state.hpp"
#include "fuse/update/chi_square.hpp"
#include "fuse/update/pose_update.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Standard deviations of "anywhere": the prior of a start, and of a measurement that a hypothesis
/// cannot explain [rad, m].
constexpr double kAnywhereRotation = 2.0;
constexpr double kAnywhereTranslation = 3.0;
Matrix6 anywhere_covariance();

/// What the cameras of a set say under one hypothesis.
struct GatedUpdate {
  PoseMinimum minimum;  ///< of prior and accepted cameras
  std::vector<CameraMeasurement> accepted_measurements;
  CameraSet accepted = 0;
  CameraSet gated = 0;
  /// -2 log of the probability of the measurements under this hypothesis (Laplace), up to a
  /// constant that is the same for all hypotheses.
  double evidence = 0;
  double penalty = 0;  ///< its part from cameras that are not explained
  /// How the accepted cameras' own minima lie to that of the rest, before any inflation in this
  /// set; index: camera bit.
  std::array<Agreement, 64> agreement{};
  bool inconsistent = false;  ///< a camera's covariance had to be inflated, or it was refused
  /// Chi-square per residual of the accepted cameras before scaling; index: camera bit.
  std::array<double, 64> normalized_cost{};
};

/// Decides by chi-square gating which cameras take part in an update, and does the update of the
/// pose.
class Gating {
 public:
  explicit Gating(const EstimatorOptions& options);

  /// One joint minimum of all cameras. The covariance of a camera beyond the gate by no more than
  /// calibration and stamps may be off is inflated until it passes; if one is an outlier, each is
  /// tested against the prior alone, and those that pass against one another. `result` is reused.
  void run(const PosePrior& prior, std::span<const CameraMeasurement> measurements,
           const Rigid3& start, GatedUpdate& result);

 private:
  enum class Fit { kConsistent, kBiased, kOutlier };
  struct Innovation {
    double nis = 0;
    int dof = 0;
    bool usable = false;
    Fit fit = Fit::kOutlier;
    Agreement agreement;
    double inflation = 1.0;  ///< of `systematic` that would make the innovation an expected one
  };
  Innovation innovation(const Matrix6& rest_information, const CameraMeasurement& measurement,
                        const CameraSystem& system, const Rigid3& pose) const;
  Innovation innovation_in(const PoseMinimum& minimum, size_t index,
                           std::span<const CameraMeasurement> measurements) const;
  double other_minimum_gain(const CameraMeasurement& measurement, const CameraSystem& system,
                            const Rigid3& pose) const;
  double own_cost(const CameraMeasurement& measurement, const CameraSystem& system,
                  const Rigid3& pose) const;
  Fit test_jointly(const PoseMinimum& minimum, std::span<const CameraMeasurement> measurements,
                   std::vector<Innovation>& innovations) const;
  size_t worst_outlier(std::span<const Innovation> innovations) const;
  void inflate(std::span<const Innovation> innovations, GatedUpdate& result) const;
  void gate_individually(const PosePrior& prior, std::span<const CameraMeasurement> measurements,
                         const Rigid3& start, GatedUpdate& result,
                         std::vector<CameraSystem>& accepted_alone);
  void remove_outliers(const PosePrior& prior, const Rigid3& start, GatedUpdate& result,
                       std::vector<CameraSystem>& accepted_alone);
  void refuse(const CameraMeasurement& measurement, const CameraSystem& alone,
              GatedUpdate& result) const;
  void finish(const PosePrior& prior, GatedUpdate& result);
  double outlier_evidence(const CameraMeasurement& measurement, const CameraSystem& alone) const;

  double min_quality_;
  double max_normalized_cost_;
  Matrix6 systematic_covariance_;
  ChiSquareTable gate_;
  Minimizer minimizer_;
  // Scratch of one call, kept so that nothing is allocated after warm-up.
  PoseMinimum minimum_alone_;
  std::vector<Innovation> innovations_;
  std::vector<CameraSystem> accepted_alone_;
};

}  // namespace sightline::fuse
