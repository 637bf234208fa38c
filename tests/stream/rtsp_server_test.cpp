// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/rtsp_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>

#include "raw_rtsp_client.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/stream/encoder.hpp"
#include "sightline/stream/sei.hpp"
#include "stream_tools.hpp"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kWidth = 320, kHeight = 192;

/// A camera that moves: draws, encodes and sends while somebody wants its stream, and only then.
class FakeCamera {
 public:
  FakeCamera(RtspServer& server, std::string name, int bitrate_kbps = 800, bool uneven = false)
      : uneven_(uneven) {
    RtspStreamOptions stream_options;
    stream_options.width = kWidth;
    stream_options.height = kHeight;
    auto added = server.add_stream(name, stream_options);
    EXPECT_TRUE(added) << added.error().message();
    stream_ = *added;
    EncoderOptions options;
    options.width = kWidth;
    options.height = kHeight;
    options.bitrate_kbps = bitrate_kbps;
    auto encoder = VideoEncoder::create(
        options, name, [stream = stream_](EncodedPacket packet) { stream->push(packet); });
    EXPECT_TRUE(encoder) << encoder.error().message();
    encoder_ = *std::move(encoder);
    stream_->on_keyframe_wanted([this] { encoder_->request_keyframe(); });
    stream_->on_wanted([this](bool wanted) { wanted_changes_ += wanted ? 1 : 0; });
    for (int n = 0; n < 16; ++n) images_.push_back(synthetic_image(kWidth, kHeight, n));
    thread_ = start_thread("camera", [this](std::stop_token stop) { run(stop); });
  }
  ~FakeCamera() {
    thread_.request_stop();
    thread_.join();
    stream_->on_keyframe_wanted({});
    stream_->on_wanted({});
  }

  RtspStream& stream() { return *stream_; }
  uint64_t encoded() const { return encoder_->counts().encoded; }
  int times_wanted() const { return wanted_changes_; }
  /// Times it had an image to encode, wanted or not.
  uint64_t offered() const { return offered_; }

 private:
  void run(std::stop_token stop) {
    uint64_t n = 0;
    while (!stop.stop_requested()) {
      std::this_thread::sleep_for(milliseconds(20));
      ++offered_;
      if (!stream_->wanted()) continue;
      const Duration jitter = uneven_ ? milliseconds(n * 7 % 11) : milliseconds(0);
      encoder_->push(annotated(images_[n % 16], n, MonotonicClock::now() - jitter), {});
      ++n;
    }
  }

  const bool uneven_;
  std::shared_ptr<RtspStream> stream_;
  std::unique_ptr<VideoEncoder> encoder_;
  std::vector<std::shared_ptr<const Image>> images_;
  std::atomic<int> wanted_changes_{0};
  std::atomic<uint64_t> offered_{0};
  std::jthread thread_;
};

class RtspServerTest : public testing::Test {
 protected:
  void start(RtspOptions options = {}) {
    options.port = 0;
    auto created = RtspServer::create(options);
    ASSERT_TRUE(created) << created.error().message();
    server_ = *std::move(created);
    thread_ = start_thread("rtsp", [this](std::stop_token stop) { server_->run(stop); });
  }
  void TearDown() override { stop(); }
  void stop() {
    stop_running();
    server_.reset();
  }

  void stop_running() {
    if (!thread_.joinable()) return;
    thread_.request_stop();
    thread_.join();
  }

  std::string url(const std::string& name) const {
    return fmt::format("rtsp://127.0.0.1:{}/{}", server_->port(), name);
  }
  RawRtspClient client(const std::string& name) const {
    return RawRtspClient(server_->port(), url(name));
  }

  std::unique_ptr<RtspServer> server_;
  std::jthread thread_;
};

/// Whole messages out of H.264 RTP packets (RFC 6184): single units and STAP-A; fragments (slices)
/// are of no interest here.
std::vector<SeiMessage> messages_in(const RtpPacket& packet) {
  std::vector<SeiMessage> found;
  const auto look = [&](std::span<const uint8_t> nal) {
    std::vector<uint8_t> unit = {0, 0, 1};
    unit.insert(unit.end(), nal.begin(), nal.end());
    if (auto message = parse_sei(unit)) found.push_back(*std::move(message));
  };
  const std::span<const uint8_t> payload(packet.payload);
  if (payload.empty()) return found;
  if ((payload[0] & 0x1f) != 24) {
    look(payload);
    return found;
  }
  for (size_t at = 1; at + 2 <= payload.size();) {
    const size_t length = static_cast<size_t>(payload[at]) << 8 | payload[at + 1];
    if (at + 2 + length > payload.size()) break;
    look(payload.subspan(at + 2, length));
    at += 2 + length;
  }
  return found;
}

size_t open_descriptors() {
  size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    ++count;
  }
  return count;
}

/// An ffmpeg that writes the stream, as received, into a file until it has `frames`.
std::vector<std::string> ffmpeg(const std::string& url, const std::string& transport, int frames,
                                const std::string& output) {
  return {"ffmpeg", "-v",   "error", "-y",   "-rtsp_transport", transport,
          "-i",     url,    "-c:v",  "copy", "-frames:v",       std::to_string(frames),
          "-f",     "h264", output};
}

/// Access units of a file that starts each with a delimiter or parameter sets, cut at our messages.
int decodable_images(const std::string& file, int* messages) {
  const auto content = read_file(file);
  if (!content) return 0;
  const std::vector<uint8_t> bytes(content->begin(), content->end());
  std::vector<size_t> starts;
  for (size_t i = 0; i + 3 < bytes.size(); ++i) {
    if (bytes[i] == 0 && bytes[i + 1] == 0 && bytes[i + 2] == 1 && (bytes[i + 3] & 0x1f) == 9) {
      starts.push_back(i);
    }
  }
  starts.push_back(bytes.size());
  H264Decoder decoder;
  int images = 0;
  for (size_t i = 0; i + 1 < starts.size(); ++i) {
    const auto unit = std::span(bytes).subspan(starts[i], starts[i + 1] - starts[i]);
    if (decoder.decode(unit).width == kWidth) ++images;
    if (messages && parse_sei(unit)) ++*messages;
  }
  return images;
}

std::string scratch_file(const std::string& name) {
  return testing::TempDir() + "/sightline_" + std::to_string(getpid()) + "_" + name;
}

TEST_F(RtspServerTest, TwoClientsPullTwoStreamsOverTcpAndUdpAtOnce) {
  if (!has_program("ffmpeg")) GTEST_SKIP() << "needs the program ffmpeg (Debian package ffmpeg)";
  start();
  FakeCamera left(*server_, "left"), right(*server_, "right");
  const std::string a = scratch_file("a.h264"), b = scratch_file("b.h264");
  Child over_tcp(ffmpeg(url("left"), "tcp", 30, a));
  Child over_udp(ffmpeg(url("right"), "udp", 30, b));
  EXPECT_EQ(over_tcp.wait(), 0);
  EXPECT_EQ(over_udp.wait(), 0);
  for (const std::string& file : {a, b}) {
    int messages = 0;
    EXPECT_GE(decodable_images(file, &messages), 29) << file;
    EXPECT_GE(messages, 29) << file;
    std::filesystem::remove(file);
  }
}

TEST_F(RtspServerTest, NothingIsEncodedUnlessWanted) {
  start();
  FakeCamera camera(*server_, "cam");
  EXPECT_FALSE(camera.stream().wanted());
  // Not a matter of time: the camera has offered so many images and none was taken.
  ASSERT_TRUE(eventually([&] { return camera.offered() >= 5; }));
  EXPECT_EQ(camera.encoded(), 0u);

  RawRtspClient first = client("cam"), second = client("cam");
  ASSERT_EQ(first.play(), 200);
  ASSERT_EQ(second.play(), 200);
  EXPECT_TRUE(camera.stream().wanted());
  EXPECT_TRUE(eventually([&] { return camera.stream().viewers() == 2; }));
  ASSERT_TRUE(first.next_packet());
  ASSERT_TRUE(second.next_packet());

  EXPECT_EQ(first.teardown(), 200);
  EXPECT_TRUE(eventually([&] { return camera.stream().viewers() == 1; }));
  EXPECT_TRUE(camera.stream().wanted());
  EXPECT_EQ(second.teardown(), 200);
  EXPECT_TRUE(eventually([&] { return !camera.stream().wanted(); }));
  EXPECT_EQ(camera.stream().viewers(), 0);
  EXPECT_EQ(camera.times_wanted(), 1);

  // Back again: a new pipeline, whose state the old one's late end does not touch.
  RawRtspClient third = client("cam");
  ASSERT_EQ(third.play(), 200);
  ASSERT_TRUE(third.next_packet());
  EXPECT_TRUE(camera.stream().wanted());
  EXPECT_EQ(camera.times_wanted(), 2);
}

TEST_F(RtspServerTest, AClientThatOnlyAsksDoesNotKeepTheStreamRunning) {
  start();
  FakeCamera camera(*server_, "cam");
  {
    RawRtspClient asking = client("cam");
    ASSERT_EQ(asking.request("DESCRIBE", url("cam"), "Accept: application/sdp\r\n"), 200);
    EXPECT_TRUE(camera.stream().wanted());
  }
  EXPECT_TRUE(eventually([&] { return !camera.stream().wanted(); }));
}

TEST_F(RtspServerTest, RtpTimeStampsAreCaptureTimes) {
  start();
  FakeCamera camera(*server_, "cam", 800, /*uneven=*/true);
  RawRtspClient viewer = client("cam");
  ASSERT_EQ(viewer.play(), 200);
  std::optional<std::pair<uint32_t, Time>> previous;
  int compared = 0;
  while (compared < 25) {
    const auto packet = viewer.next_packet();
    ASSERT_TRUE(packet);
    for (const SeiMessage& message : messages_in(*packet)) {
      if (previous) {
        const double ticks =
            static_cast<double>(static_cast<int32_t>(packet->timestamp - previous->first));
        EXPECT_NEAR(ticks, to_seconds(message.capture - previous->second) * 90'000, 1.5);
        ++compared;
      }
      previous.emplace(packet->timestamp, message.capture);
    }
  }
}

TEST_F(RtspServerTest, ALateViewerStartsWithAKeyFrame) {
  start();
  FakeCamera camera(*server_, "cam");
  RawRtspClient early = client("cam");
  ASSERT_EQ(early.play(), 200);
  for (int i = 0; i < 40; ++i) ASSERT_TRUE(early.next_packet());
  RawRtspClient late = client("cam");
  ASSERT_EQ(late.play(), 200);
  // Parameter sets (7) come in sight within a few images, not at the end of a 60-image group.
  bool found = false;
  for (int i = 0; i < 100 && !found; ++i) {
    const auto packet = late.next_packet();
    ASSERT_TRUE(packet);
    const int type = packet->payload.empty() ? 0 : packet->payload[0] & 0x1f;
    found = type == 7 || type == 24 || type == 5 ||
            (type == 28 && packet->payload.size() > 1 && (packet->payload[1] & 0x1f) == 5);
  }
  EXPECT_TRUE(found);
}

/// Packets that come while the pipeline is just starting must not get time stamps of a clock that
/// is not set yet: the stream would stand still.
TEST_F(RtspServerTest, PacketsDuringTheStartDoNotStopTheStream) {
  start();
  const auto added = server_->add_stream("cam", {kWidth, kHeight, 30});
  ASSERT_TRUE(added);
  const std::shared_ptr<RtspStream> stream = *added;
  EncoderOptions options;
  options.width = kWidth;
  options.height = kHeight;
  EncodedPacket packet;
  auto encoder =
      VideoEncoder::create(options, "cam", [&](EncodedPacket encoded) { packet = encoded; });
  ASSERT_TRUE(encoder) << encoder.error().message();
  (*encoder)->push(annotated(synthetic_image(kWidth, kHeight, 0), 0, MonotonicClock::now()), {});
  ASSERT_TRUE((*encoder)->finish(seconds(20)));
  ASSERT_TRUE(packet.keyframe);

  const std::jthread pushing = start_thread("pushing", [&](std::stop_token stop) {
    while (!stop.stop_requested()) {
      packet.capture = MonotonicClock::now();
      stream->push(packet);
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  });
  for (int cycle = 0; cycle < 20; ++cycle) {
    RawRtspClient viewer = client("cam");
    ASSERT_EQ(viewer.play(), 200) << cycle;
    for (int i = 0; i < 20; ++i) ASSERT_TRUE(viewer.next_packet()) << cycle;
    EXPECT_EQ(viewer.teardown(), 200);
    ASSERT_TRUE(eventually([&] { return !stream->wanted(); })) << cycle;
  }
}

TEST_F(RtspServerTest, ComingAndGoingLeavesNoDescriptorsBehind) {
  start();
  FakeCamera camera(*server_, "cam");
  size_t warm = 0;
  for (int cycle = 0; cycle < 25; ++cycle) {
    {
      RawRtspClient viewer = client("cam");
      ASSERT_EQ(viewer.play(), 200) << cycle;
      ASSERT_TRUE(viewer.next_packet()) << cycle;
      if (cycle % 2 == 0) {  // else it just vanishes
        EXPECT_EQ(viewer.teardown(), 200);
      }
    }
    ASSERT_TRUE(eventually([&] { return !camera.stream().wanted() && server_->clients() == 0; }))
        << cycle;
    if (cycle == 4) {
      std::this_thread::sleep_for(milliseconds(200));
      warm = open_descriptors();
    }
  }
  EXPECT_TRUE(eventually([&] { return open_descriptors() <= warm + 2; }))
      << warm << " then " << open_descriptors();
}

TEST_F(RtspServerTest, AKilledClientIsForgotten) {
  if (!has_program("ffmpeg")) GTEST_SKIP() << "needs the program ffmpeg (Debian package ffmpeg)";
  start();
  FakeCamera camera(*server_, "cam");
  for (const std::string transport : {"tcp", "udp"}) {
    Child viewer(ffmpeg(url("cam"), transport, 100'000, "/dev/null"));
    ASSERT_TRUE(eventually([&] { return camera.stream().viewers() == 1; })) << transport;
    viewer.send(SIGKILL);
    EXPECT_TRUE(eventually([&] { return !camera.stream().wanted(); })) << transport;
    EXPECT_EQ(camera.stream().viewers(), 0) << transport;
  }
}

TEST_F(RtspServerTest, AStalledClientDoesNotHoldUpAnother) {
  if (!has_program("ffmpeg")) GTEST_SKIP() << "needs the program ffmpeg (Debian package ffmpeg)";
  start();
  FakeCamera camera(*server_, "cam", 20'000);
  Child stalled(ffmpeg(url("cam"), "tcp", 100'000, "/dev/null"));
  ASSERT_TRUE(eventually([&] { return camera.stream().viewers() == 1; }));
  stalled.send(SIGSTOP);
  RawRtspClient healthy = client("cam");
  ASSERT_EQ(healthy.play(), 200);
  std::optional<uint64_t> previous;
  int images = 0;
  while (images < 150) {
    const auto packet = healthy.next_packet();
    ASSERT_TRUE(packet) << "after " << images << " images; encoded " << camera.encoded()
                        << ", not sent " << camera.stream().dropped();
    for (const SeiMessage& message : messages_in(*packet)) {
      previous = message.sequence;
      ++images;
    }
  }
  EXPECT_TRUE(camera.stream().wanted());
}

TEST_F(RtspServerTest, ASilentSessionTimesOut) {
  RtspOptions options;
  options.session_timeout = seconds(1);
  start(options);
  FakeCamera camera(*server_, "cam");
  RawRtspClient viewer = client("cam");
  ASSERT_EQ(viewer.request("DESCRIBE", url("cam"), "Accept: application/sdp\r\n"), 200);
  // UDP to a port where nobody sends RTCP from, and no further request: no sign of life.
  ASSERT_EQ(viewer.request("SETUP", url("cam") + "/stream=0",
                           "Transport: RTP/AVP;unicast;client_port=50000-50001\r\n"),
            200);
  ASSERT_EQ(viewer.request("PLAY", url("cam")), 200);
  EXPECT_TRUE(camera.stream().wanted());
  EXPECT_TRUE(eventually([&] { return !camera.stream().wanted(); }, seconds(60)));
  EXPECT_EQ(camera.stream().viewers(), 0);
}

TEST_F(RtspServerTest, RemovingAStreamDropsItsViewersOnly) {
  start();
  FakeCamera stays(*server_, "stays"), goes(*server_, "goes");
  RawRtspClient a = client("stays"), b = client("goes");
  ASSERT_EQ(a.play(), 200);
  ASSERT_EQ(b.play(), 200);
  ASSERT_TRUE(eventually([&] { return goes.stream().viewers() == 1; }));
  server_->remove_stream("goes");
  EXPECT_TRUE(b.closed_by_server(seconds(20)));
  EXPECT_FALSE(goes.stream().wanted());
  EXPECT_EQ(client("goes").play(), 404);
  ASSERT_TRUE(a.next_packet());
  server_->remove_stream("never was there");

  // The name is free again.
  EXPECT_TRUE(server_->add_stream("goes", {kWidth, kHeight, 30}));
}

TEST_F(RtspServerTest, MoreClientsThanAllowedAreRefused) {
  RtspOptions options;
  options.max_clients = 2;
  start(options);
  FakeCamera camera(*server_, "cam");
  RawRtspClient a = client("cam"), b = client("cam");
  ASSERT_EQ(a.play(), 200);
  ASSERT_EQ(b.play(), 200);
  RawRtspClient c = client("cam");
  EXPECT_TRUE(c.closed_by_server(seconds(20)));
  EXPECT_EQ(server_->clients(), 2);
  ASSERT_TRUE(a.next_packet());
  EXPECT_EQ(a.teardown(), 200);
}

TEST_F(RtspServerTest, StopsWithViewersOn) {
  start();
  FakeCamera camera(*server_, "cam");
  RawRtspClient viewer = client("cam");
  ASSERT_EQ(viewer.play(), 200);
  ASSERT_TRUE(viewer.next_packet());
  stop_running();
  EXPECT_TRUE(viewer.closed_by_server(seconds(20)));
  EXPECT_TRUE(eventually([&] { return !camera.stream().wanted(); }));
}

TEST_F(RtspServerTest, AStreamOutlivesItsServer) {
  start();
  auto added = server_->add_stream("cam", {kWidth, kHeight, 30});
  ASSERT_TRUE(added);
  stop();
  EncodedPacket packet;
  packet.keyframe = true;
  packet.bytes = std::make_shared<const std::vector<uint8_t>>(10);
  (*added)->push(packet);
  EXPECT_FALSE((*added)->wanted());
}

TEST_F(RtspServerTest, AnUnknownPathIsNotFound) {
  start();
  EXPECT_EQ(client("nothing").play(), 404);
}

TEST_F(RtspServerTest, NamesAreChecked) {
  start();
  for (const std::string bad : {"", "a/b", "..", "a b", "a?b", "ä"}) {
    const auto added = server_->add_stream(bad, {kWidth, kHeight, 30});
    ASSERT_FALSE(added) << bad;
    EXPECT_EQ(added.error().code, ErrorCode::kInvalidInput);
  }
  const auto first = server_->add_stream("Front-1_a.b", {kWidth, kHeight, 30});
  ASSERT_TRUE(first);
  EXPECT_EQ((*first)->url(), url("Front-1_a.b"));
  EXPECT_FALSE(server_->add_stream("Front-1_a.b", {kWidth, kHeight, 30}));
}

TEST_F(RtspServerTest, ABusyPortIsAnErrorThatSaysWhatToDo) {
  start();
  RtspOptions options;
  options.port = server_->port();
  const auto second = RtspServer::create(options);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text, testing::HasSubstr(std::to_string(server_->port())));
  EXPECT_THAT(second.error().text, testing::HasSubstr("choose another port"));
}

TEST_F(RtspServerTest, AnAddressThatIsNotOursIsAnError) {
  RtspOptions options;
  options.address = "192.0.2.1";  // TEST-NET, never assigned
  options.port = 0;
  const auto created = RtspServer::create(options);
  ASSERT_FALSE(created);
  EXPECT_THAT(created.error().text, testing::HasSubstr("192.0.2.1"));
}

}  // namespace
}  // namespace sightline
