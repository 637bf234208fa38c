// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/recycling_pool.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <thread>
#include <vector>

#include "sightline/base/latest_slot.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

struct Buffer {
  std::vector<int> values = std::vector<int>(64);
};
constexpr auto kMake = [] { return std::make_unique<Buffer>(); };

TEST(RecyclingPool, HandsOutWhatCameBack) {
  RecyclingPool<Buffer> pool(2);
  auto first = pool.get(kMake);
  first->values[0] = 7;
  const Buffer* const address = first.get();
  EXPECT_NE(pool.get(kMake).get(), address);
  auto copy = first;
  first.reset();
  const auto other = pool.get(kMake);
  EXPECT_NE(other.get(), address);  // still in use
  copy.reset();
  EXPECT_EQ(pool.get(kMake)->values[0], 7);
  EXPECT_EQ(pool.allocated(), 2u);
}

TEST(RecyclingPool, KeepsAtMostWhatWasAsked) {
  RecyclingPool<Buffer> pool(2);
  for (int round = 0; round < 2; ++round) {
    std::vector<std::shared_ptr<Buffer>> held;
    for (int i = 0; i < 5; ++i) held.push_back(pool.get(kMake));
  }
  EXPECT_EQ(pool.allocated(), 5u + 3u);
}

TEST(RecyclingPool, ObjectsOutliveIt) {
  std::optional<RecyclingPool<Buffer>> pool(std::in_place);
  auto buffer = pool->get(kMake);
  const std::weak_ptr<Buffer> weak = buffer;
  pool.reset();
  buffer->values[1] = 1;
  buffer.reset();
  EXPECT_TRUE(weak.expired());
}

// The thread sanitizer sees here whether reads come before the write that uses the buffer again.
TEST(RecyclingPool, LastReadsComeBeforeTheNextWrite) {
  constexpr int kRounds = 2000;
  RecyclingPool<Buffer> pool(4);
  LatestSlot<std::shared_ptr<const Buffer>> slot;
  std::thread reader([&] {
    for (int last = 0; last < kRounds;) {
      const auto buffer = slot.take({}, 1s);
      if (!buffer) continue;
      last = (*buffer)->values[0];
      for (const int value : (*buffer)->values) EXPECT_EQ(value, last);
    }
  });
  for (int round = 1; round <= kRounds; ++round) {
    const auto buffer = pool.get(kMake);
    for (int& value : buffer->values) value = round;
    slot.put(buffer);
  }
  reader.join();
  EXPECT_LE(pool.allocated(), 4u);
}

}  // namespace
}  // namespace sightline
