// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "gst_ref.hpp"
#include "network_url.hpp"
#include "rtp_times.hpp"
#include "sightline/base/latest_slot.hpp"
#include "sightline/capture/network_source.hpp"

namespace sightline {

/// A picture that came out of the pipeline.
struct NetworkSample {
  std::shared_ptr<GstSample> sample;
  uint64_t number = 0;  ///< counts what came, also what was replaced by newer ones
  Time arrival{};       ///< when it was decoded
};

/// The GStreamer side of a network camera: connects, receives, decodes (RTSP) or cuts the answer
/// into JPEGs (HTTP), and hands over the newest. Works on threads of its own.
class NetworkPipeline {
 public:
  static Result<std::unique_ptr<NetworkPipeline>> start(const NetworkUrl& url,
                                                        const NetworkOptions& options,
                                                        const std::string& name);
  ~NetworkPipeline();
  NetworkPipeline(const NetworkPipeline&) = delete;
  NetworkPipeline& operator=(const NetworkPipeline&) = delete;

  std::optional<NetworkSample> take(std::stop_token stop, Duration timeout);
  /// Why no more pictures will come, if so.
  std::optional<Error> failure() const;
  /// CLOCK_MONOTONIC at the arrival of the picture's first packet, if it is stamped.
  std::optional<Time> packet_arrival(GstSample* sample) const;
  /// The camera's own UTC time of the picture, if it tells.
  std::optional<int64_t> sender_utc_ns(GstSample* sample) const;

 private:
  NetworkPipeline(NetworkUrl url, std::string name)
      : url_(std::move(url)), name_(std::move(name)) {}
  Status build(const NetworkOptions& options);
  void watch_rtp(GstElement* source);
  void fail(ErrorCode code, std::string text);
  void on_message(GstMessage* message);
  void on_sample(GstSample* sample);
  void on_rtp(GstPadProbeInfo* info);

  const NetworkUrl url_;
  const std::string name_;
  GstRef<GstElement> pipeline_;
  LatestSlot<NetworkSample> newest_;

  // What GStreamer's threads write. They lock, also to see what was written before they began.
  mutable std::mutex mutex_;
  RtpTimes times_;
  std::optional<Error> failed_;
  uint64_t count_ = 0;
};

}  // namespace sightline
