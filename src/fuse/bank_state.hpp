// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "sightline/model/lookalikes.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline::fuse {

/// Learned factors of the nominal power densities of acceleration.
struct MotionScale {
  double angular = 1.0;
  double linear = 1.0;

  friend bool operator==(const MotionScale&, const MotionScale&) = default;
};

/// The newest two corrections of predictions (tangent offsets).
struct MotionMemory {
  Time since{};  ///< of the newest one
  Vector6 offset = Vector6::Zero();
  Vector6 before = Vector6::Zero();
};

/// Costs (-log probability) of the poses that look alike; the hypothesis' own pose first.
using TurnCosts = std::array<double, Lookalikes::kMost + 1>;

/// One pose that the object may have, with its filter state.
struct Hypothesis {
  PoseEstimate estimate;
  double evidence = 0;    ///< -2 log likelihood, the best of the bank at 0
  int confirmations = 0;  ///< camera frames that agreed since it was found
  MotionScale motion;
  MotionMemory corrections;
  /// Inverse covariance of the part of the error that does not average out over frames
  /// (calibration): of the cameras that hold the object. Zero: unknown.
  Matrix6 systematic_information = Matrix6::Zero();
  TurnCosts turn_costs{};  ///< see AlikePoses
  /// Contradicts the hypothesis in force and has to prove itself before it is published.
  bool challenger = false;
};

/// Squared distance of a camera from the rest, in its own covariance (the share of the innovation
/// that is charged to the camera), and its expectation if the covariances are right.
struct Agreement {
  double squared = 0;
  double expected = 0;
};

/// How far a camera's own pose lies from the prediction, in world axes about the object's origin:
/// information times offset, and the information.
struct Pull {
  Eigen::Matrix<float, 6, 1> force = Eigen::Matrix<float, 6, 1>::Zero();
  Eigen::Matrix<float, 6, 6> information = Eigen::Matrix<float, 6, 6>::Zero();
};

/// What is remembered of one camera.
struct CameraRecord {
  Time last_look{};
  Duration period{0};       ///< of its frames, smoothed; 0: unknown
  double scale = 1.0;       ///< smoothed chi-square per residual of its measurements
  double systematic = 1.0;  ///< learned: see Voter::systematic
  double unproven = 1.0;    ///< share of the largest systematic variance that it may still have
  Pull pull;                ///< fading mean
  double pull_square = 0;   ///< fading mean of its squared size, see SteadyPull
  double pulls = 0;         ///< looks in it, up to its memory
  bool known = false;
  bool seen = false;     ///< accepted at its last look
  bool refused = false;  ///< contradicted at its last look
};

/// Everything the estimator knows after a set. A value: late sets restore an older one.
struct BankState {
  static constexpr size_t kMaxHypotheses = 4;
  std::array<Hypothesis, kMaxHypotheses> hypotheses;  ///< the one in force first
  int count = 0;
  std::array<CameraRecord, 64> cameras;
  CameraSet known = 0;
  PoseEstimate published;
  /// What cameras pull apart steadily, as a share of the largest systematic variance.
  double steady = 0;
  bool found_before = false;  ///< published.last_measured means something

  // Of the last set alone.
  CameraSet gated = 0;
  int iterations = 0;
  bool started = false;
  bool reset = false;
};

/// One possible continuation of the bank after a set.
struct Outcome {
  Hypothesis hypothesis;
  CameraSet accepted = 0;
  CameraSet gated = 0;
  int iterations = 0;
  std::array<double, 64> normalized_cost{};
  std::array<Agreement, 64> agreement{};
  std::array<Pull, 64> pulls{};
};

}  // namespace sightline::fuse
