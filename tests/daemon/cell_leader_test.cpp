// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_leader.hpp"

#include <gtest/gtest.h>

#include "cell/fusion_claim.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using News = CellLeader::News;

constexpr Time kBegin = Time(100s);

CellHostState claim(const char* host, uint64_t boot, uint64_t beat, bool online = true) {
  CellHostState state;
  state.host = host;
  state.boot = boot;
  state.beat = beat;
  state.online = online;
  return state;
}

TEST(CellLeader, IsWhoSaysItUntilItsLastWill) {
  CellLeader leader("");
  EXPECT_EQ(leader.host(), "");
  EXPECT_EQ(leader.hear(claim("f", 5, 1), kBegin), News::kAnother);
  EXPECT_EQ(leader.hear(claim("f", 5, 2), kBegin + 1s), News::kNone);
  EXPECT_TRUE(leader.is(5));
  EXPECT_EQ(leader.hear(claim("f", 4, 0, false), kBegin + 1s), News::kNone)
      << "an earlier daemon's";
  EXPECT_EQ(leader.hear(claim("f", 5, 0, false), kBegin + 1s), News::kGone);
  EXPECT_FALSE(leader.is(5));
}

TEST(CellLeader, AnotherDaemonIsAnotherOne) {
  CellLeader leader("site/b");
  leader.hear(claim("f", 5, 1), kBegin);
  EXPECT_EQ(leader.hear(claim("f", 6, 1), kBegin), News::kAnother);
  EXPECT_FALSE(leader.is(5));
  EXPECT_EQ(leader.hear(claim("g", 7, 1), kBegin), News::kAnother);
  EXPECT_EQ(leader.host(), "g");
}

// Brokers keep what the dead have said.
TEST(CellLeader, IsNotBelievedWhoSaysNothingNew) {
  CellLeader leader("");
  leader.hear(claim("f", 5, 1), kBegin);
  for (Duration passed = 1s; passed <= FusionClaim::kLapse; passed += 1s) {
    leader.hear(claim("f", 5, 1), kBegin + passed);
    EXPECT_EQ(leader.advance(kBegin + passed), News::kNone);
  }
  EXPECT_EQ(leader.advance(kBegin + FusionClaim::kLapse + 1ms), News::kGone);
  EXPECT_EQ(leader.advance(kBegin + FusionClaim::kLapse + 2ms), News::kNone);
  EXPECT_EQ(leader.host(), "");
}

}  // namespace
}  // namespace sightline
