// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/text/label_placement.hpp"

#include <gtest/gtest.h>

#include "overlay_scene.hpp"
#include "test_images.hpp"

namespace sightline::render {
namespace {

using namespace test;  // NOLINT: the tests' own helpers

bool intersect(const TileRect& a, const TileRect& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

constexpr Extent kBox{100, 120, 140, 160};

TEST(LabelPlacement, TakesTheUsualPlaceWhereItIsFree) {
  LabelPlacement placement(640, 480, 2);
  EXPECT_EQ(placement.beside(0, kBox, 80, 30), (TileRect{100, 90, 80, 30}));
  // No room above: below.
  EXPECT_EQ(placement.beside(1, {300, 10, 340, 50}, 80, 30), (TileRect{300, 52, 80, 30}));
}

TEST(LabelPlacement, ObjectsSideBySideDoNotShareAPlace) {
  LabelPlacement placement(640, 480, 4);
  std::vector<TileRect> places;
  for (size_t i = 0; i < 4; ++i) {
    const float x = 100 + 30 * static_cast<float>(i);
    places.push_back(placement.beside(i, {x, 200, x + 25, 225}, 220, 60));
    for (size_t j = 0; j < i; ++j) EXPECT_FALSE(intersect(places[i], places[j])) << i << " " << j;
  }
}

TEST(LabelPlacement, LabelsGiveWayToTheCorner) {
  LabelPlacement placement(640, 480, 1);
  const TileRect line = placement.corner_line(300, 40);
  const TileRect below = placement.corner_line(200, 40);
  EXPECT_EQ(line, (TileRect{8, 8, 300, 40}));
  EXPECT_EQ(below, (TileRect{8, 48, 200, 40}));
  const TileRect label = placement.beside(0, {20, 60, 60, 100}, 160, 50);
  EXPECT_FALSE(intersect(label, line));
  EXPECT_FALSE(intersect(label, below));
}

TEST(LabelPlacement, WithoutRoomItIsTheUsualPlace) {
  LabelPlacement placement(100, 60, 2);
  const TileRect first = placement.beside(0, {10, 35, 30, 50}, 100, 30);
  EXPECT_EQ(placement.beside(1, {10, 35, 30, 50}, 100, 30), first);
}

TEST(LabelPlacement, StaysInsideTheFrame) {
  LabelPlacement placement(200, 100, 6);
  for (size_t i = 0; i < 6; ++i) {
    const TileRect place = placement.near(i, 190, -5, 60, 20);
    EXPECT_GE(place.x, 0);
    EXPECT_GE(place.y, 0);
    EXPECT_LE(place.x + place.width, 200);
    EXPECT_LE(place.y + place.height, 100);
  }
}

TEST(LabelPlacement, DoesNotJumpToAndFro) {
  // The second object trembles by a pixel about the distance at which its usual place is free.
  LabelPlacement placement(640, 480, 2);
  int moves = 0;
  TileRect before{};
  for (int frame = 0; frame < 20; ++frame) {
    placement.begin();
    placement.beside(0, {100, 200, 140, 240}, 80, 30);
    const float x = 180 + 2 * static_cast<float>(frame % 2) - 1;
    const TileRect place = placement.beside(1, {x, 200, x + 40, 240}, 80, 30);
    if (frame > 0 && std::abs(place.y - before.y) > 2) ++moves;
    before = place;
  }
  EXPECT_LE(moves, 1);
}

/// Pixels of a gray image that the texts of the objects at these places change; an object without
/// a place is lost.
size_t text_pixels(const std::vector<std::optional<Rigid3>>& places) {
  const OverlayScene scene(640, 480);
  OverlayStyle style = only({"label", "status"});
  style.font_px = 40;
  std::vector<OverlayObject> objects;
  std::vector<PoseTrackPtr> tracks;
  for (size_t i = 0; i < places.size(); ++i) {
    objects.push_back({ObjectId(static_cast<uint32_t>(i)), "crate", scene.mesh, style});
    tracks.push_back(track_of({estimate_at(
        places[i].value_or(Rigid3()), places[i] ? TrackState::kTracking : TrackState::kLost)}));
  }
  const auto renderer =
      *CameraRenderer::create(scene.camera, CameraId(0), objects, scene.rays, nullptr, {});
  GrayImage image(640, 480, 128);
  std::vector<PoseAt> poses;
  renderer->draw(image.mutable_view(), time_from_ns(kCapture), tracks, poses);
  return differing_luma(image.view(), 128).size();
}

TEST(LabelPlacement, TextsOfAFrameAreAllSeen) {
  // What lies over something else changes fewer pixels than alone.
  const Rigid3 left = pose_at(-0.15, 0, 1.2), right = pose_at(0.05, 0, 1.2);
  EXPECT_EQ(text_pixels({left, right}), text_pixels({left}) + text_pixels({right}));
  const Rigid3 corner = pose_at(-0.45, -0.3, 1.2);
  EXPECT_EQ(text_pixels({corner, std::nullopt}),
            text_pixels({corner}) + text_pixels({std::nullopt}));
}

}  // namespace
}  // namespace sightline::render
