// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/calibration_watch.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <optional>

#include "sightline/fuse/estimator.hpp"
#include "support/synthetic_rig.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::RigOptions;
using test::SyntheticRig;

constexpr double kDegree = std::numbers::pi / 180;

Vector6 turned(double deg) {
  Vector6 v = Vector6::Zero();
  v[1] = deg * kDegree;  // about its vertical axis
  return v;
}
Vector6 shifted(double mm) {
  Vector6 v = Vector6::Zero();
  v[3] = mm * 1e-3;  // to its side
  return v;
}

/// A rig that runs for as long as is asked, in chunks: estimator and watch together, as in the
/// daemon. The object's path is another one in each chunk.
class RunningRig {
 public:
  explicit RunningRig(int cameras, uint64_t seed = 1, double distance = 1.0) : seed_(seed) {
    options_.cameras = cameras;
    options_.arc = cameras > 2 ? 4.71238898 * (cameras - 1) / cameras : 1.05;
    options_.distance = distance;
    options_.rate_hz = 30;
    options_.duration = 10s;
    const SyntheticRig rig(short_options());
    std::vector<std::optional<Rigid3>> poses;
    for (const CalibratedCamera& camera : rig.cameras()) poses.push_back(camera.world_from_camera);
    watch_.emplace(poses, std::vector<ShapeSymmetry>(1));
  }

  RigOptions& options() { return options_; }
  CalibrationWatch& watch() { return *watch_; }
  Time now() const { return Time(offset_); }
  const CameraWatch& camera(size_t i) const { return watch_->cameras()[i]; }

  /// Runs on; stops early once `until` is true after a verdict.
  void run(Duration length, const std::function<bool()>& until = {}) {
    const Time end = now() + length;
    while (now() < end) {
      if (chunk(until)) return;
    }
  }

  /// Takes over what is proposed for a camera.
  void accept(size_t i) {
    const SyntheticRig rig(short_options());
    std::vector<std::optional<Rigid3>> poses;
    for (const CalibratedCamera& calibrated : rig.cameras()) {
      poses.push_back(calibrated.world_from_camera);
    }
    *poses[i] = *poses[i] * Rigid3::exp(camera(i).correction);
    watch_->set_cameras(poses);
  }

  double mean_error_mm() const { return error_sum_ / std::max(1, errors_) * 1e3; }
  void reset_error() { error_sum_ = errors_ = 0; }
  int wrong_states = 0;
  Time verdict_at{};

 private:
  RigOptions short_options() const {
    RigOptions options = options_;
    options.duration = 100ms;
    return options;
  }

  bool chunk(const std::function<bool()>& until) {
    options_.seed = seed_++;
    const SyntheticRig rig(options_);
    auto estimator = ObjectEstimator::create({}, ObjectId(0)).value();
    bool stop = false;
    for (auto set : rig.sets()) {
      for (Observation& observation : set) {
        observation.capture += offset_;
        observation.calibration_covariance = watch_->extra_covariance(observation.camera);
      }
      const UpdateReport report = estimator.process(set);
      if (has_pose(report.estimate.state)) {
        error_sum_ += translation_distance(report.estimate.world_from_object,
                                           rig.truth(report.estimate.time - offset_));
        ++errors_;
      }
      for (const Observation& observation : set) {
        if (!watch_->add(observation, *estimator.track())) continue;
        for (const CameraWatch& c : watch_->cameras()) {
          wrong_states += is_wrong(c.state) || c.state == CalibrationState::kDisputed ? 1 : 0;
        }
        verdict_at = observation.capture;
        if (until && until()) stop = true;
      }
      if (stop) break;
    }
    offset_ += options_.duration + 200ms;
    return stop;
  }

  RigOptions options_;
  uint64_t seed_;
  Duration offset_ = 1s;
  std::optional<CalibrationWatch> watch_;
  double error_sum_ = 0;
  int errors_ = 0;
};

struct Knock {
  const char* name;
  Vector6 by;
};

class CalibrationWatchKnock : public testing::TestWithParam<std::tuple<int, int>> {};

const Knock kKnocks[] = {{"0.1 deg", turned(0.1)},
                         {"0.3 deg", turned(0.3)},
                         {"1 deg", turned(1)},
                         {"2 mm", shifted(2)},
                         {"10 mm", shifted(10)}};

TEST_P(CalibrationWatchKnock, IsFlaggedWithinAMinuteAndRecovered) {
  const auto [cameras, which] = GetParam();
  const Knock& knock = kKnocks[which];
  RunningRig rig(cameras, 100);
  rig.run(60s);
  const double before = rig.mean_error_mm();
  for (int i = 0; i < cameras; ++i) {
    EXPECT_EQ(rig.camera(static_cast<size_t>(i)).state, CalibrationState::kInOrder) << i;
  }
  const Time at = rig.now();
  rig.options().moved = {Vector6::Zero(), knock.by};
  rig.reset_error();
  const auto flagged = [&] { return is_wrong(rig.camera(1).state); };
  rig.run(60s, flagged);
  const double during = rig.mean_error_mm();
  ASSERT_TRUE(flagged()) << knock.name;
  const double delay = to_seconds(rig.verdict_at - at);
  rig.reset_error();
  rig.run(60s);
  const CameraWatch& camera = rig.camera(1);
  EXPECT_EQ(camera.state, CalibrationState::kKnocked);
  EXPECT_FALSE(camera.since_start);
  EXPECT_NEAR(to_seconds(camera.since - at), 0, 6.0);
  const Vector6 off = camera.correction - knock.by;
  const double nees = off.dot(camera.covariance.ldlt().solve(off));
  std::printf(
      "%d cameras, %s: flagged after %.1f s; error of turn %.4f deg, of place %.2f mm, "
      "nees %.1f; tracking %.2f, %.2f, %.2f mm; vote %.3f\n",
      cameras, knock.name, delay, off.head<3>().norm() / kDegree, off.tail<3>().norm() * 1e3, nees,
      before, during, rig.mean_error_mm(), camera.vote);
  EXPECT_LT(nees, 22.5);  // 99.9 %
  EXPECT_LT(off.head<3>().norm(), 0.05 * kDegree);
  EXPECT_LT(off.tail<3>().norm(), 1e-3);
  EXPECT_LT(camera.vote, 1);
  for (int i = 0; i < cameras; ++i) {
    if (i == 1) continue;
    EXPECT_EQ(rig.camera(static_cast<size_t>(i)).state, CalibrationState::kInOrder) << i;
  }
  EXPECT_LT(rig.mean_error_mm(), 1.3 * before + 0.05);
}

INSTANTIATE_TEST_SUITE_P(Rigs, CalibrationWatchKnock,
                         testing::Combine(testing::Values(3, 4), testing::Range(0, 5)));

TEST(CalibrationWatch, SaysNothingForAnHourOfARigInOrder) {
  const char* seed = std::getenv("SIGHTLINE_WATCH_SEED");  // for figures
  RunningRig rig(3, seed != nullptr ? std::strtoull(seed, nullptr, 10) : 5000);
  rig.options().rate_hz = 10;
  rig.run(3600s);
  EXPECT_EQ(rig.wrong_states, 0);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(rig.camera(i).state, CalibrationState::kInOrder);
    EXPECT_GT(rig.camera(i).compared_s, 3000);
    EXPECT_FALSE(rig.watch().extra_covariance(CameraId(static_cast<uint32_t>(i))));
  }
}

TEST(CalibrationWatch, TellsADriftFromAKnock) {
  RunningRig rig(3, 900);
  rig.options().phases = {0, 0.1, 0.2};
  rig.options().rate_hz = 10;
  rig.run(60s);
  const Time begin = rig.now();
  const auto flagged = [&] { return is_wrong(rig.camera(1).state); };
  while (!flagged() && rig.now() < begin + 3600s) {
    rig.options().moved = {Vector6::Zero(), turned(0.3 * to_seconds(rig.now() - begin) / 3600)};
    rig.run(5s);
  }
  ASSERT_TRUE(flagged());
  std::printf("0.3 deg in an hour: flagged after %.0f s, at %.3f deg\n",
              to_seconds(rig.now() - begin), 0.3 * to_seconds(rig.now() - begin) / 3600);
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kDrifting);
  EXPECT_NEAR(rig.camera(1).rate[1] * 3600 / kDegree, 0.3, 0.15);
}

TEST(CalibrationWatch, OfTwoCamerasNobodyTellsWhich) {
  RunningRig rig(2, 700);
  rig.run(60s);
  rig.options().moved = {Vector6::Zero(), turned(0.5)};
  rig.run(60s);
  EXPECT_EQ(rig.camera(0).state, CalibrationState::kDisputed);
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kDisputed);
  EXPECT_FALSE(rig.watch().extra_covariance(CameraId(1)));
}

TEST(CalibrationWatch, ACameraThatIsPutBackIsInOrderAgain) {
  RunningRig rig(3, 800);
  rig.run(40s);
  rig.options().moved = {Vector6::Zero(), turned(0.5)};
  rig.run(40s);
  ASSERT_EQ(rig.camera(1).state, CalibrationState::kKnocked);
  EXPECT_TRUE(rig.watch().extra_covariance(CameraId(1)));
  rig.options().moved.clear();
  rig.run(90s);
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kInOrder);
  EXPECT_FALSE(rig.watch().extra_covariance(CameraId(1)));
}

TEST(CalibrationWatch, ACorrectedCalibrationIsInOrder) {
  RunningRig rig(3, 850);
  rig.options().moved = {Vector6::Zero(), shifted(5)};
  rig.run(40s);
  ASSERT_EQ(rig.camera(1).state, CalibrationState::kKnocked);
  EXPECT_TRUE(rig.camera(1).since_start);
  const Vector6 correction = rig.camera(1).correction;
  rig.accept(1);
  // What the new calibration leaves of it.
  const Rigid3 left = Rigid3::exp(correction).inverse() * Rigid3::exp(shifted(5));
  rig.options().moved = {Vector6::Zero(), left.log()};
  rig.options().recalibrated = {Vector6::Zero(), correction};
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kUnknown);
  rig.run(40s);
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(rig.camera(i).state, CalibrationState::kInOrder);
}

}  // namespace
}  // namespace sightline
