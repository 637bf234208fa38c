// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/image.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <thread>
#include <vector>

#include "support/allocations.hpp"

namespace sightline {
namespace {

TEST(Image, PlanesAreAlignedAndOfTheRightSize) {
  for (const auto& [width, height] : {std::pair{640, 480}, {641, 3}, {1, 1}, {2, 7}}) {
    Image image(width, height);
    const MutableI420View view = image.mutable_view();
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

TEST(Image, StartsBlack) {
  const Image image(5, 5);
  EXPECT_EQ(image.view().y.row(4)[4], 16);
  EXPECT_EQ(image.view().u.row(2)[2], 128);
  EXPECT_EQ(image.view().v.row(2)[2], 128);
}

TEST(ImagePool, RecyclesWithoutTouchingTheHeap) {
  ImagePool pool(64, 48);
  std::vector<std::shared_ptr<Image>> held(4);
  for (auto& image : held) image = pool.get();
  auto half = pool.get_half();
  half.reset();
  held.assign(4, nullptr);
  const size_t warm = pool.allocated();
  const size_t before = test::allocations();
  for (int round = 0; round < 100; ++round) {
    for (auto& image : held) image = pool.get();
    half = pool.get_half();
    half.reset();
    for (auto& image : held) image.reset();
  }
  EXPECT_EQ(test::allocations(), before);
  EXPECT_EQ(pool.allocated(), warm);
  EXPECT_EQ(warm, 5u);
}

TEST(ImagePool, KeepsAtMostWhatWasAsked) {
  ImagePool pool(16, 16, 2);
  for (int round = 0; round < 2; ++round) {
    std::vector<std::shared_ptr<Image>> held;
    for (int i = 0; i < 5; ++i) held.push_back(pool.get());
  }
  EXPECT_EQ(pool.allocated(), 5u + 3u);
}

TEST(ImagePool, ImagesOutliveIt) {
  std::optional<ImagePool> pool(std::in_place, 32, 32);
  std::shared_ptr<Image> image = pool->get(), half = pool->get_half();
  const std::weak_ptr<Image> weak = image;
  pool.reset();
  image->mutable_view().y.row(31)[31] = 1;
  EXPECT_EQ(half->width(), 16);
  image.reset();
  EXPECT_TRUE(weak.expired());
}

TEST(ImagePool, AnyThreadMayDropAnImage) {
  ImagePool pool(32, 32, 8);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&pool] {
      for (int k = 0; k < 500; ++k) {
        auto image = pool.get();
        image->mutable_view().y.data[0] = static_cast<uint8_t>(k);
        auto copy = image;
        image.reset();
        EXPECT_EQ(copy->view().y.data[0], static_cast<uint8_t>(k));
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_LE(pool.allocated(), 4u);
}

TEST(ImageDeathTest, RefusesAnImpossibleSize) {
  EXPECT_DEATH(Image(0, 4), "image size");
  EXPECT_DEATH(Image(4, -1), "image size");
}

}  // namespace
}  // namespace sightline
