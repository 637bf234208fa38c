// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/turn/turn_filter.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <random>

namespace sightline {
namespace {

constexpr double kLatency = 0.07, kRounding = 2.5e-4, kImage = 1e-4;  // [s, rad, rad]

/// A head whose rates are drawn anew for each frame, and two keyframes: all is linear.
struct World {
  explicit World(unsigned seed) : random(seed) {
    for (KeyframeView& view : truth) {
      view.angles = {0.1 * normal(random), 0.1 * normal(random)};
      view.inverse_depth = TurnFilter::kInverseDepth + 0.3 * normal(random);
    }
  }
  EncoderAngles encoder(const Eigen::Vector2d& angles, double at_latency) {
    EncoderAngles out;
    out.rates = {0.6 * normal(random), 0.2 * normal(random)};
    out.latency_s = at_latency;
    out.sigmas.setConstant(kRounding);
    out.angles = angles - out.rates * (kLatency - at_latency) +
                 kRounding * Eigen::Vector2d(normal(random), normal(random));
    return out;
  }
  /// The angles of a frame by a keyframe that is believed to be `view`.
  PictureAngles picture(const Eigen::Vector2d& angles, size_t keyframe, const KeyframeView& view) {
    PictureAngles out;
    out.by_depth = 0.05 * (truth[keyframe].angles - angles);
    out.angles = angles - (truth[keyframe].angles - view.angles) -
                 out.by_depth * (truth[keyframe].inverse_depth - view.inverse_depth) +
                 kImage * Eigen::Vector2d(normal(random), normal(random));
    out.covariance = kImage * kImage * Eigen::Matrix2d::Identity();
    return out;
  }
  std::mt19937 random;
  std::normal_distribution<double> normal;
  std::array<KeyframeView, 2> truth;
};

TurnFilter::Options options(double latency_s) { return {latency_s, 0.001, 1e-6}; }

// 95 % of a chi^2 of one lie below 3.84; of two hundred runs some five of a hundred are beyond.
TEST(TurnFilter, KnowsTheLatencyAndHowWell) {
  int beyond = 0, angles_beyond = 0;
  double sum = 0;
  constexpr int kRuns = 200;
  constexpr double kFrame = 0.001;  // [s]: nothing drifts meanwhile
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    World world(seed);
    TurnFilter filter(options(kLatency + 0.03 * world.normal(world.random)));
    const double at = filter.latency();
    filter.add_by_encoder(0, world.encoder(world.truth[0].angles, at));
    filter.add_by_picture(1, 0, world.picture(world.truth[1].angles, 0, filter.view(0)));
    for (int i = 0; i < 40; ++i) {
      const size_t keyframe = world.random() % 2;
      const Eigen::Vector2d angles(0.2 * world.normal(world.random),
                                   0.1 * world.normal(world.random));
      const EncoderAngles encoder = world.encoder(angles, at);
      const PictureAngles picture = world.picture(angles, keyframe, filter.view(keyframe));
      if (i == 39) {
        const auto fused = filter.fuse(encoder, keyframe, picture);
        // Where the configured latency is not contradicted yet, it is believed.
        if (!fused || !filter.latency_contradicted()) continue;
        const Eigen::Vector2d error = fused->angles - angles;
        angles_beyond += error.dot(fused->covariance.inverse() * error) > 5.99 ? 1 : 0;
      }
      filter.learn(encoder, keyframe, picture, kFrame, 0);
    }
    const double error = (filter.latency() - kLatency) / filter.latency_sigma();
    sum += error * error;
    beyond += error * error > 3.84 ? 1 : 0;
    EXPECT_LT(filter.latency_sigma(), 0.001);
  }
  EXPECT_LT(beyond, 0.1 * kRuns);
  EXPECT_LT(angles_beyond, 0.1 * kRuns);
  EXPECT_NEAR(sum / kRuns, 1, 0.35);
}

TEST(TurnFilter, SaysThatTheConfiguredLatencyIsWrongOnlyWhereItIs) {
  for (const double configured : {kLatency, 0.03, 0.11}) {
    World world(5);
    TurnFilter filter(options(configured));
    EXPECT_FALSE(filter.latency_known());
    EXPECT_EQ(filter.used_latency(), configured);
    filter.add_by_encoder(0, world.encoder(world.truth[0].angles, configured));
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector2d angles(0.2 * std::sin(0.1 * i), 0.1);
      filter.learn(world.encoder(angles, configured), 0, world.picture(angles, 0, filter.view(0)),
                   0.033, 0);
    }
    EXPECT_TRUE(filter.latency_known());
    EXPECT_EQ(filter.latency_contradicted(), configured != kLatency);
    EXPECT_NEAR(filter.used_latency(), kLatency, 0.001);
  }
}

TEST(TurnFilter, CountsAReadingOnce) {
  World world(3);
  TurnFilter filter({kLatency, 0.001, 1e-3});
  filter.add_by_encoder(0, world.encoder({0.1, 0.1}, kLatency));
  EncoderAngles still;
  still.angles = {0.1, 0.1};
  still.sigmas.setConstant(kRounding);
  still.latency_s = kLatency;
  PictureAngles picture;
  picture.angles = still.angles;
  picture.covariance = kImage * kImage * Eigen::Matrix2d::Identity();
  EXPECT_EQ(filter.learn(still, 0, picture, 0.033, 0), TurnFilter::UpdateResult::kApplied);
  EXPECT_EQ(filter.learn(still, 0, picture, 0.033, 0), TurnFilter::UpdateResult::kNothingNew);
  still.angles.x() += 0.0011;
  EXPECT_EQ(filter.learn(still, 0, picture, 0.033, 0), TurnFilter::UpdateResult::kApplied);
}

TEST(TurnFilter, RefusesWhatContradictsItself) {
  World world(4);
  TurnFilter filter(options(kLatency));
  filter.add_by_encoder(0, world.encoder(world.truth[0].angles, kLatency));
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2d angles(0.2 * std::sin(0.1 * i), 0.1 * std::cos(0.1 * i));
    filter.learn(world.encoder(angles, kLatency), 0, world.picture(angles, 0, filter.view(0)),
                 0.033, 0);
  }
  const Eigen::Vector2d angles(0.05, -0.02);
  const EncoderAngles encoder = world.encoder(angles, kLatency);
  PictureAngles picture = world.picture(angles, 0, filter.view(0));
  EXPECT_TRUE(filter.fuse(encoder, 0, picture));
  picture.angles.x() += 0.01;
  EXPECT_FALSE(filter.fuse(encoder, 0, picture));
  const double before = filter.latency();
  EXPECT_EQ(filter.learn(encoder, 0, picture, 0.033, 0), TurnFilter::UpdateResult::kContradicted);
  EXPECT_EQ(filter.latency(), before);
}

}  // namespace
}  // namespace sightline
