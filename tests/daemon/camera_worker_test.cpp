// SPDX-License-Identifier: Apache-2.0
// One camera of the daemon with a scripted source: absent, gone, silent, of another size, back
// again.
#include "workers/camera_worker.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <latch>
#include <thread>

#include "sightline/render/raster/ray_table.hpp"
#include "sightline/stream/sei.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr int kWidth = 160, kHeight = 120;

/// What the source of the next opening does, told by the test.
struct Script {
  enum class Mode { kAbsent, kFrames, kSilent, kGone, kOtherSize, kEnd, kOpensForEver };
  std::atomic<Mode> mode{Mode::kFrames};
  std::atomic<int> opened{0};
  std::latch let_go{1};  ///< ends an opening that takes for ever
  std::atomic<uint64_t> sequence{0};
};

class ScriptedSource : public FrameSource {
 public:
  explicit ScriptedSource(Script& script) : script_(script) {
    info_.nominal_rate_hz = 50;
    ++script_.opened;
  }
  const SourceInfo& info() const override { return info_; }
  Result<SourceStep> next(std::stop_token, Duration timeout) override {
    std::this_thread::sleep_for(std::min<Duration>(timeout, 20ms));
    switch (script_.mode.load()) {
      case Script::Mode::kGone:
      case Script::Mode::kAbsent:
        return make_error(ErrorCode::kUnavailable, "scripted", "unplugged");
      case Script::Mode::kSilent:
        return SourceStep{};
      case Script::Mode::kEnd:
        return SourceStep{SourceStep::Kind::kEnd, nullptr};
      default:
        return SourceStep{SourceStep::Kind::kFrame, frame()};
    }
  }

 private:
  FramePtr frame() {
    FrameInfo info;
    info.width = script_.mode == Script::Mode::kOtherSize ? kWidth / 2 : kWidth;
    info.height = kHeight;
    info.sequence = ++script_.sequence;
    info.capture = info.arrival = MonotonicClock::now();
    return Frame::decoded(info, std::make_shared<Image>(info.width, info.height));
  }

  Script& script_;
  SourceInfo info_;
};

/// A stream that somebody watches while `watched`; keeps what was said inside its packets.
class WatchedStream : public RtspStream {
 public:
  std::atomic<bool> watched{true};
  int viewers() const override { return watched ? 1 : 0; }
  bool wanted() const override { return watched; }
  void push(const EncodedPacket& packet) override {
    const auto message = parse_sei(*packet.bytes);
    std::lock_guard lock(mutex_);
    packets_.push_back({message ? *message : SeiMessage(), packet.capture});
  }
  uint64_t dropped() const override { return 0; }
  void on_wanted(std::function<void(bool)>) override {}
  void on_keyframe_wanted(std::function<void()>) override {}
  std::string url() const override { return "rtsp://test"; }
  void on_sent(std::function<void(Duration)>) override {}

  struct Sent {
    SeiMessage message;
    Time time{};
  };
  std::vector<Sent> packets() const {
    std::lock_guard lock(mutex_);
    return packets_;
  }
  /// How often the newest message stands at the end.
  size_t repeats() const {
    const auto all = packets();
    size_t n = 0;
    while (n < all.size() &&
           all[all.size() - 1 - n].message.sequence == all.back().message.sequence)
      ++n;
    return n;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Sent> packets_;
};

bool eventually(const std::function<bool()>& done) {
  const Time end = MonotonicClock::now() + 60s;
  while (!done()) {
    if (MonotonicClock::now() > end) return false;
    std::this_thread::sleep_for(5ms);
  }
  return true;
}

class CameraWorkerTest : public testing::Test {
 protected:
  void start(Script::Mode mode, bool reopen_when_stalled = true) {
    script_.mode = mode;
    CameraModel::Parameters lens;
    lens.width = kWidth;
    lens.height = kHeight;
    lens.fx = lens.fy = 100;
    const CalibratedCamera camera{"cam", *CameraModel::create(lens, "cam"), {}, 0.3};
    EncoderOptions encoder;
    encoder.width = kWidth;
    encoder.height = kHeight;
    CameraParts parts;
    parts.name = "cam";
    parts.width = kWidth;
    parts.height = kHeight;
    parts.reopen_when_stalled = reopen_when_stalled;
    parts.open_source = [this](const std::stop_token&) -> Result<std::unique_ptr<FrameSource>> {
      if (script_.mode == Script::Mode::kAbsent) {
        return make_error(ErrorCode::kUnavailable, "scripted", "not there");
      }
      if (script_.mode == Script::Mode::kOpensForEver) {
        const Waiting wait("the camera");
        script_.let_go.wait();
      }
      return std::unique_ptr<FrameSource>(std::make_unique<ScriptedSource>(script_));
    };
    parts.draw.renderer = *CameraRenderer::create(camera, CameraId(0), {},
                                                  RayTable::build(camera.model), nullptr, {});
    parts.draw.slate = NoSignalSlate::create(kWidth, kHeight, {});
    auto pictures = PictureBoard::start(registry_, beats_, nullptr);
    ASSERT_TRUE(pictures);
    pictures_ = *pictures;
    parts.output = StreamOutput::create("cam", encoder, {}, stream_, nullptr,
                                        pictures_->slot("cam"), recorder_, registry_);
    parts.draw.board = std::make_shared<TrackBoard>(0);
    worker_ = CameraWorker::start(std::move(parts), registry_, beats_);
  }
  void TearDown() override {
    if (!worker_) return;
    if (!script_.let_go.try_wait()) script_.let_go.count_down();
    worker_->stop();
    worker_->output()->close();
  }
  uint64_t lost_by(const std::string& cause) {
    return registry_
        .counter("sightline_source_lost_total", "", {{"camera", "cam"}, {"cause", cause}})
        .value();
  }
  bool frames_flow() {
    const uint64_t before = worker_->status().frames;
    return eventually(
        [&] { return worker_->status().present && worker_->status().frames > before + 5; });
  }

  Script script_;
  Registry registry_;
  HeartbeatBoard beats_;
  std::shared_ptr<PictureBoard> pictures_;
  std::shared_ptr<RecordingSinkWorker> recorder_ =
      RecordingSinkWorker::start(RecordingKind::kViewing, registry_, beats_);
  std::shared_ptr<WatchedStream> stream_ = std::make_shared<WatchedStream>();
  std::unique_ptr<CameraWorker> worker_;
};

TEST_F(CameraWorkerTest, PicturesAloneAreDrawnAndNoVideoIsMade) {
  stream_->watched = false;
  start(Script::Mode::kFrames);
  ASSERT_TRUE(frames_flow());
  const auto encoded = [this] {
    return registry_.counter("sightline_pictures_encoded_total", "", {{"camera", "cam"}}).value();
  };
  EXPECT_EQ(encoded(), 0u);
  const Gauge& drawn = registry_.gauge("sightline_draw_seconds", "", {{"camera", "cam"}});
  {
    PictureWatch clean(pictures_->slot("cam"), PictureKind::kClean);
    EXPECT_TRUE(eventually([&] { return clean.next() != nullptr; }));
    EXPECT_EQ(drawn.value(), 0);  // nobody wants the annotated ones
    PictureWatch annotated(pictures_->slot("cam"), PictureKind::kAnnotated);
    EXPECT_TRUE(eventually([&] { return annotated.next() != nullptr; }));
    EXPECT_GT(drawn.value(), 0);
  }
  EXPECT_EQ(worker_->output()->encoder_name(), "");
  EXPECT_TRUE(stream_->packets().empty());
}

TEST_F(CameraWorkerTest, AbsentFromTheStartTheStreamIsUpAllTheSame) {
  start(Script::Mode::kAbsent);
  ASSERT_TRUE(eventually([&] { return stream_->packets().size() >= 3; }));
  const CameraStatus status = worker_->status();
  EXPECT_FALSE(status.present);
  EXPECT_NE(status.lost_since, Time{});
  EXPECT_EQ(status.problem, "scripted: not there");
  const auto packets = stream_->packets();
  for (const auto& packet : packets) {
    EXPECT_EQ(packet.message.sequence, 0u);
    EXPECT_EQ(to_ns(packet.message.capture), 0);
    EXPECT_TRUE(packet.message.objects.empty());
  }
  EXPECT_GE(packets[2].time - packets[1].time, 400ms);
  EXPECT_GE(lost_by("absent"), 1u);
  script_.mode = Script::Mode::kFrames;
  EXPECT_TRUE(frames_flow());
  EXPECT_EQ(worker_->status().problem, "");
}

TEST_F(CameraWorkerTest, WaitingForAnAbsentCameraIsNoHang) {
  start(Script::Mode::kAbsent);
  // It beats in every turn of a wait, not once for each: two seconds before the limit of five have
  // to be enough at any time, on a busy machine, too.
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(beats_.stalled(MonotonicClock::now() + 3000ms).empty());
    return lost_by("absent") >= 5 || HasFailure();
  }));
}

TEST_F(CameraWorkerTest, ADeviceThatTakesForEverToOpenIsNoHangAndHoldsUpNoStop) {
  start(Script::Mode::kOpensForEver);
  ASSERT_TRUE(eventually([&] { return !beats_.waits(MonotonicClock::now(), 0s).empty(); }));
  // The stream goes on, a day later, too, nothing counts as stalled but what is not asked here.
  ASSERT_TRUE(eventually([&] { return stream_->packets().size() >= 2; }));
  const auto stalled = beats_.stalled(MonotonicClock::now() + 24h);
  EXPECT_EQ(std::ranges::count(stalled, "cap:cam"), 0);
  EXPECT_EQ(beats_.waits(MonotonicClock::now(), 0s)[0].thread, "cap:cam");
  EXPECT_FALSE(worker_->stop_unless_waiting(10ms));
  script_.let_go.count_down();
  EXPECT_TRUE(worker_->stop_unless_waiting(10ms));
}

TEST_F(CameraWorkerTest, GoneLaterItShowsTheLastFrameAndClaimsNoOther) {
  start(Script::Mode::kFrames);
  ASSERT_TRUE(frames_flow());
  script_.mode = Script::Mode::kGone;
  ASSERT_TRUE(eventually([&] { return stream_->repeats() >= 3; }));
  const auto packets = stream_->packets();
  const auto& last = packets.back();
  EXPECT_EQ(last.message.sequence, script_.sequence.load());
  EXPECT_GT(last.time - last.message.capture, 400ms);
  EXPECT_FALSE(worker_->status().present);
  EXPECT_GE(lost_by("gone"), 1u);
  script_.mode = Script::Mode::kFrames;
  ASSERT_TRUE(frames_flow());
  EXPECT_TRUE(eventually(
      [&] { return stream_->packets().back().message.sequence > last.message.sequence; }));
}

TEST_F(CameraWorkerTest, ASilentDeviceIsOpenedAgain) {
  start(Script::Mode::kFrames);
  ASSERT_TRUE(frames_flow());
  script_.mode = Script::Mode::kSilent;
  ASSERT_TRUE(eventually([&] { return script_.opened >= 2 && stream_->repeats() >= 2; }));
  EXPECT_GE(lost_by("silent"), 1u);
  script_.mode = Script::Mode::kFrames;
  EXPECT_TRUE(frames_flow());
}

TEST_F(CameraWorkerTest, ARecordingThatPausesIsNotOpenedAgain) {
  start(Script::Mode::kFrames, false);
  ASSERT_TRUE(frames_flow());
  script_.mode = Script::Mode::kSilent;
  ASSERT_TRUE(eventually([&] { return stream_->repeats() >= 2 && !worker_->status().present; }));
  script_.mode = Script::Mode::kFrames;
  EXPECT_TRUE(frames_flow());
  EXPECT_EQ(script_.opened, 1);
}

TEST_F(CameraWorkerTest, ImagesOfAnotherSizeAreAMismatchNotACrash) {
  start(Script::Mode::kOtherSize);
  ASSERT_TRUE(eventually([&] { return lost_by("mismatch") >= 1; }));
  EXPECT_NE(worker_->status().problem.find("80x120"), std::string::npos);
  script_.mode = Script::Mode::kFrames;
  EXPECT_TRUE(frames_flow());
}

}  // namespace
}  // namespace sightline
