// SPDX-License-Identifier: Apache-2.0
#include "cell/fusion_claim.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

CellHostState said_by(const char* host, uint64_t boot, int64_t since, bool online = true) {
  CellHostState state;
  state.host = host;
  state.boot = boot;
  state.since_utc_ns = since;
  state.online = online;
  return state;
}

CellHostState again(CellHostState claim, uint64_t beat) {
  claim.beat = beat;
  return claim;
}

constexpr Time kBegin = Time(100s);
constexpr Time kSettled = kBegin + FusionClaim::kListen;

TEST(FusionClaim, ListensBeforeItSpeaks) {
  FusionClaim claim({"f", 1, 50});
  EXPECT_FALSE(claim.step(kBegin + 10s)) << "not connected yet";
  claim.connected(kBegin);
  EXPECT_FALSE(claim.step(kBegin));
  EXPECT_FALSE(claim.holds());
  EXPECT_TRUE(claim.step(kSettled));
  EXPECT_TRUE(claim.holds());
  EXPECT_FALSE(claim.step(kSettled)) << "said once";
}

TEST(FusionClaim, WhoWasThereFirstGoesOn) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  claim.hear(said_by("g", 2, 40), kSettled);
  EXPECT_FALSE(claim.step(kSettled));
  EXPECT_FALSE(claim.holds());
  EXPECT_EQ(claim.other(), "g");
  claim.hear(said_by("g", 2, 40, false), kSettled);
  EXPECT_TRUE(claim.step(kSettled)) << "its place is free";
  EXPECT_TRUE(claim.holds());
  EXPECT_EQ(claim.other(), "");
}

TEST(FusionClaim, SaysItAgainToWhoCameLater) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  EXPECT_TRUE(claim.step(kSettled));
  claim.hear(said_by("g", 2, 60), kSettled);
  EXPECT_TRUE(claim.step(kSettled));
  EXPECT_TRUE(claim.holds());
}

TEST(FusionClaim, YieldsToOneThatWasThereBefore) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  claim.step(kSettled);
  claim.hear(said_by("g", 2, 40), kSettled);
  EXPECT_FALSE(claim.step(kSettled));
  EXPECT_FALSE(claim.holds());
}

TEST(FusionClaim, TwoThatStartAtOnceAgree) {
  FusionClaim one({"f", 1, 50}), two({"g", 2, 50});
  for (FusionClaim* claim : {&one, &two}) claim->connected(kBegin);
  EXPECT_TRUE(one.step(kSettled));
  EXPECT_TRUE(two.step(kSettled));
  one.hear(said_by("g", 2, 50), kSettled);
  two.hear(said_by("f", 1, 50), kSettled);
  one.step(kSettled);
  two.step(kSettled);
  EXPECT_TRUE(one.holds());
  EXPECT_FALSE(two.holds());
}

TEST(FusionClaim, ItsOwnLastWillAndFarewellsOfOthersAreTakenBack) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  EXPECT_TRUE(claim.step(kSettled));
  claim.hear(said_by("f", 1, 50, false), kSettled);  // the broker took it for dead
  EXPECT_TRUE(claim.step(kSettled));
  claim.hear(said_by("g", 9, 60, false), kSettled);  // retained now in the place of ours
  EXPECT_TRUE(claim.step(kSettled));
  claim.hear(said_by("f", 1, 50), kSettled);
  EXPECT_FALSE(claim.step(kSettled)) << "what it says itself is no news";
  claim.connected(kBegin + 60s);
  EXPECT_TRUE(claim.step(kBegin + 61s)) << "a new broker knows of nothing";
}

// A broker that keeps retained messages keeps those of the dead.
TEST(FusionClaim, WhatThisHostSaidBeforeItDiedIsIgnored) {
  FusionClaim claim({"f", 2, 50});
  claim.connected(kBegin);
  claim.hear(again(said_by("f", 1, 40), 77), kBegin);
  EXPECT_TRUE(claim.step(kSettled));
  EXPECT_TRUE(claim.holds());
}

TEST(FusionClaim, AnotherDaemonOfTheSameNameIsKnownByGoingOn) {
  FusionClaim claim({"f", 2, 50});
  claim.connected(kBegin);
  claim.hear(again(said_by("f", 1, 40), 77), kBegin);
  claim.hear(again(said_by("f", 1, 40), 78), kSettled);
  EXPECT_FALSE(claim.step(kSettled));
  EXPECT_FALSE(claim.holds());
}

TEST(FusionClaim, SaysItAgainAboutOnceASecond) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  EXPECT_TRUE(claim.step(kSettled));
  EXPECT_FALSE(claim.step(kSettled + 900ms));
  EXPECT_TRUE(claim.step(kSettled + 1s));
}

TEST(FusionClaim, AClaimThatIsNotRepeatedLapses) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  const CellHostState other = said_by("g", 2, 40);
  claim.hear(again(other, 1), kSettled);
  claim.hear(again(other, 2), kSettled + 4s);
  EXPECT_FALSE(claim.step(kSettled + 8s));
  claim.hear(again(other, 2), kSettled + 8s);  // the broker says it again, not the host
  EXPECT_FALSE(claim.step(kSettled + 9s));
  EXPECT_TRUE(claim.step(kSettled + 9s + 1ms));
  EXPECT_TRUE(claim.holds());
}

TEST(FusionClaim, ABrokerThatKnowsNothingFreesThePlace) {
  FusionClaim claim({"f", 1, 50});
  claim.connected(kBegin);
  claim.hear(said_by("g", 2, 40), kSettled);
  EXPECT_FALSE(claim.step(kSettled));
  claim.connected(kSettled + 1s);
  EXPECT_TRUE(claim.step(kSettled + 1s + FusionClaim::kListen));
}

}  // namespace
}  // namespace sightline
