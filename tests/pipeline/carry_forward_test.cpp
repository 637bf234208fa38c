// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/carry_forward.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "sightline/fuse/estimator.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::test {
namespace {

using namespace std::chrono_literals;

FramePtr frame_at(uint32_t camera, Duration capture, uint8_t level = 0) {
  FrameInfo info;
  info.camera = CameraId(camera);
  info.width = 16;
  info.height = 8;
  info.capture = Time(capture);
  auto image = std::make_shared<Image>(16, 8);
  std::fill_n(image->mutable_view().y.data, 16, level);
  return Frame::decoded(info, image);
}

std::vector<Duration> captures(const std::vector<FramePtr>& frames) {
  std::vector<Duration> out;
  for (const FramePtr& frame : frames) out.push_back(frame->info().capture.time_since_epoch());
  return out;
}

TEST(FrameTrail, KeepsCopiesWhileItIsOpen) {
  FrameTrail trail(2);
  trail.push(CameraId(0), *frame_at(0, 10ms));
  EXPECT_EQ(trail.newest(), Time::min()) << "not open yet";
  trail.open();
  const FramePtr frame = frame_at(0, 20ms, 77);
  trail.push(CameraId(0), *frame);
  trail.push(CameraId(1), *frame_at(1, 25ms));
  trail.push(CameraId(7), *frame_at(7, 30ms));  // no camera of this installation
  EXPECT_EQ(trail.newest(), Time(25ms));
  const auto taken = trail.take_until(Time(24ms));
  ASSERT_EQ(captures(taken), std::vector<Duration>{20ms});
  EXPECT_NE(taken[0]->i420().y.data, frame->i420().y.data) << "the camera's buffer is free";
  EXPECT_EQ(taken[0]->i420().y.data[0], 77);
  EXPECT_EQ(captures(trail.take_until(Time(25ms))), std::vector<Duration>{25ms});
  trail.push(CameraId(1), *frame_at(1, 30ms));
  trail.close();
  EXPECT_EQ(trail.newest(), Time::min());
}

TEST(FrameTrail, TakesTheNewestThatIsNotLater) {
  FrameTrail trail(1);
  trail.open();
  for (const Duration capture : {10ms, 20ms, 30ms}) trail.push(CameraId(0), *frame_at(0, capture));
  EXPECT_EQ(captures(trail.take_until(Time(25ms))), std::vector<Duration>{20ms});
  EXPECT_EQ(captures(trail.take_until(Time(40ms))), std::vector<Duration>{30ms});
  EXPECT_TRUE(trail.take_until(Time(50ms)).empty());
}

TEST(FrameTrail, IsBoundedAndSpansAllThatCame) {
  FrameTrail trail(1, 8);
  trail.open();
  constexpr int kFrames = 500;
  for (int i = 0; i < kFrames; ++i) trail.push(CameraId(0), *frame_at(0, i * 10ms));
  std::vector<Duration> kept;
  for (int i = 0; i < kFrames; ++i) {
    for (const Duration capture : captures(trail.take_until(Time(i * 10ms)))) {
      kept.push_back(capture);
    }
  }
  EXPECT_LE(kept.size(), 8u);
  EXPECT_GE(kept.size(), 4u);
  EXPECT_EQ(kept.front(), 0ms);
  Duration longest{};
  for (size_t i = 1; i < kept.size(); ++i) longest = std::max(longest, kept[i] - kept[i - 1]);
  EXPECT_LE(longest, 1300ms) << "evenly spread";
  EXPECT_GE(kept.back(), 3500ms);
}

TEST(FrameTrail, ACameraMayComeBackInAnotherSize) {
  FrameTrail trail(1);
  trail.open();
  trail.push(CameraId(0), *frame_at(0, 10ms));
  FrameInfo info;
  info.camera = CameraId(0);
  info.width = 32;
  info.height = 16;
  info.capture = Time(20ms);
  trail.push(CameraId(0), *Frame::decoded(info, std::make_shared<Image>(32, 16)));
  const auto taken = trail.take_until(Time(30ms));
  ASSERT_EQ(taken.size(), 1u);
  EXPECT_EQ(taken[0]->i420().width(), 32);
}

// An object that is found in the first set of frames and moves on while the search runs.
class CarryForward : public testing::Test {
 protected:
  CarryForward() : rig_(options(mesh_)) {
    DetectorOptions detector;
    detector.nearest = 0.55;
    detector.farthest = 0.9;
    detector_ =
        ObjectDetector::create(ObjectId(0), views_of(mesh_), detector_cameras(rig_), detector)
            .value();
    sets_ = rig_.sets();
    for (const SceneShot& shot : sets_.front()) add(*rig_.shoot(shot));
    for (size_t i = 0; i < rig_.cameras().size() && found_.poses.empty(); ++i) {
      found_ = detector_->detect();
    }
  }

  // 0.6 m/s and 100 deg/s.
  static SceneRigOptions options(const TriangleMesh& mesh) {
    SceneRigOptions out = search_scene(mesh, [](Time time) {
      const double t = to_seconds(time - Time{});  // since the start
      return turned(0.8 + 1.7 * t, {1, 2, 3}, {0.03 - 0.5 * t, 0.3 * t - 0.02, 0.01});
    });
    out.duration = 400ms;
    return out;
  }

  void add(const Frame& frame) { detector_->add_frame(frame.info().camera, frame); }

  std::vector<Observation> follow(std::span<const FramePtr> frames) {
    for (const FramePtr& frame : frames) add(*frame);
    found_ = detector_->follow(found_);
    return found_.observations;
  }

  const TriangleMesh mesh_ = make_truck();
  const SceneRig rig_;
  std::unique_ptr<ObjectDetector> detector_;
  std::vector<std::vector<SceneShot>> sets_;
  Detection found_;
};

TEST_F(CarryForward, WhatMovesWhileItIsSearchedForIsFoundWhereItIsNow) {
  ASSERT_EQ(found_.poses.size(), 1u);
  FrameTrail trail(rig_.cameras().size());
  trail.open();
  for (size_t i = 1; i < sets_.size(); ++i) {
    for (const SceneShot& shot : sets_[i]) {
      trail.push(CameraId(static_cast<uint32_t>(shot.camera)), *rig_.shoot(shot));
    }
  }
  int steps = 0;
  CarryOptions options;
  options.close_enough = 1ms;
  const auto found = carry_forward(
      trail, found_.observations,
      [&](std::span<const FramePtr> frames) {
        ++steps;
        return follow(frames);
      },
      [] { return true; }, options);
  ASSERT_FALSE(found.empty());
  const Time last = sets_.back().front().stamp;
  EXPECT_EQ(found.back().capture, last);
  EXPECT_LT(steps, static_cast<int>(sets_.size()) - 1)
      << "in longer steps than from frame to frame";
  EXPECT_LT(translation_distance(found_.poses[0].world_from_object, rig_.truth(last)), 0.008);
  EXPECT_LT(rotation_angle(found_.poses[0].world_from_object, rig_.truth(last)), 0.06);
}

TEST_F(CarryForward, TheWayThereSaysHowItMoves) {
  ASSERT_EQ(found_.poses.size(), 1u);
  FrameTrail trail(rig_.cameras().size());
  trail.open();
  for (size_t i = 1; i < sets_.size(); ++i) {
    for (const SceneShot& shot : sets_[i]) {
      trail.push(CameraId(static_cast<uint32_t>(shot.camera)), *rig_.shoot(shot));
    }
  }
  const CarryOptions options;
  const auto way = carry_forward(
      trail, found_.observations, [&](std::span<const FramePtr> frames) { return follow(frames); },
      [] { return true; });
  ASSERT_FALSE(way.empty());
  EXPECT_TRUE(std::is_sorted(way.begin(), way.end(),
                             [](const auto& a, const auto& b) { return a.capture < b.capture; }));
  EXPECT_LE(way.back().capture - way.front().capture, options.way);
  EXPECT_GT(way.back().capture - way.front().capture, 50ms);

  auto with_way = ObjectEstimator::create({}, ObjectId(0)).value();
  for (const Observation& observation : way) with_way.process({&observation, 1});
  auto without = ObjectEstimator::create({}, ObjectId(0)).value();
  for (const Observation& observation : way) {
    if (observation.capture == way.back().capture) without.process({&observation, 1});
  }
  const Time later = way.back().capture + 100ms;
  const auto error = [&](const ObjectEstimator& estimator) {
    return translation_distance(estimator.track()->at(later).estimate.world_from_object,
                                rig_.truth(later));
  };
  EXPECT_LT(error(with_way), 0.02);
  EXPECT_GT(error(without), 0.04) << "then the way need not be handed over";
}

TEST_F(CarryForward, ThrownAtTheNewestFrameItIsLost) {
  ASSERT_EQ(found_.poses.size(), 1u);
  std::vector<FramePtr> newest;
  for (const SceneShot& shot : sets_.back()) newest.push_back(rig_.shoot(shot));
  const auto found = follow(newest);
  const bool right =
      !found.empty() && translation_distance(found_.poses[0].world_from_object,
                                             rig_.truth(found.back().capture)) < 0.02;
  EXPECT_FALSE(right) << "then nothing need be carried";
}

TEST(CarryForwardRules, EndsWithWhatIsLostAndWhenToldTo) {
  FrameTrail trail(1);
  trail.open();
  for (int i = 1; i < 10; ++i) trail.push(CameraId(0), *frame_at(0, i * 33ms));
  std::vector<Observation> found(1);
  found[0].capture = Time(0ms);
  int steps = 0;
  const auto lose = [&](std::span<const FramePtr>) {
    ++steps;
    return std::vector<Observation>();
  };
  EXPECT_TRUE(carry_forward(trail, found, lose, [] { return true; }).empty());
  EXPECT_EQ(steps, 3) << "two misses are forgiven";
  EXPECT_EQ(carry_forward(trail, found, lose, [] { return false; }).size(), 1u);
  EXPECT_TRUE(carry_forward(trail, {}, lose, [] { return true; }).empty());
  EXPECT_EQ(steps, 3);
}

// Steps that take longer than what is close enough never come closer to now than that.
TEST(CarryForwardRules, EndsThoughFramesComeWhileAStepRuns) {
  for (const int frames_of_step : {2, 3, 9}) {
    const Duration period = 33ms, took = frames_of_step * period;
    FrameTrail trail(1);
    trail.open();
    int last = 0;
    const auto pass = [&](int frames) {
      for (; frames > 0; --frames) trail.push(CameraId(0), *frame_at(0, ++last * period));
    };
    pass(9);
    std::vector<Observation> found(1);
    found[0].capture = Time(0ms);
    int steps = 0;
    const auto slow = [&](std::span<const FramePtr> frames) {
      std::vector<Observation> out(1);
      out[0].capture = frames.back()->info().capture;
      pass(frames_of_step);
      return out;
    };
    const auto carried = carry_forward(trail, found, slow, [&] { return ++steps < 50; });
    EXPECT_LT(steps, 20) << frames_of_step;
    ASSERT_FALSE(carried.empty());
    EXPECT_LE(trail.newest() - carried.back().capture, took + period)
        << "no older than a step takes; of a long way every second frame is kept";
  }
}

TEST(CarryForwardRules, WhereItWasMissedIsNoEnd) {
  FrameTrail trail(1);
  trail.open();
  for (int i = 1; i < 4; ++i) trail.push(CameraId(0), *frame_at(0, i * 33ms));
  std::vector<Observation> found(1);
  found[0].capture = Time(0ms);
  int steps = 0;
  const auto miss_once = [&](std::span<const FramePtr> frames) {
    std::vector<Observation> out(++steps == 1 ? 0 : 1);
    for (Observation& seen : out) seen.capture = frames.back()->info().capture;
    return out;
  };
  const auto carried = carry_forward(trail, found, miss_once, [] { return true; });
  ASSERT_FALSE(carried.empty()) << "the newest frame shows it, though it is close to now";
  EXPECT_EQ(carried.back().capture, Time(99ms));
}

}  // namespace
}  // namespace sightline::test
