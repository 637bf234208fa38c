// SPDX-License-Identifier: Apache-2.0
// A head under a camera, with 200 ms from order to turn and readings that are late and rounded; the
// object moves, and its track says where it was.
#include "sightline/pipeline/turning/follower.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "support/random.hpp"
#include "support/simulated_head.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::SimulatedHead;

constexpr double kDegree = std::numbers::pi / 180;
constexpr ObjectId kObject{0}, kOther{1};

CalibratedCamera camera_on_a_head() {
  auto model = CameraModel::create(
      {.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 322, .cy = 238}, "head");
  CameraAxes axes;
  axes.world_from_base.translation = {0.2, -0.1, 1.5};
  Eigen::Matrix3d tilt_from_camera;
  tilt_from_camera << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  axes.tilt_from_camera = Rigid3(Eigen::Quaterniond(tilt_from_camera), {0.01, 0.03, 0.02});
  axes.latency_s = 0.03;
  CalibratedCamera camera{"head", *std::move(model), {}, 0.5};
  camera.axes = axes;
  return camera;
}

/// The world: a head, who follows, and objects on their ways. Time goes on in steps of 5 ms.
class Room {
 public:
  explicit Room(const FollowConfig& config)
      : config_(config),
        camera_(camera_on_a_head()),
        follower_(config, camera_),
        history_(*camera_.axes, 600),
        head_(0.2, 1.5 * config.limits.acceleration) {}

  using Way = std::function<Eigen::Vector3d(double)>;
  /// Where objects are; empty: nobody knows.
  std::vector<Way> ways{1};
  bool silent = false, backwards = false;
  HeadAngles pushed = HeadAngles::Zero();  ///< [rad/s], by somebody else
  int orders = 0;
  FollowSharing* sharing = nullptr;
  int number = 0;  ///< among those that share

  void run(double seconds, const std::function<void()>& look = {}) {
    for (double end = time_ + seconds; time_ < end; time_ += SimulatedHead::kStep) {
      step();
      if (look) look();
    }
  }
  const FollowStatus& status() const { return follower_.status(); }
  Follower& follower() { return follower_; }
  SimulatedHead& head() { return head_; }
  Time now() const { return Time{} + from_seconds(1000 + time_); }
  /// Where an object is in the picture of the head as it stands.
  double off_middle_px(size_t object) const {
    const Rigid3 pose = camera_.axes->world_from_camera(head_.angles().x(), head_.angles().y());
    const auto pixel = camera_.model.project(pose.inverse() * ways[object](time_));
    return pixel ? (*pixel - Eigen::Vector2d(319.5, 239.5)).norm() : 1e9;
  }

 private:
  void step() {
    head_.run(now());
    if (!pushed.isZero()) head_.push(pushed * SimulatedHead::kStep);
    if (++steps_ % 5 == 0) late_.push_back({now() + 30ms, head_.angles().x(), head_.angles().y()});
    while (!late_.empty() && late_.front().stamp <= now()) {
      const auto rounded = [](double angle) {
        return std::round(angle / (0.05 * kDegree)) * 0.05 * kDegree;
      };
      AxisReading reading = late_.front();
      late_.pop_front();
      reading.pan = rounded(reading.pan);
      reading.tilt = rounded(reading.tilt);
      if (!silent) history_.add(reading);
    }
    if (steps_ % 9 != 0) return;
    std::vector<FollowTarget> targets;
    std::vector<PoseTrackPtr> tracks;
    for (size_t i = 0; i < ways.size(); ++i) {
      targets.push_back({ObjectId(static_cast<uint32_t>(i)), Eigen::Vector3d::Zero()});
      tracks.push_back(track(i));
    }
    const auto shared = sharing ? std::optional(SharedHead{*sharing, number}) : std::nullopt;
    const auto order = follower_.step(now(), history_, tracks, targets, shared);
    if (order) obey(*order);
  }

  void obey(HeadOrder order) {
    ++orders;
    const HeadLimits& limits = config_.limits;
    EXPECT_TRUE((order.place.array() >= limits.low.array() - 1e-12).all());
    EXPECT_TRUE((order.place.array() <= limits.high.array() + 1e-12).all());
    EXPECT_LE(order.rate.cwiseAbs().maxCoeff(), limits.max_rate + 1e-12);
    if (backwards) order.place = 2 * head_.angles() - order.place;
    head_.order(now(), order);
  }

  // Measured 60 ms ago, with a velocity that jitters.
  PoseTrackPtr track(size_t object) {
    if (!ways[object]) return nullptr;
    const double when = time_ - 0.06;
    PoseEstimate estimate;
    estimate.object = ObjectId(static_cast<uint32_t>(object));
    estimate.time = estimate.last_measured = now() - 60ms;
    estimate.state = TrackState::kTracking;
    estimate.world_from_object.translation = ways[object](when);
    const Eigen::Vector3d velocity = (ways[object](when + 1e-4) - ways[object](when - 1e-4)) / 2e-4;
    for (int i = 0; i < 3; ++i) estimate.twist[3 + i] = velocity[i] + 0.02 * random_.normal();
    return std::make_shared<const PoseTrack>(estimate.object, std::vector{estimate}, MotionNoise{});
  }

  const FollowConfig config_;
  const CalibratedCamera camera_;
  Follower follower_;
  AxisHistory history_;
  SimulatedHead head_;
  std::deque<AxisReading> late_;
  test::Random random_{3};
  double time_ = 0;
  int steps_ = 0;
};

FollowConfig config() {
  FollowConfig follow;
  follow.limits.latency_s = 0.2;
  follow.home = HeadAngles(0.5, -0.1);
  follow.home_after = 2s;
  follow.yield = 4s;
  return follow;
}

Eigen::Vector3d resting(double) { return {-1, 3, 1}; }
Eigen::Vector3d circling(double t) {
  return {2 * std::cos(0.8 * t), 2.5 + std::sin(0.8 * t), 1 + 0.4 * std::sin(1.1 * t)};
}

TEST(Follower, KeepsAMovingObjectInTheMiddle) {
  Room room(config());
  room.ways[0] = circling;
  double worst = 0;
  room.run(3);
  room.run(20, [&] { worst = std::max(worst, room.off_middle_px(0)); });
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
  EXPECT_EQ(room.status().object, kObject);
  EXPECT_LT(worst, 60);  // of 640
}

TEST(Follower, AnObjectThatRestsIsHitAndTheHeadIsLeftAlone) {
  Room room(config());
  room.ways[0] = resting;
  room.run(4);
  EXPECT_LT(room.off_middle_px(0), 8);
  room.ways[0] = [](double) { return resting(0); };
  const HeadAngles before = room.head().angles();
  room.run(5);
  EXPECT_LT((room.head().angles() - before).norm(), 1 * kDegree);
}

TEST(Follower, TheFirstThatIsSeenIsFollowed) {
  Room room(config());
  room.ways = {nullptr, circling};
  room.run(1);
  EXPECT_EQ(room.status().object, kOther);
  room.ways[0] = resting;
  room.run(0.2);
  EXPECT_EQ(room.status().object, kObject);
  room.run(4);
  EXPECT_LT(room.off_middle_px(0), 8);
}

TEST(Follower, WaitsWhereItLostTheObjectAndGoesHome) {
  Room room(config());
  room.ways[0] = circling;
  room.run(4);
  room.ways[0] = nullptr;
  room.run(1);
  EXPECT_EQ(room.status().mode, FollowMode::kWaiting);
  const HeadAngles there = room.head().angles();
  room.run(0.8);
  EXPECT_LT((room.head().angles() - there).norm(), 0.5 * kDegree);
  room.run(4);
  EXPECT_EQ(room.status().mode, FollowMode::kHome);
  EXPECT_LT((room.head().angles() - config().home).norm(), 0.2 * kDegree);
  const int orders = room.orders;
  room.run(2);
  EXPECT_LE(room.orders, orders + 1);  // it is there
  room.ways[0] = circling;
  room.run(4);
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
  EXPECT_LT(room.off_middle_px(0), 60);
}

FollowConfig scanning() {
  FollowConfig follow = config();
  follow.limits.low = HeadAngles(-1.5, -0.6);
  follow.limits.high = HeadAngles(1.5, 0.6);
  follow.home_after = 1s;
  follow.scan = 150s;
  return follow;
}

// It looks around from where the object was last, leaves nothing out within its range, and goes
// home.
TEST(Follower, LooksAroundForWhatItLost) {
  Room room(scanning());
  room.ways[0] = resting;
  room.run(3);
  const HeadAngles last = room.head().angles();
  room.ways[0] = nullptr;
  room.run(1.5);
  EXPECT_EQ(room.status().mode, FollowMode::kScanning);
  EXPECT_LT((room.head().angles() - last).norm(), 2 * kDegree);
  std::vector<HeadAngles> stood;
  room.run(120, [&] {
    if (room.status().mode != FollowMode::kScanning) return;
    if (room.head().rates().norm() < 1e-3) stood.push_back(room.head().angles());
  });
  EXPECT_EQ(room.status().mode, FollowMode::kHome);
  EXPECT_LT((room.head().angles() - scanning().home).norm(), 0.2 * kDegree);
  const HeadLimits limits = scanning().limits;
  for (double pan = limits.low.x(); pan <= limits.high.x(); pan += 0.1) {
    for (double tilt = limits.low.y(); tilt <= limits.high.y(); tilt += 0.1) {
      EXPECT_TRUE(std::ranges::any_of(stood,
                                      [&](const HeadAngles& place) {
                                        return std::abs(place.x() - pan) * std::cos(tilt) <
                                                   0.49 &&  // half of the picture
                                               std::abs(place.y() - tilt) < 0.38;
                                      }))
          << pan << " " << tilt;
    }
  }
  const int orders = room.orders;
  room.run(5);  // once
  EXPECT_EQ(room.status().mode, FollowMode::kHome);
  EXPECT_LE(room.orders, orders + 1);
}

TEST(Follower, WhatItFindsWhileItLooksAroundIsFollowed) {
  Room room(scanning());
  room.run(2);
  EXPECT_EQ(room.status().mode, FollowMode::kHome);  // nothing has been lost yet
  room.ways[0] = resting;
  room.run(3);
  room.ways[0] = nullptr;
  room.run(4);
  EXPECT_EQ(room.status().mode, FollowMode::kScanning);
  room.ways[0] = resting;
  room.run(3);
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
  EXPECT_LT(room.off_middle_px(0), 8);
  room.ways[0] = nullptr;
  room.run(2);
  room.follower().hold(HeadAngles(0.1, 0.1), room.now() + 2s);
  room.run(4.5);
  EXPECT_EQ(room.status().mode, FollowMode::kHome);  // somebody had it meanwhile
}

TEST(Follower, LookingAroundEndsInTime) {
  FollowConfig follow = scanning();
  follow.scan = 3s;
  Room room(follow);
  room.ways[0] = resting;
  room.run(3);
  room.ways[0] = nullptr;
  room.run(3);
  EXPECT_EQ(room.status().mode, FollowMode::kScanning);
  room.run(1.5);
  EXPECT_EQ(room.status().mode, FollowMode::kHome);
}

TEST(Follower, TwoHeadsShareTwoObjects) {
  FollowSharing sharing;
  Room one(config()), two(config());
  one.sharing = two.sharing = &sharing;
  two.number = 1;
  one.ways = two.ways = {resting, circling};
  const auto both = [&](double seconds) {
    for (double t = 0; t < seconds; t += SimulatedHead::kStep) {
      one.run(SimulatedHead::kStep);
      two.run(SimulatedHead::kStep);
    }
  };
  both(4);
  ASSERT_TRUE(one.status().object && two.status().object);
  const ObjectId first = *one.status().object;
  EXPECT_NE(first, *two.status().object);
  EXPECT_LT(one.off_middle_px(first.index()), 60);
  EXPECT_LT(two.off_middle_px(two.status().object->index()), 60);
  one.follower().hold(std::nullopt, one.now() + 2s);
  both(1);
  EXPECT_EQ(two.status().object, kObject);  // alone, it follows the first
  both(3);
  EXPECT_NE(one.status().object, two.status().object);
  EXPECT_TRUE(one.status().object.has_value());
}

TEST(Follower, AnOrderHoldsItForATime) {
  Room room(config());
  room.ways[0] = circling;
  room.run(3);
  const HeadAngles place(-0.4, 0.2);
  room.follower().hold(place, room.now() + 5s);
  room.run(4);
  EXPECT_EQ(room.status().mode, FollowMode::kHeld);
  EXPECT_LT((room.head().angles() - place).norm(), 0.2 * kDegree);
  room.run(1.2);
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
  room.follower().hold(std::nullopt, room.now() + 100s);
  room.run(1.5);
  const HeadAngles there = room.head().angles();
  room.run(3);
  EXPECT_LT((room.head().angles() - there).norm(), 0.1 * kDegree);
  room.follower().release();
  room.run(0.2);
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
}

TEST(Follower, GivesWayToWhoeverElseTurnsTheHead) {
  Room room(config());
  room.ways[0] = resting;
  room.run(4);
  ASSERT_EQ(room.status().mode, FollowMode::kFollowing);
  room.pushed = HeadAngles(20 * kDegree, 0);
  room.run(1);
  EXPECT_EQ(room.status().mode, FollowMode::kYielding);
  room.pushed.setZero();
  room.run(0.5);
  const HeadAngles left = room.head().angles();
  const int orders = room.orders;
  room.run(2.5);
  EXPECT_EQ(room.orders, orders);
  EXPECT_LT((room.head().angles() - left).norm(), 0.1 * kDegree);
  room.run(5);
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
  EXPECT_LT(room.off_middle_px(0), 8);
}

TEST(Follower, AHeadThatTurnsTheWrongWayIsLeftAlone) {
  Room room(config());
  room.backwards = true;
  room.ways[0] = resting;
  room.run(1.5);
  EXPECT_EQ(room.status().mode, FollowMode::kYielding);
}

TEST(Follower, WithoutAnglesNothingIsOrdered) {
  Room room(config());
  room.ways[0] = circling;
  room.run(3);
  room.silent = true;
  room.run(0.5);
  EXPECT_EQ(room.status().mode, FollowMode::kBlind);
  const int orders = room.orders;
  room.run(2);
  EXPECT_EQ(room.orders, orders);
  EXPECT_LT(room.head().rates().norm(), 1e-2);
  room.silent = false;
  room.run(3);
  EXPECT_EQ(room.status().mode, FollowMode::kFollowing);
}

TEST(Follower, LimitsHoldWhereverObjectsGo) {
  test::Random random(17);
  for (int trial = 0; trial < 6; ++trial) {
    FollowConfig follow = config();
    follow.limits.low = HeadAngles(-0.7, -0.3);
    follow.limits.high = HeadAngles(0.9, 0.4);
    follow.home.setZero();
    follow.limits.latency_s = random.uniform(0.1, 0.3);
    Room room(follow);
    const Eigen::Vector3d speed(random.uniform(0.5, 3), random.uniform(0.5, 3),
                                random.uniform(0.5, 3));
    room.ways[0] = [=](double t) {  // also behind it, and over it
      return Eigen::Vector3d(4 * std::sin(speed.x() * t), 3 * std::cos(speed.y() * t),
                             1.5 + 2 * std::sin(speed.z() * t));
    };
    room.run(15, [&] {
      const HeadLimits& limits = follow.limits;
      EXPECT_TRUE((room.head().angles().array() > limits.low.array() - 0.01 * kDegree).all());
      EXPECT_TRUE((room.head().angles().array() < limits.high.array() + 0.01 * kDegree).all());
      EXPECT_LE(room.head().rates().cwiseAbs().maxCoeff(), limits.max_rate + 1e-9);
    });
    EXPECT_GT(room.orders, 20);
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace sightline
