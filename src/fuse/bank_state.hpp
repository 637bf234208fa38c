// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "sightline/model/pose_track.hpp"
#include "sightline/model/shape_symmetry.hpp"

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

/// Costs (-log probability) of the poses that the shape cannot tell apart; the hypothesis' own pose
/// first.
using SymmetryCosts = std::array<double, ShapeSymmetry::kMax + 1>;

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
  SymmetryCosts symmetry_costs{};  ///< see SymmetricHypotheses
  /// Contradicts the hypothesis in force and has to prove itself before it is published.
  bool challenger = false;
};

/// Squared distance of a camera from the rest, in its own covariance (the share of the innovation
/// that is charged to the camera), and its expectation if the covariances are right.
struct Agreement {
  double squared = 0;
  double expected = 0;
};

/// A camera's innovation in information form: how far its own pose lies from the prediction, in
/// world axes about the object's origin, as information times offset, and the information.
struct InformationInnovation {
  Eigen::Matrix<float, 6, 1> vector = Eigen::Matrix<float, 6, 1>::Zero();
  Eigen::Matrix<float, 6, 6> information = Eigen::Matrix<float, 6, 6>::Zero();
};

/// A fading mean; see picture_record.hpp.
struct FadingShare {
  float mean = 0;
  int count = 0;
  Time newest{};
};

/// What is remembered of one camera.
struct CameraRecord {
  Time last_observation{};
  Duration period{0};       ///< of its frames, smoothed; 0: unknown
  double scale = 1.0;       ///< smoothed chi-square per residual of its measurements
  double systematic = 1.0;  ///< learned: see CameraMeasurement::systematic
  double unproven = 1.0;    ///< share of the largest systematic variance that it may still have
  InformationInnovation mean_innovation;  ///< fading mean, see innovation_bias.hpp
  double innovation_power = 0;            ///< fading mean of their squares [the camera's sigmas]
  double innovations = 0;                 ///< frames in both, up to their memory
  FadingShare picture;  ///< share of the silhouette that is not explained, or missing
  FadingShare absence;  ///< of the looks that do not see the object where it has to be seen
  bool known = false;
  bool seen = false;     ///< accepted in its last frame
  bool refused = false;  ///< gated in its last frame
};

/// Where a camera's entries are in arrays of 64.
constexpr size_t camera_slot(CameraId camera) { return camera.index() & 63u; }

/// Everything the estimator knows after a set. A value: late sets restore an older one.
struct BankState {
  static constexpr size_t kMaxHypotheses = 4;
  std::array<Hypothesis, kMaxHypotheses> hypotheses;  ///< the one in force first
  int count = 0;
  std::array<CameraRecord, 64> cameras;
  CameraSet known = 0;
  PoseEstimate published;
  /// Bias between the cameras' innovations, as a share of the largest systematic variance.
  double bias_share = 0;
  bool unexplained = false, absent = false;  ///< see picture_record.hpp
  bool flat_print = false;                   ///< print was seen as a picture would show it
  bool solid = false;                        ///< as none would, or two cameras have tracked it
  bool found_before = false;                 ///< published.last_measured means something
  Time judged{};              ///< of the newest state: see settled() in track_state.cpp
  Duration undoubted{0};      ///< how long nothing has spoken against `tracking`, less what has
  bool outline_only = false;  ///< the newest measurements are of outline and edges alone
  bool detected = false;      ///< they are what a search has found

  // Of the last set alone.
  CameraSet gated = 0;
  int iterations = 0;
  double residual = 0;
  bool started = false;
  bool reset = false;
};

}  // namespace sightline::fuse
