// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/hand_over.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <map>
#include <random>

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Duration kFrame = 10ms;

EstimateWorth tracking(double sigma) { return {TrackState::kTracking, sigma}; }
EstimateWorth nothing() { return {TrackState::kSearching, 0}; }

/// Two cells and a network between them, in steps of a frame that both see.
struct TwoCells {
  static constexpr size_t kNobody = 2;  // or both
  std::array<HandOver, 2> cells{HandOver("a"), HandOver("b")};
  std::array<bool, 2> alive{true, true};
  std::function<EstimateWorth(size_t cell, Time)> worth = [](size_t, Time) {
    return tracking(0.001);
  };
  /// Of a message that a cell sends; nullopt: it is lost.
  std::function<std::optional<Duration>(size_t cell)> delay = [](size_t) { return Duration(2ms); };

  Time now = Time(1000s);
  std::map<Time, std::vector<size_t>> published;  ///< by capture time: who
  int changes = 0;

  void run(Duration span) {
    for (const Time end = now + span; now < end; now += kFrame) {
      deliver();
      for (size_t cell = 0; cell < 2; ++cell) {
        if (alive[cell]) act(cell);
      }
    }
  }
  size_t holder() const {
    const bool a = cells[0].own().holds, b = cells[1].own().holds;
    return a == b ? kNobody : b ? 1 : 0;
  }
  size_t missing(Time from, Time to) const {
    size_t count = 0;
    for (Time t = from; t < to; t += kFrame) count += published.contains(t) ? 0 : 1;
    return count;
  }
  size_t twice() const {
    return static_cast<size_t>(
        std::ranges::count_if(published, [](const auto& at) { return at.second.size() > 1; }));
  }

 private:
  struct Message {
    Time due;
    size_t to;
    std::function<void(HandOver&, Time)> say;
  };
  std::deque<Message> network_;
  std::array<Time, 2> next_{};
  std::array<bool, 2> held_{};
  std::array<std::deque<Time>, 2> history_;  // frames that a cell has an estimate of, not published

  static std::string name(size_t cell) { return cell == 0 ? "a" : "b"; }

  void send(size_t from, std::function<void(HandOver&, Time)> say) {
    if (const auto late = delay(from)) network_.push_back({now + *late, 1 - from, std::move(say)});
  }
  void deliver() {
    std::ranges::stable_sort(network_, {}, &Message::due);
    while (!network_.empty() && network_.front().due <= now) {
      const Message message = network_.front();
      network_.pop_front();
      if (alive[message.to]) message.say(cells[message.to], now);
    }
  }
  void act(size_t cell) {
    HandOver& own = cells[cell];
    const EstimateWorth has = worth(cell, now);
    const bool news =
        own.step(has, now, static_cast<uint64_t>((now + 1000h).time_since_epoch().count()));
    changes += own.own().holds && !held_[cell] ? 1 : 0;
    held_[cell] = own.own().holds;
    if (news || now >= next_[cell]) {
      next_[cell] = now + HandOver::kSayEvery;
      send(cell, [from = name(cell), said = own.own()](HandOver& to, Time at) {
        to.hear(from, said, at);
      });
    }
    if (has_pose(has.state)) history_[cell].push_back(now);
    while (history_[cell].size() > 100) history_[cell].pop_front();  // as long as a track
    std::erase_if(history_[cell], [&](Time capture) {
      if (!own.publishes(capture)) return false;
      published[capture].push_back(cell);
      send(cell, [from = name(cell), capture](HandOver& to, Time at) {
        to.hear_estimate(from, capture, at);
      });
      return true;
    });
  }
};

TEST(HandOver, OneOfTwoThatBeginAtOnce) {
  TwoCells two;
  two.run(2s);
  EXPECT_NE(two.holder(), TwoCells::kNobody);
  EXPECT_EQ(two.twice(), 0U);
  EXPECT_EQ(two.missing(two.now - 1s, two.now), 0U);
  EXPECT_EQ(two.cells.at(0).holder(), two.cells.at(1).holder());
}

TEST(HandOver, AnObjectThatCrossesIsPublishedOnceAndAlways) {
  for (const Duration latency : {0ms, 2ms, 30ms, 100ms}) {
    TwoCells two;
    two.delay = [latency](size_t) { return latency; };
    const Time begin = two.now;
    // Back and forth: a alone, both, b alone.
    two.worth = [begin](size_t cell, Time now) {
      const double place = std::sin(to_seconds(now - begin));
      const double distance = cell == 0 ? place + 1 : 1 - place;
      return distance > 1.7 ? nothing() : tracking(0.001 * std::exp(2 * distance));
    };
    two.run(30s);
    EXPECT_EQ(two.twice(), 0U) << latency.count();
    EXPECT_EQ(two.missing(begin + 1s, two.now - 1s), 0U) << latency.count();
    EXPECT_NEAR(two.changes, 10, 2) << latency.count();
  }
}

TEST(HandOver, NoiseDoesNotSendItToAndFro) {
  TwoCells two;
  std::mt19937 chance(5);
  std::lognormal_distribution<double> sigma(std::log(0.002), 0.3);
  two.worth = [&](size_t, Time) { return tracking(sigma(chance)); };
  two.run(1s);  // two that begin at once, one of which yields
  const int before = two.changes;
  two.run(60s);
  EXPECT_EQ(two.changes, before);
}

TEST(HandOver, IsGivenAtOnceToWhoSeesItAlone) {
  TwoCells two;
  two.run(1s);
  const size_t first = two.holder();
  ASSERT_NE(first, TwoCells::kNobody);
  const Time hidden = two.now;
  two.worth = [&](size_t cell, Time) {
    return cell == first ? EstimateWorth{TrackState::kCoasting, 0.02} : tracking(0.001);
  };
  two.run(400ms);
  EXPECT_EQ(two.holder(), 1 - first);
  EXPECT_EQ(two.missing(hidden - 500ms, two.now - 100ms), 0U);
}

TEST(HandOver, AKeeperThatDiesLosesNoFrame) {
  TwoCells two;
  two.run(1s);
  const size_t first = two.holder();
  const Time died = two.now;
  two.alive.at(first) = false;
  two.run(1s);
  EXPECT_TRUE(two.cells.at(1 - first).own().holds);
  EXPECT_EQ(two.missing(died - 300ms, two.now - 300ms), 0U) << "what was not heard is published";
  EXPECT_EQ(two.twice(), 0U);
}

TEST(HandOver, ALastWillIsFollowedAtOnce) {
  TwoCells two;
  two.run(1s);
  const size_t first = two.holder();
  two.alive.at(first) = false;
  two.cells.at(1 - first).gone(first == 0 ? "a" : "b");
  two.run(20ms);
  EXPECT_TRUE(two.cells.at(1 - first).own().holds);
}

TEST(HandOver, WithoutANetworkEachGoesOnAndOneYieldsAfterwards) {
  TwoCells two;
  two.run(1s);
  const size_t first = two.holder();
  two.delay = [](size_t) -> std::optional<Duration> { return std::nullopt; };
  two.run(3s);
  EXPECT_TRUE(two.cells.at(0).own().holds && two.cells.at(1).own().holds);
  const size_t double_then = two.twice();
  EXPECT_GT(double_then, 100U);
  two.delay = [](size_t) { return Duration(5ms); };
  two.run(1s);
  EXPECT_EQ(two.holder(), 1 - first) << "the later one goes on";
  EXPECT_LE(two.twice(), double_then + 15) << "as long as the two have not said it yet";
  EXPECT_EQ(two.missing(two.now - 3s, two.now - 500ms), 0U);
}

TEST(HandOver, AnOfferThatNobodyAnswersIsTakenBack) {
  TwoCells two;
  two.run(1s);
  const size_t first = two.holder();
  // What the other one says still arrives; what is said to it does not, nor its answers.
  two.worth = [&](size_t cell, Time) { return tracking(cell == first ? 0.01 : 0.001); };
  two.delay = [&](size_t cell) -> std::optional<Duration> {
    if (cell == first) return std::nullopt;
    return Duration(2ms);
  };
  const Time begin = two.now;
  two.run(480ms);  // an offer and its end, before the silence ends it all
  EXPECT_TRUE(two.cells.at(first).own().holds);
  EXPECT_EQ(two.missing(begin - 500ms, two.now - 400ms), 0U);
}

TEST(HandOver, TermsGrowOverRestarts) {
  TwoCells two;
  two.run(1s);
  const size_t first = two.holder();
  const uint64_t before = two.cells.at(first).own().term;
  two.cells.at(first) = HandOver(first == 0 ? "a" : "b");  // it has died and knows of nothing
  two.run(1s);
  ASSERT_NE(two.holder(), TwoCells::kNobody);
  EXPECT_GT(two.cells.at(two.holder()).own().term, before);
  EXPECT_EQ(two.twice(), 0U);
}

// Whatever a network does: at the end, when it works, there is one, and all frames are there.
TEST(HandOver, AnyNetworkEndsWithOneKeeper) {
  std::mt19937 chance(11);
  for (int round = 0; round < 50; ++round) {
    TwoCells two;
    std::uniform_int_distribution<int> ms(0, 400), loss(0, 3);
    std::lognormal_distribution<double> sigma(std::log(0.002), 1.0);
    two.worth = [&](size_t, Time) {
      return loss(chance) == 0 ? nothing() : tracking(sigma(chance));
    };
    two.delay = [&](size_t) -> std::optional<Duration> {
      if (loss(chance) == 0) return std::nullopt;
      return Duration(std::chrono::milliseconds(ms(chance)));
    };
    two.run(5s);
    two.delay = [](size_t) { return Duration(2ms); };
    two.worth = [](size_t, Time) { return tracking(0.001); };
    two.run(2s);
    EXPECT_NE(two.holder(), TwoCells::kNobody) << round;
    EXPECT_EQ(two.missing(two.now - 1s, two.now), 0U) << round;
    const Time settled = two.now;
    two.run(1s);
    for (const auto& [capture, who] : two.published) {
      if (capture < settled) continue;
      EXPECT_EQ(who.size(), 1U) << round;
    }
  }
}

}  // namespace
}  // namespace sightline
