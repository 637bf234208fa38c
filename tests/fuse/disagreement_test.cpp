// SPDX-License-Identifier: Apache-2.0
// Cameras that contradict one another or the estimate: outliers, jumps, systematic errors, flips,
// skew.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>

#include "fuse/rig_run.hpp"
#include "support/random.hpp"

namespace sightline {
namespace {

using namespace fuse_test;
using std::chrono::milliseconds;
using test::MotionKind;

TEST(Gate, ACameraThatIsWrongIsRefused) {
  for (const bool synchronous : {false, true}) {
    RigOptions options = moving_rig(3);
    if (synchronous) options.phases = {0, 0, 0};
    Vector6 error;
    error << 0.1, 0.4, 0.0, 0.06, 0.03, 0.0;
    options.wrong_poses = {{1, milliseconds(500), milliseconds(1500), Rigid3::exp(error)}};
    auto estimator = make();
    const auto rows = run(SyntheticRig(options), estimator);
    EXPECT_EQ(wrong_claims(rows), 0);
    EXPECT_EQ(estimator.counters().resets, 0u);
    EXPECT_GE(estimator.counters().gated, 28u);
    EXPECT_LT(rms_translation(rows, 6), 0.004);
    EXPECT_GT(share_tracking(rows), 0.9);
  }
}

TEST(Gate, OneOfTwoThatIsWrongDoesNotMoveTheEstimate) {
  RigOptions options = moving_rig(2);
  Vector6 error;
  error << 0.3, 0.6, 0.0, 0.08, 0.05, 0.0;
  options.wrong_poses = {{1, milliseconds(700), milliseconds(1300), Rigid3::exp(error)}};
  auto estimator = make();
  const auto rows = run(SyntheticRig(options), estimator);
  EXPECT_EQ(wrong_claims(rows), 0);
  EXPECT_EQ(estimator.counters().resets, 0u);
  EXPECT_LT(rms_translation(rows, 6), 0.004);
}

TEST(Reset, AKidnappedObjectIsFollowedWithoutAWrongClaim) {
  for (const int cameras : {1, 2, 4}) {
    for (const bool synchronous : {false, true}) {
      RigOptions options = moving_rig(cameras);
      if (synchronous) options.phases.assign(static_cast<size_t>(cameras), 0.0);
      options.motion.jump_at = time_from_ns(1'000'000'000);
      Vector6 jump;
      jump << 0, 0, 1.6, 0.16, -0.06, 0.02;
      options.motion.jump = Rigid3::exp(jump);
      auto estimator = make();
      const auto rows = run(SyntheticRig(options), estimator);
      EXPECT_EQ(wrong_claims(rows), 0) << cameras << synchronous;
      EXPECT_EQ(estimator.counters().resets, 1u) << cameras << synchronous;
      for (const Row& row : rows) {
        if (to_ns(row.estimate.time) < 1'170'000'000) continue;
        EXPECT_LT(row.translation_error, 0.01);
        EXPECT_TRUE(row.is(TrackState::kTracking) || cameras == 1);
      }
    }
  }
}

// Farther than it was ever seen to move between two frames, but no farther than a motion that turns
// back at once may get.
Vector6 maneuver() {
  Vector6 maneuver;
  maneuver << 0.1, 0.25, 0, 0.05, -0.03, 0.02;
  return maneuver;
}

TEST(Maneuver, WhereAllThatSeeItAgreeItIsFollowedAtOnce) {
  for (const int cameras : {1, 2, 3}) {
    RigOptions options = moving_rig(cameras);
    options.phases.assign(static_cast<size_t>(cameras), 0);
    options.motion.jump_at = time_from_ns(1'000'000'000);
    options.motion.jump = Rigid3::exp(maneuver());
    auto estimator = make();
    const auto rows = run(SyntheticRig(options), estimator);
    EXPECT_EQ(wrong_claims(rows), 0) << cameras;
    EXPECT_EQ(estimator.counters().resets, 0u) << cameras;
    const auto first = std::find_if(rows.begin(), rows.end(), [&](const Row& row) {
      return row.estimate.time >= options.motion.jump_at;
    });
    ASSERT_NE(first, rows.end());
    if (cameras == 1) {
      EXPECT_TRUE(first->is(TrackState::kDegraded)) << "one frame of one camera";
      EXPECT_EQ(first->estimate.degraded_reasons & kUnconfirmed, kUnconfirmed);
    }
    // 62 mm in 1/30 s are no velocity: it goes on as it did.
    const EstimatorOptions defaults;
    EXPECT_LE(first->estimate.twist.tail<3>().norm(), 1.001 * defaults.start_sigma_linear);
    EXPECT_LE(first->estimate.twist.head<3>().norm(), 1.001 * defaults.start_sigma_angular);
    for (auto row = first; row != rows.end(); ++row) {
      EXPECT_LT(row->translation_error, 0.01) << cameras << " after " << row - first;
      EXPECT_LT(row->rotation_error, 0.1) << cameras << " after " << row - first;
    }
  }
}

TEST(Maneuver, OneCameraOfSeveralIsNotFollowed) {
  for (const int cameras : {2, 3}) {
    RigOptions options = moving_rig(cameras);  // free-running: it is alone in its sets
    options.wrong_poses = {{1, milliseconds(700), milliseconds(1300), Rigid3::exp(maneuver())}};
    auto estimator = make();
    const auto rows = run(SyntheticRig(options), estimator);
    EXPECT_EQ(wrong_claims(rows), 0) << cameras;
    EXPECT_GT(estimator.counters().gated, 12u) << cameras;
    EXPECT_LT(rms_translation(rows, 6), 0.004) << cameras;
  }
}

// 0.13 s without a frame do not let one camera take the object half a meter away at once.
TEST(Maneuver, AGapDoesNotLeadAnywhere) {
  RigOptions options = moving_rig(1);
  options.occlusions = {{-1, milliseconds(870), milliseconds(1000)}};
  options.motion.jump_at = time_from_ns(1'000'000'000);
  options.motion.jump = Rigid3(Eigen::Quaterniond::Identity(), {0, 0.25, 0});
  auto estimator = make();
  const auto rows = run(SyntheticRig(options), estimator);
  EXPECT_EQ(wrong_claims(rows), 0);
  const auto first = std::find_if(rows.begin(), rows.end(), [&](const Row& row) {
    return row.estimate.time >= options.motion.jump_at;
  });
  ASSERT_NE(first, rows.end());
  EXPECT_TRUE(first->is(TrackState::kCoasting)) << first->translation_error;
  EXPECT_LT(rows.back().translation_error, 0.01) << "found there by its third frame";
}

struct Health {
  double tracking = 0;     ///< share
  double worst_speed = 0;  ///< [m/s] 95th percentile of the velocity's error
  double normalized = 0;   ///< mean of e^T P^-1 e / 6 of the pose
  double error = 0;        ///< [m] rms
  int wrong = 0;
  uint64_t resets = 0, gated = 0, accepted = 0;
};

Health health(const RigOptions& base, int seeds) {
  Health sum;
  std::vector<double> speeds;
  int n = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    RigOptions options = base;
    options.seed = static_cast<uint64_t>(seed);
    const SyntheticRig rig(options);
    auto estimator = make();
    const auto rows = run(rig, estimator);
    sum.wrong += wrong_claims(rows);
    for (const Row& row : rows) {
      // Half a second to learn what the cameras are like.
      if (!has_pose(row.estimate.state) || to_ns(row.estimate.time) < 500'000'000) continue;
      const Vector6 e = difference(row.estimate.world_from_object, rig.truth(row.estimate.time));
      sum.normalized += e.dot(row.estimate.pose_covariance().inverse() * e) / 6;
      sum.tracking += row.is(TrackState::kTracking) ? 1 : 0;
      sum.error += row.translation_error * row.translation_error;
      speeds.push_back((rig.truth_twist(row.estimate.time) - row.estimate.twist).tail<3>().norm());
      ++n;
    }
    sum.resets += estimator.counters().resets;
    sum.gated += estimator.counters().gated;
    sum.accepted += estimator.counters().accepted;
  }
  sum.normalized /= n;
  sum.tracking /= n;
  sum.error = std::sqrt(sum.error / n);
  std::sort(speeds.begin(), speeds.end());
  sum.worst_speed = speeds[speeds.size() * 95 / 100];
  return sum;
}

void print(const char* what, const Health& h) {
  std::printf("%-26s tracking %.3f wrong %d rms %.2f mm speed95 %.3f m/s NEES/6 %.2f gated %d/%d\n",
              what, h.tracking, h.wrong, 1e3 * h.error, h.worst_speed, h.normalized,
              static_cast<int>(h.gated), static_cast<int>(h.gated + h.accepted));
}

RigOptions badly_placed(int cameras, double rate_hz, double place, double direction_deg) {
  RigOptions options = moving_rig(cameras);
  options.rate_hz = rate_hz;
  options.duration = milliseconds(4000);
  options.place_error = place;
  options.direction_error = direction_deg / 57.3;
  options.motion.linear_amplitude = 0.05;
  options.motion.angular_amplitude = 0.3;
  options.motion.frequency_hz = 0.4;
  return options;
}

// Calibrations off by far more than the noise: the cameras contradict one another in every frame,
// free-running ones as if the object jumped to and fro. Half a second after the start nobody is
// refused for it, no velocity comes of it, and no claim is wrong.
TEST(Systematic, BadlyPlacedCamerasAreNotRefusedAndMakeNoSpeed) {
  struct Case {
    double place, direction_deg, rms, speed;
  };
  for (const Case& c : {Case{0.003, 0.15, 0.004, 0.12}, Case{0.005, 0.25, 0.0065, 0.15},
                        Case{0.010, 0.50, 0.0125, 0.28}}) {
    for (const int cameras : {2, 4}) {
      for (const double rate_hz : {6.0, 30.0}) {
        const Health h = health(badly_placed(cameras, rate_hz, c.place, c.direction_deg), 20);
        char name[64];
        std::snprintf(name, sizeof name, "%d at %2.0f Hz, %2.0f mm", cameras, rate_hz,
                      1e3 * c.place);
        print(name, h);
        EXPECT_GT(h.tracking, 0.97) << name;
        EXPECT_LT(h.error, c.rms) << name;
        EXPECT_LT(h.worst_speed, c.speed) << name;
        EXPECT_LE(h.gated * 100, h.accepted) << name;
        EXPECT_EQ(h.resets, 0u) << name;
        // The bias of their innovations shows it: 28 to 158 without them at 30 Hz.
        EXPECT_LT(h.normalized, 8) << name;
        // At 10 mm and 0.5 deg, 16 mm in all, nearly every pose is close to a wrong claim.
        EXPECT_LE(h.wrong, c.place < 0.01 ? 0 : 4) << name;
      }
    }
  }
}

// Stamps that are off by more than they say, at up to 0.6 m/s.
TEST(Systematic, StampsThatJitterAreNotRefused) {
  for (const double jitter : {0.003, 0.008}) {
    for (const int cameras : {2, 4}) {
      RigOptions options = moving_rig(cameras);
      options.duration = milliseconds(4000);
      options.stamp_jitter = jitter;
      const Health h = health(options, 20);
      char name[64];
      std::snprintf(name, sizeof name, "%d with %.0f ms jitter", cameras, 1e3 * jitter);
      print(name, h);
      EXPECT_EQ(h.wrong, 0) << name;
      EXPECT_GT(h.tracking, 0.97) << name;
      EXPECT_LE(h.gated * 100, h.accepted) << name;
      EXPECT_LT(h.normalized, 12) << name;
    }
  }
}

TEST(Flip, ALoneTagIsDegradedUntilAnotherCameraDecides) {
  RigOptions options = moving_rig(2);
  options.fiducials = lone_tag();
  options.elevation = 1.2;
  options.distance = 1.2;
  options.pixel_sigma = 0.5;
  options.motion.kind = MotionKind::kStill;
  options.occlusions = {{1, milliseconds(0), milliseconds(500)}};
  int ambiguous_runs = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    options.seed = seed;
    auto estimator = make();
    const auto rows = run(SyntheticRig(options), estimator);
    bool ambiguous = false;
    for (const Row& row : rows) {
      if (row.report.hypotheses > 1) {
        ambiguous = true;
        EXPECT_FALSE(row.is(TrackState::kTracking));
      }
      if (to_ns(row.estimate.time) > 600'000'000) {
        EXPECT_EQ(row.report.hypotheses, 1);
        EXPECT_LT(row.rotation_error, kWrongRotation) << seed;
      }
    }
    EXPECT_EQ(wrong_claims(rows), 0) << seed;
    ambiguous_runs += ambiguous ? 1 : 0;
  }
  EXPECT_GT(ambiguous_runs, 5);
}

TEST(Flip, MotionDecidesForALoneCamera) {
  RigOptions options = moving_rig(1);
  options.fiducials = lone_tag();
  options.elevation = 1.0;
  options.distance = 0.9;
  options.pixel_sigma = 0.3;
  options.duration = milliseconds(3000);
  options.motion.angular_amplitude = 0.6;
  int decided = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    options.seed = seed;
    auto estimator = make();
    const auto rows = run(SyntheticRig(options), estimator);
    EXPECT_EQ(wrong_claims(rows), 0) << seed;
    decided += rows.back().report.hypotheses == 1 && rows.back().rotation_error < 0.1 ? 1 : 0;
  }
  EXPECT_GE(decided, 18);
}

struct SkewError {
  double translation = 0;  ///< [m] root mean square
  double rotation = 0;     ///< [rad]
};

/// Two cameras 60 degrees apart, the second one 8 ms later (or not); errors at its frames, once the
/// filter knows the motion.
SkewError skew_error(const test::MotionOptions& motion, bool later, Duration unknown) {
  double translation = 0, rotation = 0;
  int n = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    RigOptions options = moving_rig(2, seed);
    options.phases = {0.0, later ? 0.008 * options.rate_hz : 0.0};
    options.skews = {Duration(0), unknown};
    options.motion = motion;
    options.duration = milliseconds(3000);
    const SyntheticRig rig(options);
    auto estimator = make();
    for (const auto& set : rig.sets()) {
      const PoseEstimate estimate = estimator.process(set).estimate;
      if (set.back().camera != CameraId(1) || to_ns(estimate.time) < 1'000'000'000) continue;
      const Rigid3 truth = rig.truth(estimate.time - unknown);
      translation += std::pow(translation_distance(estimate.world_from_object, truth), 2);
      rotation += std::pow(rotation_angle(estimate.world_from_object, truth), 2);
      ++n;
    }
  }
  return {std::sqrt(translation / n), std::sqrt(rotation / n)};
}

void print(const char* what, const SkewError& error) {
  std::printf("%-28s %.3f mm %.3f deg\n", what, 1e3 * error.translation, 57.3 * error.rotation);
}

// The object moves 7.8 mm and 3.65 deg per frame.
TEST(Skew, AKnownSkewCostsAtMostATenth) {
  test::MotionOptions steady;
  steady.kind = MotionKind::kConstantTwist;
  steady.initial_twist << 0, 0, 1.91, 0.234, 0, 0;
  const SkewError together = skew_error(steady, false, Duration(0));
  const SkewError skewed = skew_error(steady, true, Duration(0));
  const SkewError ignored = skew_error(steady, true, milliseconds(-8));
  print("synchronous", together);
  print("8 ms skew, known", skewed);
  print("8 ms skew, ignored", ignored);
  EXPECT_LE(skewed.translation, 1.1 * together.translation);
  EXPECT_LE(skewed.rotation, 1.1 * together.rotation);
  EXPECT_GT(ignored.translation, 3 * together.translation);
}

// With accelerations of 0.9 m/s^2 and 6 rad/s^2 (rms) the velocity of the last frames is worth
// less.
TEST(Skew, LivelyMotionCostsALittleMore) {
  test::MotionOptions lively;
  lively.linear_amplitude = 0.095;
  lively.angular_amplitude = 0.9;
  lively.frequency_hz = 0.4;
  const SkewError together = skew_error(lively, false, Duration(0));
  const SkewError skewed = skew_error(lively, true, Duration(0));
  print("lively, synchronous", together);
  print("lively, 8 ms skew, known", skewed);
  EXPECT_LE(skewed.translation, 1.35 * together.translation);
  EXPECT_LE(skewed.rotation, 1.2 * together.rotation);
}

}  // namespace
}  // namespace sightline
