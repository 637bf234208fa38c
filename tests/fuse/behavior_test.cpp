// SPDX-License-Identifier: Apache-2.0
// What the estimator does over time: states, late data, coasting, determinism.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "fuse/rig_run.hpp"
#include "support/random.hpp"

namespace sightline {
namespace {

using namespace fuse_test;
using std::chrono::milliseconds;
using test::MotionKind;

TEST(Options, OutOfRangeIsRefusedByName) {
  EstimatorOptions options;
  options.gate_probability = 1.0;
  auto result = ObjectEstimator::create(options, ObjectId(0));
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(result.error().text.find("gate_probability"), std::string::npos);
  options = {};
  options.max_hypotheses = 5;
  EXPECT_FALSE(ObjectEstimator::create(options, ObjectId(0)).has_value());
  options = {};
  options.noise.linear = -1;
  EXPECT_FALSE(ObjectEstimator::create(options, ObjectId(0)).has_value());
}

TEST(States, NothingSeenIsSearching) {
  auto estimator = make();
  EXPECT_EQ(estimator.state(), TrackState::kSearching);
  ASSERT_NE(estimator.track(), nullptr);
  EXPECT_TRUE(estimator.track()->empty());
  RigOptions options = moving_rig(2);
  options.occlusions = {{-1, milliseconds(0), milliseconds(5000)}};
  for (const Row& row : run(SyntheticRig(options), estimator)) {
    EXPECT_TRUE(row.is(TrackState::kSearching));
  }
  EXPECT_EQ(estimator.track()->at(time_from_ns(500'000'000)).source, PoseSource::kNone);
}

TEST(States, TwoCamerasTrackFromTheSecondFrameOn) {
  for (const int cameras : {2, 4}) {
    const SyntheticRig rig(moving_rig(cameras));
    auto estimator = make();
    const auto rows = run(rig, estimator);
    EXPECT_TRUE(has_pose(rows[0].estimate.state));
    EXPECT_EQ(wrong_claims(rows), 0);
    EXPECT_GT(share_tracking(rows), 0.95);
    EXPECT_LT(rms_translation(rows, 4), 0.002);
    EXPECT_EQ(estimator.counters().starts, 1u);
    EXPECT_EQ(estimator.counters().resets, 0u);
  }
}

TEST(States, AgreeingCamerasOfOneSetTrackAtOnce) {
  RigOptions options = moving_rig(2);
  options.phases = {0, 0};
  auto estimator = make();
  const auto rows = run(SyntheticRig(options), estimator);
  EXPECT_TRUE(rows[0].is(TrackState::kTracking));
  EXPECT_EQ(rows[0].estimate.cameras, camera_bit(CameraId(0)) | camera_bit(CameraId(1)));
}

TEST(States, OneCameraIsJudgedByItsCovarianceOrByTheOption) {
  const SyntheticRig rig(moving_rig(1));
  auto estimator = make();
  EXPECT_GT(share_tracking(run(rig, estimator)), 0.8);
  EstimatorOptions strict;
  strict.one_camera_is_degraded = true;
  auto careful = make(strict);
  for (const Row& row : run(rig, careful)) EXPECT_TRUE(row.is(TrackState::kDegraded));
}

TEST(States, HiddenEverywhereCoastsWithinAFrameAndComesBack) {
  for (const int cameras : {1, 2, 4}) {
    RigOptions options = moving_rig(cameras);
    options.duration = milliseconds(2500);
    options.occlusions = {{-1, milliseconds(800), milliseconds(1100)},
                          {-1, milliseconds(1500), milliseconds(2300)}};
    const SyntheticRig rig(options);
    auto estimator = make();
    const auto rows = run(rig, estimator);
    EXPECT_EQ(wrong_claims(rows), 0);
    for (const Row& row : rows) {
      const int64_t t = to_ns(row.estimate.time) / 1'000'000;
      if ((t > 834 && t < 1100) || (t > 1534 && t < 2200)) {
        EXPECT_TRUE(row.is(TrackState::kCoasting)) << cameras << " cameras, " << t << " ms";
      }
      if (t > 2205 && t < 2300) {
        EXPECT_TRUE(row.is(TrackState::kLost)) << t;
      }
      // Two frames of one camera, or one of each of two.
      if ((t > 1169 && t < 1500) || t > 2369) {
        EXPECT_TRUE(row.is(TrackState::kTracking) || cameras == 1) << cameras << ", " << t;
        EXPECT_TRUE(has_pose(row.estimate.state));
      }
      if (t > 1134 && t < 1500) {
        EXPECT_TRUE(has_pose(row.estimate.state));
      }
    }
  }
}

TEST(States, OneHiddenCameraOfTwoIsNoReasonToCoast) {
  RigOptions options = moving_rig(2);
  options.occlusions = {{1, milliseconds(500), milliseconds(1500)}};
  auto estimator = make();
  const auto rows = run(SyntheticRig(options), estimator);
  for (const Row& row : rows) EXPECT_FALSE(row.is(TrackState::kCoasting));
  EXPECT_EQ(wrong_claims(rows), 0);
}

TEST(States, SilenceBecomesCoastingLostAndSearching) {
  const SyntheticRig rig(moving_rig(2));
  auto estimator = make();
  const auto rows = run(rig, estimator);
  const Time end = rows.back().estimate.time;
  ASSERT_TRUE(rows.back().is(TrackState::kTracking));
  estimator.advance(end + milliseconds(60));
  EXPECT_EQ(estimator.state(), TrackState::kTracking);
  estimator.advance(end + milliseconds(260));
  EXPECT_EQ(estimator.state(), TrackState::kCoasting);
  EXPECT_EQ(estimator.track()->newest().state, TrackState::kCoasting);
  EXPECT_EQ(estimator.track()->at(end + milliseconds(300)).source, PoseSource::kPredicted);
  estimator.advance(end + milliseconds(800));
  EXPECT_EQ(estimator.state(), TrackState::kLost);
  EXPECT_EQ(estimator.track()->newest().state, TrackState::kLost);
  EXPECT_EQ(estimator.track()->at(end + milliseconds(800)).source, PoseSource::kNone);
  estimator.advance(end + std::chrono::seconds(20));
  EXPECT_EQ(estimator.state(), TrackState::kSearching);
}

TEST(Track, IsOrderedBoundedAndAnImmutableSnapshot) {
  RigOptions options = moving_rig(4);
  options.rate_hz = 60;
  options.duration = milliseconds(3000);
  const SyntheticRig rig(options);
  auto estimator = make();
  PoseTrackPtr early;
  for (const auto& set : rig.sets()) {
    estimator.process(set);
    if (!early) early = estimator.track();
  }
  EXPECT_EQ(early->history().size(), 1u);
  const PoseTrackPtr track = estimator.track();
  EXPECT_EQ(track, estimator.track());
  const auto& history = track->history();
  EXPECT_LT(history.size(), 160u);
  EXPECT_GT(to_seconds(history.back().time - history.front().time), 0.9);
  EXPECT_LT(to_seconds(history.back().time - history.front().time), 1.05);
  for (size_t i = 1; i < history.size(); ++i) EXPECT_LT(history[i - 1].time, history[i].time);
  // Anywhere inside, the interpolated pose is right.
  for (int i = 1; i < 95; ++i) {
    const Time time = history.front().time + milliseconds(10 * i);
    const PoseAt at = track->at(time);
    ASSERT_NE(at.source, PoseSource::kNone);
    EXPECT_LT(translation_distance(at.estimate.world_from_object, rig.truth(time)), 0.004);
  }
}

bool same_bytes(const PoseEstimate& a, const PoseEstimate& b) {
  return a.time == b.time && a.state == b.state && a.cameras == b.cameras &&
         a.last_measured == b.last_measured &&
         std::memcmp(a.covariance.data(), b.covariance.data(), sizeof(double) * 144) == 0 &&
         std::memcmp(a.twist.data(), b.twist.data(), sizeof(double) * 6) == 0 &&
         a.world_from_object.rotation.coeffs() == b.world_from_object.rotation.coeffs() &&
         a.world_from_object.translation == b.world_from_object.translation;
}

TEST(LateData, GivesTheResultOfInOrderDelivery) {
  RigOptions options = moving_rig(3);
  options.dropout = 0.1;
  const SyntheticRig ordered(options);
  options.late_share = 0.4;
  options.late_by = milliseconds(180);
  const SyntheticRig shuffled(options);
  auto a = make();
  auto b = make();
  run(ordered, a);
  run(shuffled, b);
  EXPECT_GT(b.counters().late_inserted, 50u);
  EXPECT_EQ(b.counters().late_dropped, 0u);
  const auto& x = a.track()->history();
  const auto& y = b.track()->history();
  ASSERT_FALSE(x.empty());
  // The newest 300 ms are the same to the last bit; older ones were frozen alike as well.
  for (size_t back = 1; back <= 25; ++back) {
    EXPECT_TRUE(same_bytes(x[x.size() - back], y[y.size() - back])) << back;
  }
}

TEST(LateData, CamerasOfOneTimeInAnyOrderAreOneSet) {
  RigOptions options = moving_rig(3);
  options.phases = {0, 0, 0};
  const SyntheticRig rig(options);
  auto joint = make();
  auto single = make();
  for (const auto& set : rig.sets()) {
    joint.process(set);
    for (size_t i = set.size(); i-- > 0;) single.process(std::span(&set[i], 1));
  }
  EXPECT_EQ(single.counters().late_inserted, 0u);
  const auto& x = joint.track()->newest();
  EXPECT_TRUE(same_bytes(x, single.track()->newest()));
  EXPECT_EQ(std::popcount(x.cameras), 3);
}

TEST(LateData, TooLateAndTwiceIsDroppedAndCounted) {
  const SyntheticRig rig(moving_rig(2));
  const auto sets = rig.sets();
  auto estimator = make();
  for (const auto& set : sets) estimator.process(set);
  const PoseEstimate before = estimator.track()->newest();
  UpdateReport report = estimator.process(sets[3]);
  EXPECT_TRUE(report.dropped);
  EXPECT_EQ(estimator.counters().late_dropped, 1u);
  report = estimator.process(sets[sets.size() - 3]);
  EXPECT_TRUE(report.dropped);
  EXPECT_EQ(estimator.counters().duplicates, 1u);
  EXPECT_TRUE(same_bytes(before, estimator.track()->newest()));
}

TEST(LateData, LateMeasurementsOfASlowCameraImproveTheEstimate) {
  RigOptions options = moving_rig(2);
  options.pixel_sigma = 0.6;
  options.motion.linear_amplitude = 0.03;  // slow enough that 80 ms are not yet history
  options.motion.angular_amplitude = 0.2;
  options.motion.frequency_hz = 0.2;
  const SyntheticRig rig(options);
  auto one = make();
  auto both = make();
  double alone = 0, together = 0;
  int n = 0;
  std::vector<std::vector<Observation>> slow;
  for (const auto& set : rig.sets()) {
    if (set[0].camera == CameraId(1)) {
      slow.push_back(set);
      continue;
    }
    one.process(set);
    both.process(set);
    if (slow.size() > 3) both.process(slow[slow.size() - 3]);  // about 80 ms late
    if (++n < 10) continue;
    const Rigid3 truth = rig.truth(set[0].capture);
    alone += translation_distance(one.track()->newest().world_from_object, truth);
    together += translation_distance(both.track()->newest().world_from_object, truth);
  }
  std::printf("one camera %.3f mm, with late second %.3f mm\n", 1e3 * alone / n,
              1e3 * together / n);
  EXPECT_GT(both.counters().late_inserted, 40u);
  EXPECT_LT(together, alone);
}

// Observations of the rig as if the object were turned by a quarter: what follows the wrong
// orientation measures, and a check refutes.
std::vector<Observation> seen_turned(const SyntheticRig& rig, size_t set, const Rigid3& turn) {
  std::vector<Observation> out;
  const auto sets = rig.sets();
  for (const Observation& observation : sets[set]) {
    Observation turned = observation;
    const Rigid3 pose = rig.truth(observation.capture) * turn;
    LinearizedTerm term;
    term.information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;
    term.residuals = 12;
    term.cost = 6;
    term.quality = 0.8;
    turned.terms = {std::make_shared<const FrozenTerm>(pose, term)};
    turned.hypotheses = {{pose, 6}};
    out.push_back(turned);
  }
  return out;
}

TEST(Refuted, AnotherPoseTakesOverAlsoLateAndInFramesThatWereMeasured) {
  RigOptions options = moving_rig(2);
  options.phases = {0, 0};
  const SyntheticRig rig(options);
  const Rigid3 turn(Eigen::Quaterniond(Eigen::AngleAxisd(1.57, Eigen::Vector3d::UnitY())),
                    Eigen::Vector3d::Zero());
  auto estimator = make();
  for (size_t i = 0; i < 12; ++i) {
    std::vector<Observation> set = seen_turned(rig, i, turn);
    for (Observation& observation : set) {
      if (i > 0) observation.hypotheses.clear();  // measured about the pose that was found
    }
    estimator.process(set);
  }
  const auto error = [&] {
    const PoseEstimate& newest = estimator.track()->newest();
    return rotation_angle(newest.world_from_object, rig.truth(newest.time));
  };
  ASSERT_GT(error(), 1.5);
  // The same frames once more, and what a search finds in them: neither is news.
  EXPECT_TRUE(estimator.process(rig.sets()[8]).dropped);
  ASSERT_GT(error(), 1.5);
  std::vector<Observation> refuting = seen_turned(rig, 8, Rigid3());
  for (Observation& observation : refuting) {
    observation.refutes = true;
    EXPECT_FALSE(estimator.process({&observation, 1}).dropped);
  }
  EXPECT_LT(error(), 0.25) << "what was measured about the old pose since does not bring it back";
  EXPECT_EQ(estimator.counters().starts, 1u) << "it was known all the time";
  for (size_t i = 12; i < 20; ++i) estimator.process(rig.sets()[i]);
  EXPECT_LT(error(), 0.02);
  EXPECT_EQ(estimator.state(), TrackState::kTracking);
}

TEST(Claims, OfTwoCamerasThatDisagreeNoneIsBelieved) {
  for (const int cameras : {2, 3}) {
    RigOptions options = moving_rig(cameras);
    options.phases.assign(static_cast<size_t>(cameras), 0);
    const SyntheticRig rig(options);
    const Rigid3 shift(Eigen::Quaterniond::Identity(), {0.1, 0, 0});
    auto estimator = make();
    int tracking = 0;
    const auto sets = rig.sets();
    for (size_t i = 0; i < sets.size(); ++i) {
      std::vector<Observation> set = sets[i];
      // From the tenth set on the last camera sees it 10 cm away.
      if (i >= 10) set.back() = seen_turned(rig, i, shift).back();
      const UpdateReport report = estimator.process(set);
      if (i >= 12) tracking += report.estimate.state == TrackState::kTracking;
    }
    if (cameras == 2) {
      EXPECT_EQ(tracking, 0);
    } else {
      EXPECT_GT(tracking, static_cast<int>(sets.size()) / 2) << "two against one";
    }
  }
}

TEST(Claims, WhatIsDoubtedIsHeldAndNotBelieved) {
  const SyntheticRig rig(moving_rig(2));
  auto estimator = make();
  int n = 0;
  for (const auto& set : rig.sets()) {
    const bool doubted = n >= 10 && n < 20;
    estimator.set_doubted(doubted);
    const PoseEstimate estimate = estimator.process(set).estimate;
    if (n++ < 4) continue;
    EXPECT_EQ(estimate.state, doubted ? TrackState::kDegraded : TrackState::kTracking) << n;
    EXPECT_EQ(estimate.degraded_reasons, doubted ? kContradicted : 0) << n;
  }
  EXPECT_GT(n, 24);
}

TEST(Refuted, TheSamePoseGoesOn) {
  const SyntheticRig rig(moving_rig(2));
  auto estimator = make(), other = make();
  run(rig, estimator);
  for (const auto& set : rig.sets()) {
    std::vector<Observation> refuting(set.begin(), set.end());
    for (Observation& observation : refuting) observation.refutes = true;
    other.process(refuting);
  }
  EXPECT_EQ(other.counters().resets, 0u);
  EXPECT_EQ(translation_distance(other.track()->newest().world_from_object,
                                 estimator.track()->newest().world_from_object),
            0);
}

TEST(Coasting, PredictedErrorsAreNotUnderstated) {
  const std::array<int, 4> ahead_ms = {50, 100, 200, 300};
  std::array<double, 4> mean{};
  constexpr int kSeeds = 30;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SyntheticRig rig(moving_rig(2, seed));
    auto estimator = make();
    for (const auto& set : rig.sets()) estimator.process(set);
    for (size_t i = 0; i < ahead_ms.size(); ++i) {
      const Time time = estimator.track()->newest().time + milliseconds(ahead_ms[i]);
      const PoseAt at = estimator.track()->at(time);
      ASSERT_EQ(at.source, PoseSource::kPredicted);
      const Vector6 e = difference(at.estimate.world_from_object, rig.truth(time));
      mean[i] += e.dot(at.estimate.pose_covariance().inverse() * e) / kSeeds;
    }
  }
  for (const double average : mean) EXPECT_LT(average, 6.0 * 1.2);
}

// Two to four cameras, fast or slow, together or not; lively motion, dropouts, hidden cameras,
// lone tags, wrong ideas of the pixel noise: tracking is said often, and never wrongly.
TEST(Claims, NoneIsWrongInFortyRigs) {
  size_t measured = 0, tracking = 0;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    test::Random random(seed);
    RigOptions options = moving_rig(2 + static_cast<int>(3 * random.uniform()), seed);
    options.rate_hz = random.uniform() < 0.3 ? 6 : 30;
    options.distance = random.uniform(0.6, 1.3);
    options.duration = milliseconds(3000);
    options.motion.linear_amplitude = random.uniform(0, 0.25);
    options.motion.angular_amplitude = random.uniform(0, 1.2);
    options.motion.frequency_hz = random.uniform(0.3, 1.0);
    options.dropout = random.uniform(0, 0.4);
    options.pixel_sigma = random.uniform(0.2, 0.6);
    options.claimed_pixel_sigma = 0.4;
    if (random.uniform() < 0.5) options.phases.assign(static_cast<size_t>(options.cameras), 0.0);
    if (random.uniform() < 0.4) options.fiducials = lone_tag();
    const auto from = milliseconds(static_cast<int>(random.uniform(300, 2000)));
    options.occlusions = {{-1, from, from + milliseconds(400)},
                          {0, milliseconds(500), milliseconds(1500)}};
    auto estimator = make();
    const auto rows = run(SyntheticRig(options), estimator);
    EXPECT_EQ(wrong_claims(rows), 0) << seed;
    for (const Row& row : rows) {
      if (row.report.accepted == 0) continue;
      ++measured;
      tracking += row.is(TrackState::kTracking) ? 1 : 0;
    }
  }
  std::printf("tracking in %.1f %% of %zu measured sets\n",
              100.0 * static_cast<double>(tracking) / static_cast<double>(measured), measured);
  EXPECT_GT(tracking * 10, measured * 7);
}

TEST(Determinism, TwoRunsGiveTheSameBytes) {
  RigOptions options = moving_rig(4);
  options.dropout = 0.2;
  options.late_share = 0.3;
  options.late_by = milliseconds(90);
  options.wrong_poses = {{2, milliseconds(300), milliseconds(900), Rigid3::exp(Vector6::Ones())}};
  const SyntheticRig rig(options);
  auto a = make();
  auto b = make();
  const auto x = run(rig, a);
  const auto y = run(rig, b);
  ASSERT_EQ(x.size(), y.size());
  for (size_t i = 0; i < x.size(); ++i) EXPECT_TRUE(same_bytes(x[i].estimate, y[i].estimate)) << i;
}

TEST(Determinism, AskingForTheTimeChangesNothing) {
  const SyntheticRig rig(moving_rig(2));
  auto a = make();
  auto b = make();
  for (const auto& set : rig.sets()) {
    a.process(set);
    b.process(set);
    b.advance(set[0].capture + milliseconds(2000));
    (void)b.track();
  }
  EXPECT_TRUE(same_bytes(a.track()->newest(), a.track()->newest()));
  const Time newest = a.track()->newest().time;
  EXPECT_EQ(a.track()->at(newest).source, PoseSource::kEstimated);
  EXPECT_TRUE(same_bytes(a.track()->at(newest).estimate, b.track()->at(newest).estimate));
}

}  // namespace
}  // namespace sightline
