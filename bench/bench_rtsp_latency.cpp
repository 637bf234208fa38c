// SPDX-License-Identifier: Apache-2.0

// Delay of the stream on loopback: from the hand-over of an image to the encoder to the decoded
// image in a GStreamer client of the same process, over TCP and over UDP. A 24-bit counter is
// painted into the image as black and white blocks, so the measurement needs nothing but pixels.
// Prints one JSON object. Usage: bench_rtsp_latency [PICTURES]

#include <fmt/format.h>
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "sightline/base/thread.hpp"
#include "sightline/stream/encoder.hpp"
#include "sightline/stream/rtsp_server.hpp"

namespace sightline {
namespace {

constexpr int kWidth = 1280, kHeight = 720, kBlock = 32, kBits = 24;
constexpr double kRate = 30;
constexpr int kWarmUp = 30;

/// Noise on a gradient, different for each of a few images, so that the encoder has work.
std::shared_ptr<Image> textured_image(unsigned seed) {
  auto image = std::make_shared<Image>(kWidth, kHeight);
  const MutableI420View view = image->mutable_view();
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 2);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      view.y.row(y)[x] = static_cast<uint8_t>(
          std::clamp(60.0 + (x / 8 + y / 8) % 120 + noise(random), 16.0, 235.0));
    }
  }
  for (const MutablePlaneView& plane : {view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, uint8_t{128});
  }
  return image;
}

void paint_counter(const MutablePlaneView& luma, uint32_t counter) {
  for (int bit = 0; bit < kBits; ++bit) {
    const uint8_t value = (counter >> bit & 1u) != 0 ? 235 : 16;
    for (int y = 0; y < kBlock; ++y) std::fill_n(luma.row(y) + bit * kBlock, kBlock, value);
  }
}

uint32_t read_counter(const uint8_t* luma, int stride) {
  uint32_t counter = 0;
  for (int bit = 0; bit < kBits; ++bit) {
    const int center = kBlock / 2 * stride + bit * kBlock + kBlock / 2;
    if (luma[center] > 128) counter |= 1u << bit;
  }
  return counter;
}

/// Time of each hand-over by counter, and the delays seen by the client.
struct Log {
  explicit Log(size_t images) : pushed_ns(images + 1000) {}
  std::vector<std::atomic<int64_t>> pushed_ns;
  std::vector<double> delays_ms;   ///< client's thread until the client has stopped
  std::vector<double> encoded_ms;  ///< encoder's thread: hand-over to packet
  std::atomic<size_t> seen{0};
};

GstFlowReturn on_decoded(GstAppSink* sink, gpointer data) {
  auto& log = *static_cast<Log*>(data);
  GstSample* sample = gst_app_sink_pull_sample(sink);
  const int64_t now = to_ns(MonotonicClock::now());
  GstVideoInfo info;
  GstVideoFrame frame;
  if (sample != nullptr && gst_video_info_from_caps(&info, gst_sample_get_caps(sample)) &&
      gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample), GST_MAP_READ)) {
    const uint32_t counter =
        read_counter(static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)),
                     GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0));
    if (counter < log.pushed_ns.size() && log.pushed_ns[counter] != 0) {
      log.delays_ms.push_back(static_cast<double>(now - log.pushed_ns[counter]) * 1e-6);
      ++log.seen;
    }
    gst_video_frame_unmap(&frame);
  }
  if (sample != nullptr) gst_sample_unref(sample);
  return GST_FLOW_OK;
}

GstElement* start_client(const std::string& url, const std::string& transport, Log& log) {
  const std::string text = fmt::format(
      "rtspsrc location={} latency=0 protocols={} ! rtph264depay ! h264parse ! avdec_h264 "
      "max-threads=1 ! appsink name=sink sync=false",
      url, transport);
  GstElement* pipeline = gst_parse_launch(text.c_str(), nullptr);
  GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "sink");
  GstAppSinkCallbacks callbacks{};
  callbacks.new_sample = on_decoded;
  gst_app_sink_set_callbacks(GST_APP_SINK(sink), &callbacks, &log, nullptr);
  gst_object_unref(sink);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  return pipeline;
}

std::string percentiles(std::vector<double> delays) {
  if (delays.size() > kWarmUp) delays.erase(delays.begin(), delays.begin() + kWarmUp);
  if (delays.empty()) return "null";
  std::sort(delays.begin(), delays.end());
  const auto at = [&](double share) {
    return delays[static_cast<size_t>(share * static_cast<double>(delays.size() - 1))];
  };
  return fmt::format(R"({{"images": {}, "p50_ms": {:.2f}, "p90_ms": {:.2f}, "p99_ms": {:.2f}, )"
                     R"("max_ms": {:.2f}}})",
                     delays.size(), at(0.5), at(0.9), at(0.99), delays.back());
}

Result<std::string> measure(const std::string& transport, size_t images) {
  RtspOptions rtsp;
  rtsp.port = 0;
  SL_ASSIGN(const auto server, RtspServer::create(rtsp));
  SL_ASSIGN(const auto stream, server->add_stream("bench", {kWidth, kHeight, kRate}));
  Log log(images);
  EncoderOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.rate_hz = kRate;
  SL_ASSIGN(const auto encoder,
            VideoEncoder::create(options, "bench", [stream, &log](EncodedPacket packet) {
              stream->push(packet);
              log.encoded_ms.push_back(to_seconds(MonotonicClock::now() - packet.capture) * 1e3);
            }));
  stream->on_keyframe_wanted([&encoder] { encoder->request_keyframe(); });
  std::vector<std::shared_ptr<Image>> ring;
  for (unsigned i = 0; i < 8; ++i) ring.push_back(textured_image(i));

  std::jthread serving = start_thread("rtsp", [&](std::stop_token stop) { server->run(stop); });
  GstElement* client = start_client(stream->url(), transport, log);
  const auto period = std::chrono::nanoseconds(static_cast<int64_t>(1e9 / kRate));
  auto next = std::chrono::steady_clock::now();
  // A client that never comes ends the measurement after as long again.
  for (uint32_t counter = 1; counter < log.pushed_ns.size() && log.seen < images; ++counter) {
    std::this_thread::sleep_until(next += period);
    if (!stream->wanted()) continue;
    const auto& image = ring[counter % ring.size()];
    paint_counter(image->mutable_view().y, counter);
    AnnotatedImage annotated;
    annotated.frame.sequence = counter;
    annotated.frame.capture = MonotonicClock::now();
    annotated.image = image;
    log.pushed_ns[counter] = to_ns(annotated.frame.capture);
    encoder->push(annotated, {});
  }
  gst_element_set_state(client, GST_STATE_NULL);
  gst_object_unref(client);
  stream->on_keyframe_wanted({});
  SL_RETURN_IF_ERROR(encoder->finish(std::chrono::seconds(5)));
  const EncoderCounts counts = encoder->counts();
  return fmt::format(
      R"({{"encoder": "{}", "encoded": {}, "dropped": {},
    "to_packet": {},
    "to_decoded": {}}})",
      encoder->encoder_name(), counts.encoded, counts.dropped, percentiles(log.encoded_ms),
      percentiles(log.delays_ms));
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  const size_t images = argc > 1 ? static_cast<size_t>(std::max(1, std::atoi(argv[1]))) : 600;
  gst_init(nullptr, nullptr);
  std::string result;
  for (const std::string transport : {"tcp", "udp"}) {
    const auto measured = sightline::measure(transport, images);
    if (!measured) {
      fmt::print(stderr, "{}\n", measured.error().message());
      return sightline::exit_code(measured.error());
    }
    result += fmt::format("{}  \"{}\": {}", result.empty() ? "" : ",\n", transport, *measured);
  }
  fmt::print("{{\n  \"what\": \"rtsp latency, 720p30, loopback\",\n{}\n}}\n", result);
  return 0;
}
