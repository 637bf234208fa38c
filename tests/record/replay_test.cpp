// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/replay.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>

#include "record/media.hpp"
#include "record/replay_camera.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using namespace test;
using namespace std::chrono_literals;

std::shared_ptr<const Recording> open(const fs::path& folder) {
  auto recording = open_recording(folder, RecordingMode::kStrict);
  SL_CHECK(recording.has_value(), recording.error().message());
  return std::make_shared<const Recording>(*std::move(recording));
}

struct Summary {
  std::map<uint32_t, uint64_t> hashes;
  std::map<uint32_t, size_t> frames;
  size_t sets = 0, damaged = 0;
};

/// Plays everything and checks the order of sets and of frames in them.
Summary play(const std::shared_ptr<const Recording>& recording) {
  Summary out;
  auto replay = *VirtualReplay::open(recording);
  Time last{};
  for (;;) {
    auto set = replay->next();
    EXPECT_TRUE(set);
    if (!set || !*set) return out;
    EXPECT_FALSE((*set)->empty());
    EXPECT_GT((*set)->front()->info().capture, last);
    last = (*set)->front()->info().capture;
    ++out.sets;
    std::optional<CameraId> previous;
    for (const auto& frame : **set) {
      const FrameInfo& info = frame->info();
      EXPECT_EQ(info.capture, last);
      if (previous) {
        EXPECT_LT(*previous, info.camera);
      }
      previous = info.camera;
      ++out.frames[info.camera.index()];
      out.damaged += info.status == FrameStatus::kDamaged;
      auto& hash = out.hashes[info.camera.index()];
      hash = hash_of(frame->i420(), hash);
    }
  }
}

TEST(VirtualReplay, GivesSetsInOrderOfCaptureTime) {
  TempFolder temp;
  write_small_recording(temp / "r", 5);
  auto replay = *VirtualReplay::open(open(temp / "r"));
  std::vector<std::pair<int64_t, uint32_t>> order;
  while (auto set = *replay->next()) {
    for (const auto& frame : *set) {
      order.emplace_back(to_ns(frame->info().capture) / 1'000'000, frame->info().camera.index());
      const auto source = pattern(static_cast<int>(frame->info().sequence));
      EXPECT_EQ(hash_of(frame->i420()), hash_of(source->view()));
      EXPECT_EQ(frame->info().arrival - frame->info().capture, 5ms);
    }
  }
  ASSERT_EQ(order.size(), 10u);
  EXPECT_EQ(order[0], std::pair(int64_t{1000}, 0u));
  EXPECT_EQ(order[1], std::pair(int64_t{1030}, 1u));
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
}

TEST(VirtualReplay, TimeOffsetsChangeTheOrder) {
  TempFolder temp;
  write_small_recording(temp / "r", 5);
  // The second camera comes 30 ms behind the first; 10 ms before it with this.
  auto replay = *VirtualReplay::open(open(temp / "r"), {}, {Duration(0), -40ms});
  const auto first = *replay->next();
  ASSERT_TRUE(first);
  ASSERT_EQ(first->size(), 1u);
  const FrameInfo& info = first->front()->info();
  EXPECT_EQ(info.camera, CameraId(1));
  EXPECT_EQ(to_ns(info.capture), 990'000'000);
  EXPECT_EQ(info.time_offset, -40ms);
  EXPECT_EQ(info.arrival - info.capture, 45ms);
  EXPECT_EQ(hash_of(first->front()->i420()), hash_of(pattern(0)->view()));
}

TEST(VirtualReplay, SaysWhenAVideoChangedUnderIt) {
  TempFolder temp;
  write_small_recording(temp / "r", 20);
  const auto recording = open(temp / "r");
  const fs::path video = temp.path() / "r" / "left.mkv";
  fs::resize_file(video, fs::file_size(video) / 2);
  auto replay = *VirtualReplay::open(recording);
  for (int i = 0; i < 100; ++i) {
    const auto set = replay->next();
    if (!set) {
      EXPECT_THAT(set.error().message(), testing::HasSubstr("left.mkv: ends after"));
      return;
    }
    ASSERT_TRUE(*set) << "the end came without a word";
  }
}

TEST(VirtualReplay, BenchDecodesTheSameEveryTime) {
  const auto recording = open(bench_recording());
  const Summary first = play(recording), second = play(recording);
  EXPECT_EQ(first.sets, 90u);
  EXPECT_EQ(first.damaged, 0u);
  for (const uint32_t camera : {0u, 1u, 2u}) EXPECT_EQ(first.frames.at(camera), 90u);
  EXPECT_EQ(first.hashes, second.hashes);
}

TEST(VirtualReplay, Board) {
  const fs::path folder = shared_recording("board");
  if (folder.empty()) GTEST_SKIP() << "no ../shared/recordings/board";
  const Summary summary = play(open(folder));
  EXPECT_EQ(summary.damaged, 0u);
  for (const uint32_t camera : {0u, 1u, 2u, 3u}) EXPECT_EQ(summary.frames.at(camera), 57u);
}

TEST(VirtualReplay, Toy) {
  const fs::path folder = shared_recording("toy");
  if (folder.empty()) GTEST_SKIP() << "no ../shared/recordings/toy";
  const Summary summary = play(open(folder));
  EXPECT_EQ(summary.damaged, 0u);
  EXPECT_EQ(summary.sets, 480u);
}

class Paced : public testing::Test {
 protected:
  void SetUp() override {
    write_small_recording(temp_ / "r", 10);
    recording_ = open(temp_ / "r");
  }
  std::unique_ptr<FrameSource> source(size_t camera, Time start,
                                      const PacedReplayOptions& options) {
    auto clock = std::make_shared<const ReplayClock>(*recording_, start);
    return *open_paced_replay(recording_, camera, CameraId(static_cast<uint32_t>(camera + 3)),
                              clock, options);
  }
  /// With this start and a max_late above it, everything is due at once and nothing is late.
  static Time an_hour_ago() { return MonotonicClock::now() - 1h; }

  TempFolder temp_;
  std::shared_ptr<const Recording> recording_;
  std::stop_source stop_;
};

TEST_F(Paced, EndsWithoutLoop) {
  PacedReplayOptions options;
  options.max_late = 2h;
  auto left = source(0, an_hour_ago(), options);
  EXPECT_EQ(left->info().name, "left");
  EXPECT_NEAR(left->info().nominal_rate_hz, 10.0, 1e-9);
  for (int i = 0; i < 10; ++i) {
    const auto step = left->next(stop_.get_token(), 1s);
    ASSERT_TRUE(step);
    ASSERT_EQ(step->kind, SourceStep::Kind::kFrame);
    EXPECT_EQ(step->frame->info().camera, CameraId(3));
    EXPECT_EQ(hash_of(step->frame->i420()), hash_of(pattern(i)->view()));
    EXPECT_GE(step->frame->info().arrival, step->frame->info().capture);
  }
  EXPECT_EQ(left->next(stop_.get_token(), 1s)->kind, SourceStep::Kind::kEnd);
  EXPECT_EQ(left->next(stop_.get_token(), 1s)->kind, SourceStep::Kind::kEnd);
}

// A start that is not over when the first frame is asked for is used for decoding.
TEST_F(Paced, WhatIsDecodedAheadComesInItsTurn) {
  auto left = source(0, MonotonicClock::now() + 200ms, {});
  for (int i = 0; i < 10; ++i) {
    const auto step = left->next(stop_.get_token(), 10s);
    ASSERT_TRUE(step);
    ASSERT_EQ(step->kind, SourceStep::Kind::kFrame);
    EXPECT_EQ(step->frame->info().sequence, static_cast<uint64_t>(i));
    EXPECT_GE(MonotonicClock::now(), step->frame->info().arrival);
    EXPECT_EQ(hash_of(step->frame->i420()), hash_of(pattern(i)->view()));
  }
  EXPECT_EQ(left->next(stop_.get_token(), 10s)->kind, SourceStep::Kind::kEnd);
}

TEST_F(Paced, DecodesAheadWithinItsBounds) {
  const RecordedCamera& left = recording_->cameras[0];
  const size_t image = static_cast<size_t>(left.width) * static_cast<size_t>(left.height) * 3 / 2;
  auto camera = *record::ReplayCamera::open(recording_, 0, CameraId(0), {});
  EXPECT_FALSE(camera->decode_ahead(image - 1));
  int ahead = 0;
  while (camera->decode_ahead(3 * image)) ++ahead;
  EXPECT_EQ(ahead, 3);
  ASSERT_TRUE(camera->skip());
  EXPECT_TRUE(camera->decode_ahead(3 * image)) << "one less is ahead";
  while (camera->decode_ahead(100 * image)) ++ahead;
  EXPECT_EQ(ahead, 3 + 6) << "all ten";
  for (int i = 1; i < 10; ++i) {
    ASSERT_TRUE(camera->row());
    const auto frame = camera->take(*camera->row());
    ASSERT_TRUE(frame);
    EXPECT_EQ(hash_of((*frame)->i420()), hash_of(pattern(i)->view()));
  }
  EXPECT_FALSE(camera->row());
  EXPECT_FALSE(camera->decode_ahead(100 * image));
}

TEST_F(Paced, WhatCannotBeDecodedAheadIsSaidInItsTurn) {
  const fs::path video = temp_ / "r" / "left.mkv";
  fs::resize_file(video, fs::file_size(video) / 2);
  auto camera = *record::ReplayCamera::open(recording_, 0, CameraId(0), {});
  int ahead = 0;
  while (camera->decode_ahead(size_t{1} << 30)) ++ahead;
  ASSERT_GT(ahead, 1);
  for (int i = 1; i < ahead; ++i) ASSERT_TRUE(camera->take(*camera->row())) << i;
  const auto end = camera->take(*camera->row());
  ASSERT_FALSE(end);
  EXPECT_THAT(end.error().message(), testing::HasSubstr("left.mkv: ends after"));
}

TEST_F(Paced, LoopsInStepWithoutASeam) {
  for (const size_t keep : {size_t{0}, size_t{1} << 20}) {
    PacedReplayOptions options;
    options.loop = true;
    options.keep_decoded_bytes = keep;
    options.max_late = 2h;
    const Time start = an_hour_ago();
    auto left = source(0, start, options), right = source(1, start, options);
    for (int i = 0; i < 35; ++i) {
      const auto a = left->next(stop_.get_token(), 1s), b = right->next(stop_.get_token(), 1s);
      ASSERT_TRUE(a && b && a->frame && b->frame);
      const FrameInfo &l = a->frame->info(), &r = b->frame->info();
      EXPECT_EQ(l.epoch, 0u);
      EXPECT_EQ(l.sequence, static_cast<uint64_t>(i));
      EXPECT_EQ(l.dropped_before, 0u);
      // A turn lasts from the first capture to the last, of the right camera, and a frame more.
      EXPECT_EQ(l.capture - start, i * 100ms + i / 10 * 30ms);
      EXPECT_EQ(r.capture - l.capture, 30ms);
      EXPECT_EQ(hash_of(a->frame->i420()), hash_of(pattern(i % 10)->view()));
    }
  }
}

TEST_F(Paced, LateFramesAreDroppedAndCounted) {
  PacedReplayOptions options;
  options.loop = true;
  auto left = source(0, an_hour_ago(), options);
  uint64_t next = 0;
  for (int i = 0; i < 4; ++i) {
    const auto step = left->next(stop_.get_token(), 10s);
    ASSERT_TRUE(step);
    ASSERT_EQ(step->kind, SourceStep::Kind::kFrame);
    const FrameInfo& info = step->frame->info();
    EXPECT_EQ(info.sequence, next + info.dropped_before);
    if (i == 0) {
      EXPECT_GT(info.dropped_before, 30'000u) << "an hour at ten frames per second";
    }
    next = info.sequence + 1;
  }
}

TEST_F(Paced, WaitsNoLongerThanAsked) {
  auto left = source(0, MonotonicClock::now() + 1h, {});
  EXPECT_EQ(left->next(stop_.get_token(), 1ms)->kind, SourceStep::Kind::kTimeout);
  stop_.request_stop();
  EXPECT_EQ(left->next(stop_.get_token(), 1h)->kind, SourceStep::Kind::kTimeout);
}

TEST_F(Paced, AStopIsSeenBetweenTwoLateFrames) {
  PacedReplayOptions options;
  options.loop = true;
  auto left = source(0, an_hour_ago(), options);
  stop_.request_stop();
  EXPECT_EQ(left->next(stop_.get_token(), 1h)->kind, SourceStep::Kind::kTimeout);
  // What was passed over before is still counted when it goes on.
  const auto step = left->next({}, 10s);
  ASSERT_TRUE(step && step->frame);
  EXPECT_EQ(step->frame->info().sequence, step->frame->info().dropped_before);
}

/// How often the thread has waited for the disk.
class Listener final : public WaitListener {
 public:
  void wait_begins(const char* what) override {
    EXPECT_STREQ(what, "the disk");
    ++waits;
  }
  void wait_ends() override {}
  int waits = 0;
};

TEST_F(Paced, EveryReadOfTheDiskIsAWait) {
  Listener listener;
  const WaitListening listening(listener);
  ASSERT_TRUE(open_recording(temp_ / "r"));
  EXPECT_GE(listener.waits, 20) << "two cameras of ten images";
}

TEST_F(Paced, ARecordingIsNotReadOnAfterAStop) {
  stop_.request_stop();
  const auto opened = open_recording(temp_ / "r", RecordingMode::kReplay, stop_.get_token());
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kUnavailable);
}

TEST_F(Paced, ClockMapsTurns) {
  const ReplayClock clock(*recording_, time_from_ns(5'000'000'000));
  EXPECT_EQ(clock.loop_period(), 1030ms);
  EXPECT_EQ(to_ns(clock.at(time_from_ns(1'000'000'000), 0)), 5'000'000'000);
  EXPECT_EQ(to_ns(clock.at(time_from_ns(1'030'000'000), 2)), 7'090'000'000);
}

}  // namespace
}  // namespace sightline
