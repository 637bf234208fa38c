// SPDX-License-Identifier: Apache-2.0
// Whether a thread is stuck in code of ours, or waits for a device or a disk.
#include "heartbeat.hpp"

#include <gtest/gtest.h>

#include <latch>

#include "system/wait_report.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLimit = 5s;

/// A thread that waits for the disk from begin() on until it is let go.
class DiskReader {
 public:
  explicit DiskReader(HeartbeatBoard& beats)
      : thread(beats, "reader", kLimit, [this](std::stop_token, Heartbeat&) {
          {
            const Waiting wait("the disk");
            const Waiting inner("something in it");
            waiting_.count_down();
            go_on_.wait();
          }
          works_.count_down();
          end_.wait();
        }) {}
  ~DiskReader() {
    if (!gone_on_) go_on();
    if (!ended_) end();
    if (thread.joinable()) thread.join();  // before what it uses
  }
  void begin() const { waiting_.wait(); }
  void go_on() {
    gone_on_ = true;
    go_on_.count_down();
    works_.wait();
  }
  void end() {
    ended_ = true;
    end_.count_down();
  }

 private:
  bool gone_on_ = false, ended_ = false;
  mutable std::latch waiting_{1};
  std::latch go_on_{1}, works_{1}, end_{1};

 public:
  WatchedThread thread;
};

TEST(Heartbeat, OneThatWaitsForTheDiskIsNotStalledHoweverLongItTakes) {
  HeartbeatBoard beats;
  DiskReader reader(beats);
  reader.begin();
  const Time later = MonotonicClock::now() + 24h;
  EXPECT_TRUE(beats.stalled(later).empty());
  const auto waits = beats.waits(later, 1h);
  ASSERT_EQ(waits.size(), 1u);
  EXPECT_EQ(waits[0].thread, "reader");
  EXPECT_EQ(waits[0].what, "the disk");
  EXPECT_TRUE(beats.waits(waits[0].since + 1s, 2s).empty()) << "too short to be told";
}

TEST(Heartbeat, AfterItsWaitItHasTheWholeLimitAndNoMore) {
  HeartbeatBoard beats;
  DiskReader reader(beats);
  reader.begin();
  const Time before = MonotonicClock::now();
  reader.go_on();
  EXPECT_TRUE(beats.stalled(before + kLimit).empty()) << "the end of a wait is progress";
  EXPECT_EQ(beats.stalled(MonotonicClock::now() + kLimit + 1s), std::vector<std::string>{"reader"});
  EXPECT_TRUE(beats.waits(MonotonicClock::now() + 24h, 0s).empty());
}

TEST(WatchedThread, OneThatWaitsIsLeftAndOneThatWorksIsWaitedFor) {
  HeartbeatBoard beats;
  DiskReader reader(beats);
  reader.begin();
  EXPECT_FALSE(reader.thread.join_unless_waiting(10ms));
  EXPECT_TRUE(reader.thread.joinable());
  reader.go_on();
  const std::jthread ender([&] { reader.end(); });
  EXPECT_TRUE(reader.thread.join_unless_waiting(10ms));
}

TEST(WatchedThread, OneThatEndsByAnExceptionIsJoinedAndSilent) {
  HeartbeatBoard beats;
  WatchedThread thread(beats, "thrower", kLimit, [](std::stop_token, Heartbeat&) {
    const Waiting wait("the disk");
    throw std::runtime_error("as told");
  });
  EXPECT_TRUE(thread.join_unless_waiting(10ms));
  EXPECT_EQ(beats.stalled(MonotonicClock::now() + 1h), std::vector<std::string>{"thrower"});
}

TEST(WaitReport, TellsAWaitWhileItLastsAndItsEnd) {
  Registry registry;
  WaitReport report(registry);
  const Time since = MonotonicClock::now();
  const auto seconds = [&] {
    return registry
        .gauge("sightline_waiting_seconds", "", {{"thread", "record"}, {"for", "the disk"}})
        .value();
  };
  report.tell({{"record", "the disk", since}}, since + 3s);
  EXPECT_DOUBLE_EQ(seconds(), 3);
  report.tell({{"record", "the disk", since}}, since + 7s);
  EXPECT_DOUBLE_EQ(seconds(), 7);
  report.tell({{"record", "the disk", since + 8s}}, since + 10s);  // another
  EXPECT_DOUBLE_EQ(seconds(), 2);
  report.tell({}, since + 11s);
  EXPECT_DOUBLE_EQ(seconds(), 0);
}

}  // namespace
}  // namespace sightline
