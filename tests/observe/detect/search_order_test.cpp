// SPDX-License-Identifier: Apache-2.0
// What is new, what moves and everything are searched by turns.
#include "observe/detect/plan/search_order.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using test::turned;
using Where = DetectorFrames::Where;

constexpr double kRadius = 0.1;  // [m]

// A truck that is carried through a room, twice looked at.
struct Carried {
  explicit Carried(bool moves)
      : rig(test::search_scene(test::make_truck(),
                               [moves](Time time) {
                                 const double t = moves ? to_seconds(time - Time{}) : 0;
                                 return turned(0.8, {1, 2, 3}, {0.4 * t - 0.05, 0.02, 0.01});
                               })),
        frames(test::detector_cameras(rig), {}) {
    const auto sets = rig.sets();
    for (const size_t set : {0u, 6u}) {
      for (const test::SceneShot& shot : sets.at(set)) {
        frames.add(CameraId(static_cast<uint32_t>(shot.camera)), *rig.shoot(shot), nullptr);
      }
    }
  }
  Rigid3 now() const { return rig.truth(frames.newest()); }

  test::SceneRig rig;
  DetectorFrames frames;
};

// Something that stands out by too little, at a place.
Detection weak(const Eigen::Vector3d& place) {
  Detection out;
  out.time = Time(std::chrono::seconds(2));
  DetectedPose pose;
  pose.world_from_object.translation = place;
  pose.evidence = 0.55;
  out.poses.push_back(pose);
  out.runner_up = 0.4;
  return out;
}

TEST(SearchOrder, TakesTurnsWhereSomethingMoves) {
  Carried scene(true);
  SearchOrder order(Eigen::Vector3d::Zero(), kRadius);
  for (int turn = 0; turn < 3; ++turn) {
    ASSERT_EQ(order.next(scene.frames, nullptr, false), Where::kMotion);
    order.note(Where::kMotion, false, false);
    ASSERT_EQ(order.next(scene.frames, nullptr, false), Where::kEverywhere);
    order.note(Where::kEverywhere, false, false);
  }
  order.note(Where::kMotion, true, false);
  EXPECT_EQ(order.next(scene.frames, nullptr, false), Where::kMotion) << "it was found there";
}

TEST(SearchOrder, LooksEverywhereWhereNothingMovesOrSomebodyPoints) {
  Carried still(false), moving(true);
  const SearchOrder order(Eigen::Vector3d::Zero(), kRadius);
  EXPECT_EQ(order.next(still.frames, nullptr, false), Where::kEverywhere);
  EXPECT_EQ(order.next(moving.frames, nullptr, true), Where::kEverywhere);
}

TEST(SearchOrder, LooksAgainWhereSomethingWaits) {
  Carried scene(true);
  ASSERT_TRUE(scene.frames.select(Where::kEverywhere));
  SearchOrder order(Eigen::Vector3d::Zero(), kRadius);
  const Detection carried = weak(scene.now().translation);
  const Detection resting = weak(scene.now().translation + Eigen::Vector3d(0, 0.3, 0));
  // Found by the search of everything, and not among what moves: that would lose it.
  order.note(Where::kEverywhere, false, true);
  EXPECT_EQ(order.next(scene.frames, &resting, false), Where::kEverywhere);
  order.note(Where::kMotion, false, true);
  EXPECT_EQ(order.next(scene.frames, &carried, false), Where::kMotion);
  order.note(Where::kEverywhere, false, true);
  EXPECT_EQ(order.next(scene.frames, &carried, false), Where::kMotion);
}

}  // namespace
}  // namespace sightline::observe
