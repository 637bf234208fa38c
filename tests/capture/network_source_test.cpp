// SPDX-License-Identifier: Apache-2.0
// Network cameras: our own RTSP server, and an HTTP server that sends what the test says.
#include "sightline/capture/network/network_source.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <turbojpeg.h>

#include <array>
#include <atomic>
#include <cstring>
#include <deque>

#include "capture/network/network_url.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/base/unique_fd.hpp"
#include "sightline/stream/encoder.hpp"
#include "sightline/stream/rtsp_server.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

constexpr int kWidth = 320, kHeight = 192;
constexpr int kShades = 24;  // gray levels that tell images apart

std::shared_ptr<const Image> gray_image(int luma) {
  auto image = std::make_shared<Image>(kWidth, kHeight);
  const MutableI420View view = image->mutable_view();
  for (const auto& [plane, value] : {std::pair{view.y, luma}, {view.u, 128}, {view.v, 128}}) {
    for (int y = 0; y < plane.height; ++y) {
      std::memset(plane.row(y), value, static_cast<size_t>(plane.width));
    }
  }
  return image;
}

/// A network camera of our own make; every image's gray level says when it was taken.
class RtspCamera {
 public:
  explicit RtspCamera(uint16_t port = 0) {
    RtspOptions options;
    options.port = port;
    auto server = RtspServer::create(options);
    EXPECT_TRUE(server) << server.error().message();
    server_ = *std::move(server);
    server_thread_ = start_thread("rtsp", [this](std::stop_token stop) { server_->run(stop); });
    stream_ = *server_->add_stream("cam", {kWidth, kHeight, 30});
    EncoderOptions encoder;
    encoder.width = kWidth;
    encoder.height = kHeight;
    auto made = VideoEncoder::create(
        encoder, "cam", [stream = stream_](EncodedPacket packet) { stream->push(packet); });
    EXPECT_TRUE(made) << made.error().message();
    encoder_ = *std::move(made);
    stream_->on_keyframe_wanted([this] { encoder_->request_keyframe(); });
    for (int i = 0; i < kShades; ++i) images_.push_back(gray_image(20 + 9 * i));
    thread_ = start_thread("camera", [this](std::stop_token stop) { run(stop); });
  }
  ~RtspCamera() {
    thread_.request_stop();
    thread_.join();
    stream_->on_keyframe_wanted({});
    server_thread_.request_stop();
    server_thread_.join();
  }

  uint16_t port() const { return server_->port(); }
  std::string url() const { return stream_->url(); }
  /// Capture time of the newest image of that gray level.
  Time captured(int luma) const { return captured_[static_cast<size_t>((luma - 20 + 4) / 9)]; }

 private:
  void run(std::stop_token stop) {
    for (uint64_t n = 0; !stop.stop_requested(); ++n) {
      std::this_thread::sleep_for(33ms);
      if (!stream_->wanted()) continue;
      AnnotatedImage image;
      image.frame.capture = MonotonicClock::now() - 5ms;
      image.frame.sequence = n;
      image.image = images_[n % kShades];
      captured_[n % kShades] = image.frame.capture;
      encoder_->push(image, {});
    }
  }

  std::unique_ptr<RtspServer> server_;
  std::jthread server_thread_;
  std::shared_ptr<RtspStream> stream_;
  std::unique_ptr<VideoEncoder> encoder_;
  std::vector<std::shared_ptr<const Image>> images_;
  std::array<std::atomic<Time>, kShades> captured_{};
  std::jthread thread_;
};

/// A port of this test's own for as long as this lives. Connections to it are refused until
/// somebody listens: the test itself, or a server, which binds it too (SO_REUSEADDR on both sides).
class Port {
 public:
  Port() : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const int on = 1;
    EXPECT_EQ(setsockopt(fd_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on), 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(fd_.get(), reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(getsockname(fd_.get(), reinterpret_cast<sockaddr*>(&address), &size), 0);
    number_ = ntohs(address.sin_port);
  }
  /// Accepts connections in the kernel; nobody answers until the test does.
  void listen() const { EXPECT_EQ(::listen(fd_.get(), 8), 0); }
  uint16_t number() const { return number_; }
  int fd() const { return fd_.get(); }

 private:
  UniqueFd fd_;
  uint16_t number_ = 0;
};

/// Answers one HTTP request after the other with the same parts, then closes.
class HttpCamera {
 public:
  HttpCamera(std::string header, std::vector<std::string> parts)
      : header_(std::move(header)), parts_(std::move(parts)) {
    port_.listen();
    thread_ = start_thread("http", [this](std::stop_token stop) { run(stop); });
  }
  ~HttpCamera() {
    thread_.request_stop();
    shutdown(port_.fd(), SHUT_RDWR);
    thread_.join();
  }
  std::string url(const std::string& rest = "/video?token=secret") const {
    return fmt::format("http://127.0.0.1:{}{}", port_.number(), rest);
  }

 private:
  void run(std::stop_token stop) {
    while (!stop.stop_requested()) {
      const UniqueFd client(accept(port_.fd(), nullptr, nullptr));
      if (client.get() < 0) return;
      char request[4096];
      if (recv(client.get(), request, sizeof request, 0) <= 0) continue;
      if (!say(client.get(), header_)) continue;
      for (const std::string& part : parts_) {
        if (!say(client.get(), part)) break;
        std::this_thread::sleep_for(20ms);
      }
    }
  }
  static bool say(int fd, const std::string& text) {
    return send(fd, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }

  Port port_;
  const std::string header_;
  const std::vector<std::string> parts_;
  std::jthread thread_;
};

constexpr const char* kMultipart =
    "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=cut\r\n\r\n";

std::string jpeg_of(int luma) {
  const auto image = gray_image(luma);
  const I420View view = image->view();
  const tjhandle handle = tjInitCompress();
  const unsigned char* planes[] = {view.y.data, view.u.data, view.v.data};
  const int strides[] = {static_cast<int>(view.y.stride), static_cast<int>(view.u.stride),
                         static_cast<int>(view.v.stride)};
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompressFromYUVPlanes(handle, planes, kWidth, strides, kHeight, TJSAMP_420, &bytes,
                                    &size, 90, 0),
            0);
  std::string jpeg(reinterpret_cast<const char*>(bytes), size);
  tjFree(bytes);
  tjDestroy(handle);
  return jpeg;
}

std::string part_of(const std::string& jpeg) {
  return fmt::format("--cut\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n",
                     jpeg.size()) +
         jpeg + "\r\n";
}

NetworkOptions options_for(const std::string& url) {
  NetworkOptions options;
  options.url = url;
  options.first_frame_timeout = 60s;  // sanitizers are slow
  options.frame_timeout = 20s;
  return options;
}

std::unique_ptr<FrameSource> open(const NetworkOptions& options) {
  auto source = open_network_source(options, CameraId(3), "cam");
  EXPECT_TRUE(source) << source.error().message();
  return *std::move(source);
}

/// The next frame, or the error; nothing else.
Result<FramePtr> next_frame(FrameSource& source) {
  const Time end = MonotonicClock::now() + 90s;
  while (MonotonicClock::now() < end) {
    SL_ASSIGN(const SourceStep step, source.next({}, 1s));
    if (step.kind == SourceStep::Kind::kFrame) return step.frame;
  }
  return make_error(ErrorCode::kTimeout, "test", "nothing came");
}

/// The error that ends it.
Error final_error(FrameSource& source) {
  for (;;) {
    const auto frame = next_frame(source);
    if (!frame) return frame.error();
  }
}

int middle_luma(const Frame& frame) { return frame.i420().y.row(kHeight / 2)[kWidth / 2]; }

TEST(RtspSource, GivesImages) {
  const RtspCamera camera;
  const auto source = open(options_for(camera.url()));
  uint64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    const auto frame = next_frame(*source);
    ASSERT_TRUE(frame) << frame.error().message();
    const FrameInfo& info = (*frame)->info();
    EXPECT_EQ(info.camera, CameraId(3));
    EXPECT_EQ(info.width, kWidth);
    EXPECT_EQ(info.height, kHeight);
    EXPECT_EQ(info.sequence, last + 1 + info.dropped_before);
    EXPECT_LE(info.capture, info.arrival);
    EXPECT_GT(info.capture_error, 0ns);
    last = info.sequence;
  }
}

TEST(RtspSource, TakesTheCamerasOwnTimesOnceItTellsThem) {
  const RtspCamera camera;
  const auto source = open(options_for(camera.url()));
  int right = 0;
  for (int i = 0; i < 1000 && right < 10; ++i) {
    const auto frame = next_frame(*source);
    ASSERT_TRUE(frame) << frame.error().message();
    const FrameInfo& info = (*frame)->info();
    if (info.device_clock == ClockLabel::kNone) {
      EXPECT_EQ(info.capture_error, 500ms);
      continue;
    }
    ASSERT_EQ(info.device_clock, ClockLabel::kRealtime);
    const Duration error = info.capture - camera.captured(middle_luma(**frame));
    EXPECT_LE(std::chrono::abs(error), info.capture_error) << to_seconds(error);
    ++right;
  }
  EXPECT_EQ(right, 10) << "no sender report came";
}

TEST(RtspSource, AServerThatGoesIsAnErrorAndItComesBack) {
  const Port port;
  auto camera = std::make_unique<RtspCamera>(port.number());
  const auto options = options_for(camera->url());
  auto source = open(options);
  ASSERT_TRUE(next_frame(*source));
  camera.reset();
  const Error gone = final_error(*source);
  EXPECT_TRUE(gone.code == ErrorCode::kUnavailable || gone.code == ErrorCode::kTimeout);
  EXPECT_THAT(gone.message(), HasSubstr("cam: rtsp://127.0.0.1"));
  source.reset();
  const Error still_gone = final_error(*open(options));
  EXPECT_EQ(still_gone.code, ErrorCode::kUnavailable);
  const RtspCamera again(port.number());
  source = open(options);
  EXPECT_TRUE(next_frame(*source));
}

TEST(RtspSource, AnotherSizeThanExpectedIsAnError) {
  const RtspCamera camera;
  auto options = options_for(camera.url());
  options.width = 640;
  options.height = 480;
  const Error error = final_error(*open(options));
  EXPECT_EQ(error.code, ErrorCode::kInvalidInput);
  EXPECT_THAT(error.text, HasSubstr("320x192"));
}

TEST(RtspSource, AnUnknownPathIsNamedAndThePasswordIsNot) {
  const RtspCamera camera;
  auto options = options_for(
      fmt::format("rtsp://someone:topsecret@127.0.0.1:{}/nothing?key=hidden", camera.port()));
  const Error error = final_error(*open(options));
  EXPECT_EQ(error.code, ErrorCode::kUnavailable);
  EXPECT_THAT(error.text, HasSubstr(fmt::format("127.0.0.1:{}/nothing", camera.port())));
  EXPECT_THAT(error.text, Not(HasSubstr("topsecret")));
  EXPECT_THAT(error.text, Not(HasSubstr("hidden")));
}

TEST(RtspSource, AServerThatSaysNothingIsSilent) {
  const Port port;
  port.listen();
  auto options = options_for(fmt::format("rtsp://127.0.0.1:{}/cam", port.number()));
  options.first_frame_timeout = 500ms;
  EXPECT_EQ(final_error(*open(options)).code, ErrorCode::kTimeout);
}

TEST(HttpSource, GivesTheImagesWithTheCamerasOwnBytes) {
  std::vector<std::string> jpegs, parts;
  for (int i = 0; i < 20; ++i) {
    jpegs.push_back(jpeg_of(60 + 5 * i));
    parts.push_back(part_of(jpegs.back()));
  }
  const HttpCamera camera(kMultipart, parts);
  const auto source = open(options_for(camera.url()));
  for (int i = 0; i < 3; ++i) {
    const auto frame = next_frame(*source);
    ASSERT_TRUE(frame) << frame.error().message();
    EXPECT_EQ((*frame)->info().width, kWidth);
    EXPECT_EQ((*frame)->info().format, PixelFormat::kMjpeg);
    EXPECT_EQ((*frame)->info().capture_error, 500ms);
    const auto bytes = (*frame)->payload().bytes;
    const std::string sent(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_THAT(jpegs, testing::Contains(sent));
  }
  const Error ended = final_error(*source);
  EXPECT_EQ(ended.code, ErrorCode::kUnavailable);
  EXPECT_THAT(ended.text, Not(HasSubstr("secret")));
}

TEST(HttpSource, ADamagedImageIsLeftOut) {
  const std::string good = jpeg_of(100);
  std::string torn = good;
  for (size_t i = torn.size() / 2; i < torn.size() / 2 + 40; ++i) torn[i] = '\xff';
  std::vector<std::string> parts;
  for (int i = 0; i < 6; ++i) parts.push_back(part_of(i % 2 == 0 ? torn : good));
  const HttpCamera camera(kMultipart, parts);
  const auto source = open(options_for(camera.url()));
  for (auto frame = next_frame(*source); frame; frame = next_frame(*source)) {
    const auto bytes = (*frame)->payload().bytes;
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), good);
  }
}

TEST(HttpSource, WhatIsNoVideoIsAnError) {
  const HttpCamera page("HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n",
                        {"<html>log in</html>"});
  EXPECT_EQ(final_error(*open(options_for(page.url()))).code, ErrorCode::kUnavailable);
  const HttpCamera closed("HTTP/1.0 401 Unauthorized\r\nContent-Length: 0\r\n\r\n", {});
  const Error refused = final_error(*open(options_for(closed.url())));
  EXPECT_EQ(refused.code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.text, Not(HasSubstr("secret")));
}

TEST(HttpSource, NobodyThereIsAnError) {
  const Port port;
  const Error error =
      final_error(*open(options_for(fmt::format("http://127.0.0.1:{}/", port.number()))));
  EXPECT_EQ(error.code, ErrorCode::kUnavailable);
}

TEST(NetworkUrl, TakesCredentialsOut) {
  const auto url = parse_network_url("rtsp://me:p%40ss:w@10.0.0.5:554/live?x=1", "cam");
  ASSERT_TRUE(url);
  EXPECT_EQ(url->user, "me");
  EXPECT_EQ(url->password, "p@ss:w");
  EXPECT_EQ(url->location, "rtsp://10.0.0.5:554/live?x=1");
  EXPECT_EQ(url->shown, "rtsp://10.0.0.5:554/live?...");
  EXPECT_EQ(url_for_messages("http://me:pw@[::1]:80"), "http://[::1]:80");
}

TEST(NetworkUrl, RefusesOtherTextsWithoutRepeatingThem) {
  for (const std::string bad : {"", "rtsp", "ftp://h/secret", "rtsp:///secret", "rtsp://secret@/x",
                                "rtsp://h/se cret", "rtsp://h/secret\n", "file:///secret"}) {
    const auto url = parse_network_url(bad, "cam");
    ASSERT_FALSE(url) << bad;
    EXPECT_EQ(url.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(url.error().text, Not(HasSubstr("secret")));
  }
}

}  // namespace
}  // namespace sightline::capture
