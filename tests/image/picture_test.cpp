// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/picture.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <thread>
#include <vector>

#include "support/allocations.hpp"

namespace sightline {
namespace {

TEST(Picture, PlanesAreAlignedAndOfTheRightSize) {
  for (const auto& [width, height] : {std::pair{640, 480}, {641, 3}, {1, 1}, {2, 7}}) {
    Picture picture(width, height);
    const MutableI420View view = picture.mutable_view();
    EXPECT_EQ(view.u.width, (width + 1) / 2);
    EXPECT_EQ(view.v.height, (height + 1) / 2);
    for (const MutablePlaneView& plane : {view.y, view.u, view.v}) {
      EXPECT_EQ(reinterpret_cast<uintptr_t>(plane.data) % 64, 0u);
      EXPECT_EQ(plane.stride % 64, 0);
      EXPECT_GE(plane.stride, plane.width);
      plane.row(plane.height - 1)[plane.width - 1] = 77;  // inside, says the sanitizer
    }
  }
}

TEST(Picture, StartsBlack) {
  const Picture picture(5, 5);
  EXPECT_EQ(picture.view().y.row(4)[4], 16);
  EXPECT_EQ(picture.view().u.row(2)[2], 128);
  EXPECT_EQ(picture.view().v.row(2)[2], 128);
}

TEST(PicturePool, RecyclesWithoutTouchingTheHeap) {
  PicturePool pool(64, 48);
  std::vector<std::shared_ptr<Picture>> held(4);
  for (auto& picture : held) picture = pool.get();
  auto half = pool.get_half();
  half.reset();
  held.assign(4, nullptr);
  const size_t warm = pool.allocated();
  const size_t before = test::allocations();
  for (int round = 0; round < 100; ++round) {
    for (auto& picture : held) picture = pool.get();
    half = pool.get_half();
    half.reset();
    for (auto& picture : held) picture.reset();
  }
  EXPECT_EQ(test::allocations(), before);
  EXPECT_EQ(pool.allocated(), warm);
  EXPECT_EQ(warm, 5u);
}

TEST(PicturePool, KeepsAtMostWhatWasAsked) {
  PicturePool pool(16, 16, 2);
  for (int round = 0; round < 2; ++round) {
    std::vector<std::shared_ptr<Picture>> held;
    for (int i = 0; i < 5; ++i) held.push_back(pool.get());
  }
  EXPECT_EQ(pool.allocated(), 5u + 3u);
}

TEST(PicturePool, PicturesOutliveIt) {
  std::optional<PicturePool> pool(std::in_place, 32, 32);
  std::shared_ptr<Picture> picture = pool->get(), half = pool->get_half();
  const std::weak_ptr<Picture> weak = picture;
  pool.reset();
  picture->mutable_view().y.row(31)[31] = 1;
  EXPECT_EQ(half->width(), 16);
  picture.reset();
  EXPECT_TRUE(weak.expired());
}

TEST(PicturePool, AnyThreadMayDropAPicture) {
  PicturePool pool(32, 32, 8);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&pool] {
      for (int k = 0; k < 500; ++k) {
        auto picture = pool.get();
        picture->mutable_view().y.data[0] = static_cast<uint8_t>(k);
        auto copy = picture;
        picture.reset();
        EXPECT_EQ(copy->view().y.data[0], static_cast<uint8_t>(k));
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_LE(pool.allocated(), 4u);
}

TEST(PictureDeathTest, RefusesAnImpossibleSize) {
  EXPECT_DEATH(Picture(0, 4), "picture size");
  EXPECT_DEATH(Picture(4, -1), "picture size");
}

}  // namespace
}  // namespace sightline
