// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "sightline/publish/cell/cell_order.hpp"

namespace sightline {
namespace {

constexpr int64_t kNow = 1'700'000'000'000'000'000, kSecond = 1'000'000'000;

CellOrder order(uint64_t boot, uint64_t sequence, int64_t time = kNow) {
  CellOrder order;
  order.kind = CellOrder::Kind::kForget;
  order.object = std::string("carton");
  order.host = std::string("a");
  order.boot = boot;
  order.sequence = sequence;
  order.time_utc_ns = time;
  return order;
}

TEST(OrderGate, EachOrderPassesOnce) {
  OrderGate gate;
  EXPECT_EQ(gate.check(order(3, 1), kNow), CellVerdict::kTaken);
  EXPECT_EQ(gate.check(order(3, 1), kNow), CellVerdict::kDuplicate);
  EXPECT_EQ(gate.check(order(3, 2), kNow), CellVerdict::kTaken);
  CellOrder other = order(9, 1);
  other.host = std::string("b");
  EXPECT_EQ(gate.check(other, kNow), CellVerdict::kTaken);
}

TEST(OrderGate, OldOnesAndOnesOfAnEarlierStartStayOutside) {
  OrderGate gate;
  EXPECT_EQ(gate.check(order(3, 1, kNow - 6 * kSecond), kNow), CellVerdict::kLate);
  EXPECT_EQ(gate.check(order(3, 1, kNow + 6 * kSecond), kNow), CellVerdict::kFuture);
  EXPECT_EQ(gate.check(order(3, 1, kNow - 4 * kSecond), kNow), CellVerdict::kTaken);
  EXPECT_EQ(gate.check(order(4, 1), kNow), CellVerdict::kTaken);
  EXPECT_EQ(gate.check(order(3, 2), kNow), CellVerdict::kOldBoot);
}

TEST(OrderWire, ComesBackAsItWent) {
  CellOrder hint = order(3, 1);
  hint.kind = CellOrder::Kind::kHintImage;
  hint.camera = std::string("left");
  hint.pixel = {-0.5, 20.25};
  hint.radius_px = 40;
  auto back = decode_order(encode(hint));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->camera, "left");
  EXPECT_EQ(back->pixel, hint.pixel);
  EXPECT_EQ(back->radius_px, 40);
  EXPECT_EQ(back->object, "carton");
  CellOrder record = order(3, 2);
  record.kind = CellOrder::Kind::kRecord;
  record.recordings = {"source", "poses"};
  record.seconds = 2.5;
  back = decode_order(encode(record));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->recordings, record.recordings);
  EXPECT_EQ(back->seconds, 2.5);
  CellOrder pose = order(3, 3);
  pose.kind = CellOrder::Kind::kHintPose;
  pose.world_from_object.translation = {1, 2, 3};
  back = decode_order(encode(pose));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->world_from_object.translation, pose.world_from_object.translation);
}

TEST(OrderWire, WhatIsNotCompleteIsRefused) {
  const auto refused = [](auto change) {
    CellOrder bad = order(3, 1);
    bad.kind = CellOrder::Kind::kHintImage;
    bad.camera = std::string("left");
    change(bad);
    return !decode_order(encode(bad));
  };
  EXPECT_FALSE(refused([](CellOrder&) {}));
  EXPECT_TRUE(refused([](CellOrder& o) { o.host = std::string("no host"); }));
  EXPECT_TRUE(refused([](CellOrder& o) { o.object.clear(); }));
  EXPECT_TRUE(refused([](CellOrder& o) { o.camera = std::string("../left"); }));
  EXPECT_TRUE(refused([](CellOrder& o) { o.pixel.x() = std::nan(""); }));
  EXPECT_TRUE(refused([](CellOrder& o) { o.radius_px = -1; }));
  EXPECT_TRUE(refused([](CellOrder& o) { o.time_utc_ns = 0; }));
  EXPECT_TRUE(refused([](CellOrder& o) { o.kind = static_cast<CellOrder::Kind>(8); }));
  EXPECT_TRUE(refused([](CellOrder& o) {
    o.kind = CellOrder::Kind::kMark;
    o.text = std::string("\xff");
  }));
  CellTrack track;
  EXPECT_FALSE(decode_order(encode(track)));
}

}  // namespace
}  // namespace sightline
