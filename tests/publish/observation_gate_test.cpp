// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/observation_gate.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr int64_t kNow = 1'700'000'000'000'000'000;

class Gate : public testing::Test {
 protected:
  CellVerdict check(const CellObservation& o, int64_t now = kNow) {
    return gate_.check(o, now, true, 2ms).verdict;
  }
  CellObservation next() {
    CellObservation o;
    o.object = "carton";
    o.camera = "left";
    o.host = "hall-2";
    o.boot = 11;
    o.calibration = 5;
    o.sequence = ++sequence_;
    o.capture_utc_ns = kNow - 20'000'000;
    return o;
  }
  uint64_t sequence_ = 0;
  ObservationGate gate_{{{CameraId(4), {"left", "hall-2", 5}}}, {"cup", "carton"}, 250ms};
};

TEST_F(Gate, TakesWhatIsNew) {
  const auto pass = gate_.check(next(), kNow, true, 2ms);
  EXPECT_EQ(pass.verdict, CellVerdict::kTaken);
  EXPECT_EQ(pass.camera, CameraId(4));
  EXPECT_EQ(pass.object, ObjectId(1));
  EXPECT_EQ(check(next()), CellVerdict::kTaken);
}

// Names of hosts are a cell's own: a neighbor's boots say nothing of this one's.
TEST_F(Gate, ABorderCameraIsItsCells) {
  ObservationGate gate(
      {{CameraId(4), {"left", "hall-2", 5}}, {CameraId(5), {"side", "hall-2", 5, "site/b"}}},
      {"carton"}, 250ms);
  CellObservation border = next();
  border.camera = "side";
  border.boot = 12;
  EXPECT_EQ(gate.check(border, kNow, true, 2ms).verdict, CellVerdict::kForeign);
  EXPECT_EQ(gate.check(border, kNow, true, 2ms, "site/c").verdict, CellVerdict::kForeign);
  const auto pass = gate.check(border, kNow, true, 2ms, "site/b");
  EXPECT_EQ(pass.verdict, CellVerdict::kTaken);
  EXPECT_EQ(pass.camera, CameraId(5));
  EXPECT_EQ(gate.check(next(), kNow, true, 2ms, "site/b").verdict, CellVerdict::kForeign);
  EXPECT_EQ(gate.check(next(), kNow, true, 2ms).verdict, CellVerdict::kTaken);
  border.sequence += 10;
  EXPECT_EQ(gate.check(border, kNow, true, 2ms, "site/b").verdict, CellVerdict::kTaken);
}

TEST_F(Gate, OldOnesAndOnesFromTheFutureStayOutside) {
  EXPECT_EQ(check(next(), kNow + 240'000'000), CellVerdict::kLate);
  EXPECT_EQ(check(next(), kNow - 21'000'000), CellVerdict::kTaken);  // within the clocks' bounds
  EXPECT_EQ(check(next(), kNow - 30'000'000), CellVerdict::kFuture);
}

// A host that calls its times uncertain has no more of the future than others.
TEST_F(Gate, UncertainTimesAreNoExcuse) {
  CellObservation o = next();
  o.capture_error = 10s;
  EXPECT_EQ(check(o, kNow - 30'000'000), CellVerdict::kFuture);
}

TEST_F(Gate, AClockThatIsNotFitTakesNothing) {
  const CellObservation o = next();
  EXPECT_EQ(gate_.check(o, kNow, false, 2ms).verdict, CellVerdict::kClock);
  EXPECT_EQ(check(o), CellVerdict::kTaken) << "it was not counted as taken before";
}

TEST_F(Gate, EachCountsOnceAndInOrder) {
  const CellObservation first = next(), second = next();
  EXPECT_EQ(check(second), CellVerdict::kTaken);
  EXPECT_EQ(check(second), CellVerdict::kDuplicate);
  EXPECT_EQ(check(first), CellVerdict::kDuplicate);
}

TEST_F(Gate, AStartBeginsAnewAndTheOneBeforeIsOver) {
  const CellObservation before = next();
  EXPECT_EQ(check(before), CellVerdict::kTaken);
  CellObservation after = next(), straggler = next();
  after.boot = 12;
  after.sequence = 1;
  EXPECT_EQ(check(after), CellVerdict::kTaken);
  EXPECT_EQ(check(straggler), CellVerdict::kOldBoot);
}

// A replay of long ago must not pass for a start, nor end the boot that runs.
TEST_F(Gate, AnOldReplayChangesNothing) {
  CellObservation old = next();
  old.boot = 3;
  old.capture_utc_ns -= 60'000'000'000;
  EXPECT_EQ(check(next()), CellVerdict::kTaken);
  EXPECT_EQ(check(old), CellVerdict::kLate);
  EXPECT_EQ(check(next()), CellVerdict::kTaken);
}

TEST_F(Gate, ForeignOnesAndOtherCalibrations) {
  for (auto change : {+[](CellObservation& o) { o.camera = "right"; },
                      +[](CellObservation& o) { o.object = "valve"; },
                      +[](CellObservation& o) { o.host = "hall-3"; }}) {
    CellObservation o = next();
    change(o);
    EXPECT_EQ(check(o), CellVerdict::kForeign);
  }
  CellObservation o = next();
  o.calibration = 6;
  EXPECT_EQ(check(o), CellVerdict::kOtherCalibration);
}

}  // namespace
}  // namespace sightline
