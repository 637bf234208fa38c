// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/snapshot.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace sightline {
namespace {

TEST(Snapshot, HandsTheNewestOver) {
  Snapshot<const int> snapshot;
  EXPECT_EQ(snapshot.read(), nullptr);
  const auto first = std::make_shared<const int>(1), second = std::make_shared<const int>(2);
  snapshot.publish(first);
  EXPECT_EQ(snapshot.read(), first);
  snapshot.publish(second);
  EXPECT_EQ(snapshot.read(), second);
  EXPECT_EQ(first.use_count(), 1);
  snapshot.publish(nullptr);
  EXPECT_EQ(snapshot.read(), nullptr);
}

TEST(Snapshot, MayBeReadWhileItIsPublished) {
  Snapshot<const int> snapshot;
  constexpr int kVersions = 2000;
  std::thread writer([&] {
    for (int i = 1; i <= kVersions; ++i) snapshot.publish(std::make_shared<const int>(i));
  });
  int newest = 0;
  while (newest < kVersions) {
    const auto value = snapshot.read();
    if (!value) continue;
    EXPECT_GE(*value, newest);
    newest = *value;
  }
  writer.join();
}

}  // namespace
}  // namespace sightline
