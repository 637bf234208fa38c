// SPDX-License-Identifier: Apache-2.0
// Are the covariances honest? Monte-Carlo over the synthetic rig; normalized estimation error
// squared (Bar-Shalom, Li, Kirubarajan: Estimation with Applications, section 5.4).
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "fuse/update/chi_square.hpp"
#include "sightline/fuse/estimator.hpp"
#include "support/synthetic_rig.hpp"

namespace sightline {
namespace {

using fuse::chi_square_quantile;
using test::MotionKind;
using test::RigOptions;
using test::SyntheticRig;

/// Motion exactly as the filter models it, slow enough to stay in the images.
RigOptions matched_rig(int cameras, uint64_t seed) {
  RigOptions options;
  options.cameras = cameras;
  options.arc = 1.05 * (cameras - 1);
  options.duration = std::chrono::milliseconds(1200);
  options.motion.kind = MotionKind::kWhiteAcceleration;
  options.motion.noise = {1.5, 0.15};
  options.motion.initial_twist_sigma << 0.3, 0.3, 0.3, 0.05, 0.05, 0.05;
  options.seed = seed;
  return options;
}

/// Calibrations are right here, and the filter knows it.
EstimatorOptions matched_estimator(bool adapt) {
  EstimatorOptions options;
  options.learn_systematic = false;
  options.noise = {1.5, 0.15};
  options.start_sigma_angular = 0.3;
  options.start_sigma_linear = 0.05;
  options.adapt_motion = adapt;
  return options;
}

Eigen::Matrix<double, 12, 1> error_of(const PoseEstimate& estimate, const SyntheticRig& rig) {
  Eigen::Matrix<double, 12, 1> error;
  error << difference(estimate.world_from_object, rig.truth(estimate.time)),
      rig.truth_twist(estimate.time) - estimate.twist;
  return error;
}

struct Nees {
  double pose = 0;
  double full = 0;
};

Nees nees_of(const PoseEstimate& estimate, const SyntheticRig& rig) {
  const auto error = error_of(estimate, rig);
  return {error.head<6>().dot(estimate.pose_covariance().ldlt().solve(error.head<6>())),
          error.dot(estimate.covariance.ldlt().solve(error))};
}

/// Normalized errors of many runs, sampled at the same steps in each run.
class Consistency {
 public:
  explicit Consistency(int runs) : runs_(runs) {}

  void add(size_t step, const Nees& nees) {
    if (steps_.size() <= step) steps_.resize(step + 1);
    steps_[step].pose += nees.pose / runs_;
    steps_[step].full += nees.full / runs_;
  }

  /// Share of steps whose average over the runs lies in the two-sided 95 % band.
  double share_inside(int dof, double Nees::*which) const {
    const double low = chi_square_quantile(0.025, dof * runs_) / runs_;
    const double high = chi_square_quantile(0.975, dof * runs_) / runs_;
    int inside = 0;
    for (const Nees& step : steps_) inside += step.*which >= low && step.*which <= high ? 1 : 0;
    return inside / static_cast<double>(steps_.size());
  }
  double mean(double Nees::*which) const {
    double sum = 0;
    for (const Nees& step : steps_) sum += step.*which;
    return sum / static_cast<double>(steps_.size());
  }

 private:
  int runs_;
  std::vector<Nees> steps_;
};

constexpr int kRuns = 60;
constexpr int kSteps = 20;

template <typename MakeRig>
Consistency monte_carlo(const MakeRig& make_rig, const EstimatorOptions& options) {
  Consistency consistency(kRuns);
  for (int run = 0; run < kRuns; ++run) {
    const SyntheticRig rig(make_rig(static_cast<uint64_t>(run) + 1));
    auto estimator = ObjectEstimator::create(options, ObjectId(0)).value();
    size_t step = 0;
    for (const auto& set : rig.sets()) {
      const UpdateReport report = estimator.process(set);
      const PoseEstimate newest = estimator.track()->newest();
      // At equal distances from 0.2 s on, of the newest estimate there is.
      const Time due = time_from_ns(200'000'000 + static_cast<int64_t>(step) * 45'000'000);
      if (report.dropped || newest.time < due || step >= kSteps) continue;
      EXPECT_TRUE(has_pose(newest.state)) << "run " << run << " step " << step;
      consistency.add(step++, nees_of(newest, rig));
    }
    EXPECT_EQ(step, static_cast<size_t>(kSteps));
  }
  return consistency;
}

void expect_consistent(const Consistency& c, const std::string& what) {
  const double pose = c.share_inside(6, &Nees::pose);
  const double full = c.share_inside(12, &Nees::full);
  std::printf("%-34s pose mean %.2f inside %.2f   pose+twist mean %.2f inside %.2f\n", what.c_str(),
              c.mean(&Nees::pose), pose, c.mean(&Nees::full), full);
  // 19 of 20 are expected; steps are correlated, so leave room for two more.
  EXPECT_GE(pose, 0.85) << what;
  EXPECT_GE(full, 0.85) << what;
}

TEST(Consistency, FreeRunningCameras) {
  for (const int cameras : {1, 2, 4}) {
    expect_consistent(monte_carlo([&](uint64_t seed) { return matched_rig(cameras, seed); },
                                  matched_estimator(false)),
                      std::to_string(cameras) + " free-running");
  }
}

TEST(Consistency, SynchronousCameras) {
  const auto rig = [](uint64_t seed) {
    RigOptions options = matched_rig(3, seed);
    options.phases = {0, 0, 0};
    return options;
  };
  expect_consistent(monte_carlo(rig, matched_estimator(false)), "3 synchronous");
}

TEST(Consistency, DropoutsAndLateData) {
  for (const int cameras : {1, 2, 4}) {
    const auto rig = [&](uint64_t seed) {
      RigOptions options = matched_rig(cameras, seed);
      options.dropout = 0.2;
      options.late_share = 0.3;
      options.late_by = std::chrono::milliseconds(70);
      return options;
    };
    expect_consistent(monte_carlo(rig, matched_estimator(false)),
                      std::to_string(cameras) + " with dropouts, late data");
  }
}

TEST(Consistency, UncertainCaptureTimes) {
  const auto rig = [](uint64_t seed) {
    RigOptions options = matched_rig(2, seed);
    options.capture_error = std::chrono::milliseconds(5);
    options.motion.initial_twist << 0.5, 0.5, 0.5, 0.1, 0.1, 0.1;
    return options;
  };
  EstimatorOptions options = matched_estimator(false);
  options.start_sigma_angular = 0.6;
  options.start_sigma_linear = 0.15;
  expect_consistent(monte_carlo(rig, options), "2 with stamps +-5 ms");
}

TEST(Consistency, LearnedMotionNoise) {
  const auto rig = [](uint64_t seed) { return matched_rig(2, seed); };
  expect_consistent(monte_carlo(rig, matched_estimator(true)), "learned, nominal right");
  // Nominal motion four times too lively: better known than without learning, still not
  // overtrusted.
  EstimatorOptions options = matched_estimator(true);
  options.noise = {6.0, 0.6};
  const Consistency learned = monte_carlo(rig, options);
  options.adapt_motion = false;
  const Consistency fixed = monte_carlo(rig, options);
  EXPECT_LT(learned.mean(&Nees::pose), 6.3);
  EXPECT_LT(learned.mean(&Nees::full), 12.6);
  EXPECT_GT(learned.mean(&Nees::full), fixed.mean(&Nees::full));
}

// A rig that has to prove first that its calibration is right is never surer than it may be.
TEST(Consistency, CamerasThatAreNotProvenYet) {
  for (const int cameras : {2, 4}) {
    EstimatorOptions options = matched_estimator(true);
    options.learn_systematic = true;
    const Consistency c =
        monte_carlo([&](uint64_t seed) { return matched_rig(cameras, seed); }, options);
    std::printf("%d to be proven: pose mean %.2f   pose+twist mean %.2f\n", cameras,
                c.mean(&Nees::pose), c.mean(&Nees::full));
    EXPECT_LT(c.mean(&Nees::pose), 6.3);
    EXPECT_LT(c.mean(&Nees::full), 12.6);
    EXPECT_GT(c.mean(&Nees::pose), 1.5);
  }
}

}  // namespace
}  // namespace sightline
