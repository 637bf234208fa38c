// SPDX-License-Identifier: Apache-2.0
#include "workers/backoff.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

TEST(Backoff, GrowsToABoundWithJitterAndBeginsAnew) {
  Backoff backoff("left");
  Duration longest{0}, shortest_late = 10s;
  for (int i = 0; i < 200; ++i) {
    const Duration wait = backoff.next();
    if (i == 0) {
      EXPECT_LE(wait, 250ms);
    }
    EXPECT_GE(wait, 150ms);
    longest = std::max(longest, wait);
    if (i > 3) shortest_late = std::min(shortest_late, wait);
  }
  EXPECT_LE(longest, 1s);
  EXPECT_GE(shortest_late, 600ms);
  EXPECT_GT(longest - shortest_late, 200ms);  // the jitter
  backoff.reset();
  EXPECT_LE(backoff.next(), 250ms);
}

TEST(Backoff, CamerasThatWentTogetherDoNotComeBackTogether) {
  Backoff left("left"), right("right");
  int apart = 0;
  for (int i = 0; i < 20; ++i) apart += std::chrono::abs(left.next() - right.next()) > 5ms;
  EXPECT_GT(apart, 10);
}

}  // namespace
}  // namespace sightline
