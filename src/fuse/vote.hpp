// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "bank_state.hpp"
#include "chi_square.hpp"
#include "pose_update.hpp"
#include "sightline/fuse/estimator.hpp"

namespace sightline::fuse {

/// Standard deviations of "anywhere": the prior of a start, and of a measurement that a hypothesis
/// cannot explain [rad, m].
constexpr double kAnywhereRotation = 2.0;
constexpr double kAnywhereTranslation = 3.0;
Matrix6 anywhere_covariance();

/// What the cameras of a set say under one hypothesis.
struct Verdict {
  PoseMinimum minimum;  ///< of prior and accepted cameras
  std::vector<Voter> accepted_voters;
  CameraSet accepted = 0;
  CameraSet gated = 0;
  /// -2 log of the probability of the measurements under this hypothesis (Laplace), up to a
  /// constant that is the same for all hypotheses.
  double evidence = 0;
  double penalty = 0;  ///< its part from cameras that are not explained
  /// How the accepted cameras' own minima lie to what the rest wants, before any widening of this
  /// set; index: camera bit.
  std::array<Agreement, 64> agreement{};
  bool strained = false;  ///< a camera had to be widened or refused
  /// Chi-square per residual of the accepted cameras before scaling; index: camera bit.
  std::array<double, 64> normalized_cost{};
};

/// Decides which cameras take part in an update, and does the update of the pose.
class Vote {
 public:
  explicit Vote(const EstimatorOptions& options);

  /// One joint minimum of all cameras. A camera beyond the chi-square gate by no more than
  /// calibration and stamps may be off is widened until it fits; if one contradicts, each is tested
  /// against the prior alone, and the survivors against one another.
  void hold(const PosePrior& prior, std::span<const Voter> voters, const Rigid3& start,
            Verdict& verdict);

 private:
  enum class Fit { kFits, kOff, kContradicts };
  struct Innovation {
    double nis = 0;
    int dof = 0;
    bool usable = false;
    Fit fit = Fit::kContradicts;
    Agreement agreement;
    double widening = 1.0;  ///< of `systematic` that would make the innovation an expected one
  };
  Innovation innovation(const Matrix6& rest_information, const Voter& voter,
                        const CameraSystem& system, const Rigid3& pose) const;
  Innovation innovation_in(const PoseMinimum& minimum, size_t index,
                           std::span<const Voter> voters) const;
  double elsewhere(const Voter& voter, const CameraSystem& system, const Rigid3& pose) const;
  double own_cost(const Voter& voter, const CameraSystem& system, const Rigid3& pose) const;
  Fit test_all(const PoseMinimum& minimum, std::span<const Voter> voters);
  void widen(Verdict& verdict) const;
  void test_alone(const PosePrior& prior, std::span<const Voter> voters, const Rigid3& start,
                  Verdict& verdict);
  void agree_among_themselves(const PosePrior& prior, const Rigid3& start, Verdict& verdict);
  void refuse(const Voter& voter, const CameraSystem& alone, Verdict& verdict) const;
  void sum_up(const PosePrior& prior, Verdict& verdict);
  double unexplained(const Voter& voter, const CameraSystem& alone) const;

  double min_quality_;
  double max_normalized_cost_;
  Matrix6 systematic_covariance_;
  ChiSquareTable gate_;
  Minimizer minimizer_;
  PoseMinimum alone_;
  std::vector<Innovation> innovations_;      // of the voters, last test
  std::vector<CameraSystem> alone_systems_;  // of accepted_voters
};

}  // namespace sightline::fuse
