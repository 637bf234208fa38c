// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "capture/common/gst_ref.hpp"
#include "capture/network/network_sockets.hpp"
#include "capture/network/network_url.hpp"
#include "capture/network/rtp_times.hpp"
#include "sightline/base/latest_slot.hpp"
#include "sightline/capture/network/network_source.hpp"

namespace sightline::capture {

/// An image that came out of the pipeline.
struct NetworkSample {
  std::shared_ptr<GstSample> sample;
  uint64_t number = 0;  ///< counts what came, also what was replaced by newer ones
  Time arrival{};       ///< when it was decoded
};

/// The GStreamer side of a network camera: connects, receives, decodes (RTSP) or cuts the answer
/// into JPEGs (HTTP), and hands over the newest. Works on threads of its own. Destroying it may
/// hang, where a camera answers without an end: see close_in_background().
class NetworkPipeline {
 public:
  static Result<std::unique_ptr<NetworkPipeline>> start(const NetworkUrl& url,
                                                        const NetworkOptions& options,
                                                        const std::string& name);
  ~NetworkPipeline();
  NetworkPipeline(const NetworkPipeline&) = delete;
  NetworkPipeline& operator=(const NetworkPipeline&) = delete;

  std::optional<NetworkSample> take(std::stop_token stop, Duration timeout);
  /// Fails if more has come since the newest image than any image takes. Call it while waiting.
  void watch_bytes();
  /// The connections, which end all waiting for the camera when they are cut.
  const std::shared_ptr<NetworkSockets>& sockets() const { return sockets_; }
  /// Whether watch_bytes() failed it.
  bool flooded() const { return flooded_; }
  /// Why no more images will come, if so.
  std::optional<Error> failure() const;
  /// CLOCK_MONOTONIC at the arrival of the image's first packet, if it is stamped.
  std::optional<Time> packet_arrival(GstSample* sample) const;
  /// The camera's own UTC time of the image, if it tells.
  std::optional<int64_t> sender_utc_ns(GstSample* sample) const;

 private:
  NetworkPipeline(NetworkUrl url, std::string name, uint64_t most_bytes)
      : url_(std::move(url)), name_(std::move(name)), most_bytes_(most_bytes) {}
  Status build(const NetworkOptions& options);
  void set_up_rtsp(GstElement* source, const NetworkOptions& options);
  void set_up_http(GstElement* source);
  void take_from(GstElement* sink);
  /// Whether the bytes of an HTTP answer may pass.
  bool count_http(gsize bytes);
  void note_flood(uint64_t bytes);
  void watch_rtp(GstElement* source);
  void fail(ErrorCode code, std::string text);
  void on_message(GstMessage* message);
  void on_sample(GstSample* sample);
  void on_rtp(GstPadProbeInfo* info);

  const NetworkUrl url_;
  const std::string name_;
  const uint64_t most_bytes_;  ///< without an image
  GstRef<GstElement> pipeline_;
  const std::shared_ptr<NetworkSockets> sockets_ = std::make_shared<NetworkSockets>();
  std::atomic<uint64_t> http_bytes_{0};      // since the newest image
  std::atomic<uint64_t> bytes_at_image_{0};  // that the sockets had received when it came
  std::atomic<bool> described_{false};       // an RTSP camera has told its streams
  std::atomic<bool> selected_{false};        // a stream of them
  std::atomic<bool> flooded_{false};
  LatestSlot<NetworkSample> newest_;

  // What GStreamer's threads write. They lock, also to see what was written before they began.
  mutable std::mutex mutex_;
  RtpTimes times_;
  std::optional<Error> failed_;
  uint64_t count_ = 0;
};

/// Gives up a pipeline on a thread of its own, which is waited for for half a second; then its
/// connections are cut, and that is waited for as long. False if it goes on even so.
bool close_in_background(std::unique_ptr<NetworkPipeline> pipeline, const std::string& name);
/// How many pipelines of this name go on so.
size_t closing_pipelines(const std::string& name);

}  // namespace sightline::capture
