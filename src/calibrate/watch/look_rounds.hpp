// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline::calibrate {

/// One camera's measurement of an object, linearized next to the camera's own minimum.
struct Look {
  bool usable = false;
  Time time{};
  Rigid3 reference;  ///< world_from_object at which the two below hold
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
};

/// The first look of each camera at one object after each tick of a grid in time. Cameras that
/// expose together are compared in the same frame, free-running ones within a frame period.
struct LookRound {
  int64_t tick = -1;        ///< -1: empty
  std::vector<Look> looks;  ///< by CameraId
};

/// The rounds of one object that may still grow: two, since cameras differ in how late they are.
class LookRounds {
 public:
  LookRounds(size_t cameras, Duration round, const ShapeSymmetry& shape_symmetry);

  /// Files a look; at a pose that is not known well nothing. Returns the round that thereby became
  /// complete, or null; valid until the next call.
  const LookRound* add(const Observation& observation, const PoseTrack& track);
  void clear();

 private:
  Duration round_;
  std::optional<ShapeSymmetry::Axis> unobservable_axis_;
  std::array<LookRound, 3> rounds_;  // by tick modulo three
  int64_t newest_ = -1;
};

/// What a round says of one camera's place: calibrated_from_now = exp(c), c of N(information^-1
/// vector, information^-1).
struct Correction {
  Matrix6 information = Matrix6::Zero();
  Vector6 vector = Vector6::Zero();
};

/// All looks of a round carried to one time by the track's motion.
class RoundComparison {
 public:
  /// False if fewer than two looks are of any use, or the track knows no pose there.
  bool load(const LookRound& round, const PoseTrack& track);
  bool has(size_t camera) const { return looks_[camera].usable; }
  const Rigid3& world_from_object() const { return world_from_object_; }
  /// Of `camera`, against those of `voters` (by CameraId) beside it; false: there are none.
  bool compare(size_t camera, const Rigid3& world_from_camera, const std::vector<char>& voters,
               Correction& out) const;

 private:
  Rigid3 world_from_object_;
  std::vector<Look> looks_;  // by CameraId; reference: the pose above
};

}  // namespace sightline::calibrate
