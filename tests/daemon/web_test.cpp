// SPDX-License-Identifier: Apache-2.0
// Pictures and poses on their way to HTTP clients, with threads that offer and threads that read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "web/picture_board.hpp"
#include "web/picture_streams.hpp"
#include "web/pose_feed.hpp"
#include "web/pose_json.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

bool eventually(const std::function<bool()>& done) {
  const Time end = MonotonicClock::now() + 30s;
  while (!done()) {
    if (MonotonicClock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

std::shared_ptr<const Image> gray_image(uint8_t level) {
  auto image = std::make_shared<Image>(64, 48);
  const MutableI420View view = image->mutable_view();
  for (int y = 0; y < 48; ++y) std::fill_n(view.y.row(y), 64, level);
  for (const MutablePlaneView& plane : {view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, uint8_t{128});
  }
  return image;
}

class Pictures : public testing::Test {
 protected:
  void SetUp() override {
    auto started = PictureBoard::start(registry_, beats_, nullptr);
    ASSERT_TRUE(started);
    board_ = *started;
  }
  void offer(uint64_t sequence, PictureKind kind = PictureKind::kAnnotated) {
    FrameInfo frame;
    frame.sequence = sequence;
    frame.capture = time_from_ns(static_cast<int64_t>(sequence) * 1000);
    board_->slot("left")->offer(kind, gray_image(100), frame);
  }
  uint64_t encoded() {
    return registry_.counter("sightline_pictures_encoded_total", "", {{"camera", "left"}}).value();
  }

  Registry registry_;
  HeartbeatBoard beats_;
  std::shared_ptr<PictureBoard> board_;
};

TEST_F(Pictures, NobodyWatchesAndNothingIsKept) {
  const auto slot = board_->slot("left");
  EXPECT_FALSE(slot->wanted());
  auto image = gray_image(7);
  const std::weak_ptr<const Image> kept = image;
  slot->offer(PictureKind::kAnnotated, std::move(image), {});
  EXPECT_TRUE(kept.expired());
  EXPECT_EQ(encoded(), 0u);
}

TEST_F(Pictures, OnlyWhatIsAskedForIsMadeAndOnceForAll) {
  PictureWatch first(board_->slot("left"), PictureKind::kAnnotated);
  PictureWatch second(board_->slot("left"), PictureKind::kAnnotated);
  for (uint64_t i = 1; i <= 10; ++i) offer(i);  // nobody has asked yet
  EXPECT_EQ(encoded(), 0u);
  JpegPtr one, other;
  ASSERT_TRUE(eventually([&] { return (one = first.next()) != nullptr; }));
  ASSERT_TRUE(eventually([&] { return (other = second.next()) != nullptr; }));
  EXPECT_EQ(one, other);
  EXPECT_EQ(one->sequence, 10u);  // the newest
  EXPECT_EQ(one->bytes.substr(0, 2), "\xff\xd8");
  EXPECT_EQ(encoded(), 1u);
  EXPECT_EQ(first.next(), nullptr);  // asks for the next
  offer(11);
  ASSERT_TRUE(eventually([&] { return (one = first.next()) != nullptr; }));
  EXPECT_EQ(one->sequence, 11u);
}

TEST_F(Pictures, CleanAndAnnotatedOnesAreKeptApart) {
  PictureWatch clean(board_->slot("left"), PictureKind::kClean);
  EXPECT_TRUE(board_->slot("left")->wanted(PictureKind::kClean));
  EXPECT_FALSE(board_->slot("left")->wanted(PictureKind::kAnnotated));
  offer(1);
  offer(2, PictureKind::kClean);
  JpegPtr jpeg;
  ASSERT_TRUE(eventually([&] { return (jpeg = clean.next()) != nullptr; }));
  EXPECT_EQ(jpeg->sequence, 2u);
}

TEST_F(Pictures, WhoComesLaterIsNotShownWhatEarlierOnesLeft) {
  {
    PictureWatch earlier(board_->slot("left"), PictureKind::kAnnotated);
    offer(1);
    ASSERT_TRUE(eventually([&] { return earlier.next() != nullptr; }));
  }
  EXPECT_FALSE(board_->slot("left")->wanted());
  PictureWatch later(board_->slot("left"), PictureKind::kAnnotated);
  EXPECT_EQ(later.next(), nullptr);
  offer(2);
  JpegPtr jpeg;
  ASSERT_TRUE(eventually([&] { return (jpeg = later.next()) != nullptr; }));
  EXPECT_EQ(jpeg->sequence, 2u);
}

TEST_F(Pictures, StreamsOfACameraThatHasGoneEnd) {
  HttpReply reply = motion_jpeg_reply(board_->slot("left"), PictureKind::kAnnotated, 0);
  EXPECT_FALSE(reply.stream->ended());
  board_->keep_only({"right"});
  EXPECT_TRUE(reply.stream->ended());
  EXPECT_TRUE(reply.stream->ready());
  EXPECT_EQ(reply.stream->next(), nullptr);
  EXPECT_EQ(board_->find("left"), nullptr);
}

TEST_F(Pictures, FlowFromThreadToThread) {
  HttpReply reply =
      pictures_reply({board_->slot("left"), board_->slot("right")}, PictureKind::kAnnotated, 0);
  std::atomic<uint64_t> sequence{0};
  const std::jthread drawing([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      offer(++sequence);
      std::this_thread::sleep_for(1ms);
    }
  });
  std::string text;
  int parts = 0;
  ASSERT_TRUE(eventually([&] {
    while (reply.stream->ready()) {
      text += *reply.stream->next();
      ++parts;
    }
    return parts >= 20;
  }));
  EXPECT_TRUE(text.starts_with("--sightline-picture\r\nContent-Type: image/jpeg\r\n"));
  EXPECT_TRUE(text.ends_with("\r\n--sightline-picture\r\n"));
  EXPECT_THAT(text, HasSubstr("X-Camera: left\r\n"));
}

PoseEstimate estimate_at(int64_t number) {
  PoseEstimate estimate;
  estimate.object = ObjectId(0);
  estimate.state = TrackState::kTracking;
  estimate.time = time_from_ns(number);
  estimate.cameras = 2;
  return estimate;
}

TEST(PoseFeed, ReadersGoAtTheirOwnPaceAndAreToldWhatTheyMissed) {
  Registry registry;
  const auto feed = std::make_shared<PoseFeed>(registry, nullptr);
  feed->rename({{"box"}, {"left", "right"}, "abc"});
  feed->push(estimate_at(1));  // nobody reads
  PoseFeed::Reader fast(feed), slow(feed);
  std::vector<PoseFeed::Entry> out;
  constexpr uint64_t kPushed = PoseFeed::kKept + 10;
  for (uint64_t i = 0; i < kPushed; ++i) {
    feed->push(estimate_at(static_cast<int64_t>(i)));
    out.clear();
    EXPECT_EQ(fast.read(out, 5), 0u);
    EXPECT_EQ(out.size(), 1u);
  }
  out.clear();
  EXPECT_EQ(slow.read(out, 5), 10u);
  ASSERT_EQ(out.size(), 5u);
  EXPECT_EQ(to_ns(out[0].estimate.time), 10);
  EXPECT_EQ(registry.counter("sightline_events_missed_total", "").value(), 10u);
}

TEST(PoseFeed, EventsSayThePoseWithNamesAndCovariance) {
  Registry registry;
  const auto feed = std::make_shared<PoseFeed>(registry, nullptr);
  feed->rename({{"box"}, {"left", "right"}, "abc"});
  const auto stream = make_event_stream(feed, [] { return std::string("{}"); });
  EXPECT_TRUE(stream->ready());
  EXPECT_EQ(*stream->next(), "retry: 1000\n\nevent: state\ndata: {}\n\n");
  EXPECT_FALSE(stream->ready());
  feed->push(estimate_at(5));
  ASSERT_TRUE(stream->ready());
  const std::string text = *stream->next();
  ASSERT_TRUE(text.starts_with("event: pose\ndata: {"));
  const auto json = nlohmann::json::parse(text.substr(std::string("event: pose\ndata: ").size()));
  EXPECT_EQ(json["object"], "box");
  EXPECT_EQ(json["calibration"], "abc");
  EXPECT_EQ(json["state"], "tracking");
  EXPECT_EQ(json["cameras"], nlohmann::json({"right"}));
  EXPECT_EQ(json["covariance"].size(), 36u);
}

TEST(PoseFeed, ManyThreadsPushAndRead) {
  Registry registry;
  const auto feed = std::make_shared<PoseFeed>(registry, nullptr);
  feed->rename({{"box"}, {"left"}, "abc"});
  const auto stream = make_event_stream(feed, {});
  const std::jthread pushing([&](const std::stop_token& stop) {
    for (int64_t i = 0; !stop.stop_requested(); ++i) feed->push(estimate_at(i));
  });
  const std::jthread renaming([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) feed->rename({{"box"}, {"left", "right"}, "abc"});
  });
  size_t bytes = 0;
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(eventually([&] { return stream->ready(); }));
    if (const auto chunk = stream->next()) bytes += chunk->size();
  }
  EXPECT_GT(bytes, 0u);
}

}  // namespace
}  // namespace sightline
