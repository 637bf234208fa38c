// SPDX-License-Identifier: Apache-2.0
// A program of its own: it replaces the global operator new to count what draw() allocates.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "overlay_scene.hpp"
#include "test_images.hpp"

namespace {

std::atomic<size_t> allocations{0};

void* counted(size_t size, size_t alignment) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  const size_t rounded = (size + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, rounded == 0 ? alignment : rounded);
  if (memory == nullptr) std::abort();
  return memory;
}

}  // namespace

// Not inlined: g++ would take the pair of aligned_alloc and free for a mismatch of new and delete.
#define COUNTED_MEMORY [[gnu::noinline]]
COUNTED_MEMORY void* operator new(size_t size) { return counted(size, alignof(std::max_align_t)); }
COUNTED_MEMORY void* operator new[](size_t size) {
  return counted(size, alignof(std::max_align_t));
}
COUNTED_MEMORY void* operator new(size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<size_t>(alignment));
}
COUNTED_MEMORY void* operator new[](size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<size_t>(alignment));
}
COUNTED_MEMORY void operator delete(void* memory) noexcept { std::free(memory); }
COUNTED_MEMORY void operator delete[](void* memory) noexcept { std::free(memory); }
COUNTED_MEMORY void operator delete(void* memory, size_t) noexcept { std::free(memory); }
COUNTED_MEMORY void operator delete[](void* memory, size_t) noexcept { std::free(memory); }
COUNTED_MEMORY void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
COUNTED_MEMORY void operator delete[](void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
COUNTED_MEMORY void operator delete(void* memory, size_t, std::align_val_t) noexcept {
  std::free(memory);
}
COUNTED_MEMORY void operator delete[](void* memory, size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace sightline {
namespace {

using namespace test;  // NOLINT: the tests' own helpers

TEST(CameraRenderer, AllocatesNothingOnceWarm) {
  OverlayScene scene;
  scene.build_wall({-0.5, 0, 0.5}, {1.0f, 2.0f, 0.02f});
  OverlayStyle style;
  for (const std::string_view name : style_names()) *style_flag(style, name) = true;
  style.shading = Shading::kSmooth;
  auto renderer = *scene.try_renderer(style);
  GrayImage image(320, 240, 128);
  std::vector<PoseTrackPtr> tracks;
  for (int k = 0; k < 40; ++k) {
    // Across the image and out of it, tracking, coasting, lost and back.
    const TrackState state = k % 10 == 9   ? TrackState::kLost
                             : k % 10 == 8 ? TrackState::kCoasting
                                           : TrackState::kTracking;
    std::vector<PoseEstimate> history;
    for (int back = 5; back > 0; --back) {
      history.push_back(estimate_at(pose_at(0.02 * k - 0.4, 0.001 * back, 0.8),
                                    TrackState::kTracking, kCapture - back * 20'000'000));
    }
    history.push_back(estimate_at(pose_at(0.02 * k - 0.4, 0, 0.8), state));
    tracks.push_back(track_of(history));
  }
  std::vector<PoseAt> poses;
  size_t last_round = 0;
  for (int round = 0; round < 3; ++round) {
    const size_t before = allocations.load();
    for (const PoseTrackPtr& track : tracks) {
      renderer->draw(image.mutable_view(), time_from_ns(kCapture), std::span(&track, 1), poses);
    }
    last_round = allocations.load() - before;
  }
  EXPECT_EQ(last_round, 0u);
}

}  // namespace
}  // namespace sightline
