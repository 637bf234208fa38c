// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/follow_sharing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "support/random.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

ObjectId object(int number) { return ObjectId(static_cast<uint32_t>(number)); }
Time at(double seconds) { return Time{} + from_seconds(100 + seconds); }

HeadShare own(int number) { return {object(number)}; }
HeadShare beside(int number) { return {object(number), true}; }

FollowBid bid(int number, int rank, double away = 0, bool within = true) {
  return {object(number), rank, away, within};
}

TEST(ShareObjects, EachHasAHeadOfItsOwn) {
  const auto shared = share_objects(std::vector<BiddingHead>{
      {{bid(0, 0, 0.1), bid(1, 1, 0.2)}, {}}, {{bid(0, 0, 0.3), bid(1, 1, 0.1)}, {}}});
  EXPECT_EQ(shared[0], own(0));
  EXPECT_EQ(shared[1], own(1));
}

TEST(ShareObjects, WhoAloneReachesAnObjectHasIt) {
  // Both reach the first, the first head alone reaches the second.
  const auto shared = share_objects(std::vector<BiddingHead>{
      {{bid(0, 0, 0.1), bid(1, 1, 0.2)}, {}}, {{bid(0, 0, 0.3), bid(1, 1, 0, false)}, {}}});
  EXPECT_EQ(shared[0], own(1));
  EXPECT_EQ(shared[1], own(0));
}

TEST(ShareObjects, WithFewerHeadsTheFirstOfTheListCounts) {
  const auto shared =
      share_objects(std::vector<BiddingHead>{{{bid(1, 1), bid(2, 2), bid(0, 0)}, own(2)}});
  EXPECT_EQ(shared[0], own(0));
}

TEST(ShareObjects, AHeadThatIsLeftOverFollowsTheFirstBesideAnother) {
  const auto shared = share_objects(
      std::vector<BiddingHead>{{{bid(3, 1), bid(0, 0)}, {}}, {{bid(0, 0)}, {}}, {{bid(0, 0)}, {}}});
  EXPECT_EQ(shared[0], own(3));
  EXPECT_EQ(shared[1], own(0));
  EXPECT_EQ(shared[2], beside(0));
}

TEST(ShareObjects, WhatNoRangeReachesIsFollowedToItsEnd) {
  const auto shared = share_objects(std::vector<BiddingHead>{
      {{bid(0, 0, 1, false), bid(1, 1)}, {}}, {{bid(0, 0, 1, false)}, {}}, {{}, {}}});
  EXPECT_EQ(shared[0], own(1));
  EXPECT_EQ(shared[1], own(0));
  EXPECT_FALSE(shared[2].has_value());
}

struct Case {
  std::vector<BiddingHead> heads;
  std::vector<int> order;  ///< objects, the most important first
};

// Every head has the same list, and reaches some of it.
Case random_case(test::Random& random) {
  Case out;
  const int objects = 1 + static_cast<int>(random.uniform(0, 5));
  for (int i = 0; i < objects; ++i) out.order.push_back(i);
  for (int i = objects - 1; i > 0; --i) {
    std::swap(out.order[static_cast<size_t>(i)],
              out.order[static_cast<size_t>(random.uniform(0, i + 1))]);
  }
  out.heads.resize(1 + static_cast<size_t>(random.uniform(0, 4)));
  for (BiddingHead& head : out.heads) {
    for (int rank = 0; rank < objects; ++rank) {
      if (random.uniform() < 0.5) continue;
      head.bids.push_back(bid(out.order[static_cast<size_t>(rank)], rank, random.uniform()));
    }
    if (random.uniform() < 0.7) head.had = own(static_cast<int>(random.uniform(0, objects)));
  }
  return out;
}

bool bids_for(const BiddingHead& head, int number) {
  return std::ranges::find(head.bids, object(number), &FollowBid::object) != head.bids.end();
}

// Whether heads from `first` on can have all of `wanted`, each its own. Tries everything.
bool can_have(const Case& one, size_t first, std::set<int> wanted) {
  if (wanted.empty()) return true;
  if (first == one.heads.size()) return false;
  if (can_have(one, first + 1, wanted)) return true;
  for (const int number : std::set<int>(wanted)) {
    if (!bids_for(one.heads[first], number)) continue;
    wanted.erase(number);
    if (can_have(one, first + 1, wanted)) return true;
    wanted.insert(number);
  }
  return false;
}

std::set<int> followed(const std::vector<std::optional<HeadShare>>& shared) {
  std::set<int> out;
  for (const auto& one : shared) {
    if (one) out.insert(static_cast<int>(one->object.index()));
  }
  return out;
}

// The law: the set that has heads is the best by importance, one by one, that any assignment gives
// (which is one of the largest, too); nobody is without an object who reaches one; and who is
// asked again changes nothing.
TEST(ShareObjects, TheMostImportantThatCanHaveHeadsHaveThemAndKeepThem) {
  test::Random random(21);
  int shared_by_two = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    Case one = random_case(random);
    const auto shared = share_objects(one.heads);
    std::set<int> best;
    for (const int number : one.order) {
      std::set<int> more = best;
      more.insert(number);
      if (can_have(one, 0, more)) best = more;
    }
    ASSERT_EQ(followed(shared), best) << trial;
    for (size_t i = 0; i < shared.size(); ++i) {
      ASSERT_EQ(shared[i].has_value(), !one.heads[i].bids.empty());
      EXPECT_TRUE(!shared[i] ||
                  bids_for(one.heads[i], static_cast<int>(shared[i]->object.index())));
      one.heads[i].had = shared[i];
      for (FollowBid& again : one.heads[i].bids) again.away = random.uniform();
    }
    shared_by_two += best.size() < shared.size() ? 1 : 0;
    ASSERT_EQ(share_objects(one.heads), shared) << trial;
  }
  EXPECT_GT(shared_by_two, 100);
}

TEST(FollowSharing, AnObjectThatIsLostForAMomentKeepsItsHead) {
  FollowSharing sharing;
  const std::vector<FollowBid> both = {bid(0, 0, 0.1), bid(1, 1, 0.2)}, other = {bid(1, 1, 0.2)};
  EXPECT_EQ(sharing.choose(4, at(0), both), object(0));
  EXPECT_EQ(sharing.choose(4, at(0.3), other), std::nullopt);
  EXPECT_EQ(sharing.choose(4, at(0.4), both), object(0));
  EXPECT_EQ(sharing.choose(4, at(0.8), other), std::nullopt);
  EXPECT_EQ(sharing.choose(4, at(0.95), other), object(1));  // for good
}

TEST(FollowSharing, HeadsShareAndAGoneOneLeavesItsObject) {
  FollowSharing sharing;
  const std::vector<FollowBid> both = {bid(0, 0, 0.1), bid(1, 1, 0.2)};
  EXPECT_EQ(sharing.choose(0, at(0), both), object(0));
  EXPECT_EQ(sharing.choose(1, at(0), both), object(1));
  for (double t = 0.05; t < 1; t += 0.05) {
    EXPECT_EQ(sharing.choose(0, at(t), both), object(0));
    EXPECT_EQ(sharing.choose(1, at(t), both), object(1));
  }
  sharing.leave(0);
  EXPECT_EQ(sharing.choose(1, at(1), both), object(0));
  EXPECT_EQ(sharing.choose(0, at(1), both), object(1));    // it comes back, and takes what is free
  EXPECT_EQ(sharing.choose(1, at(1.8), both), object(0));  // the other is not heard of any more
}

}  // namespace
}  // namespace sightline
