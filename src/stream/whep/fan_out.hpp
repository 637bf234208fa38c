// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <string>

#include "sightline/stream/whep.hpp"
#include "stream/gst_ptr.hpp"
#include "stream/rtp_clock.hpp"
#include "stream/sent_probe.hpp"

namespace sightline::stream {

/// The stream of one camera: gives packets to the pipelines of its viewers.
class FanOut : public WhepStream {
 public:
  int viewers() const override { return count_; }
  bool wanted() const override { return count_ > 0; }
  void push(const EncodedPacket& packet) override;
  uint64_t dropped() const override;
  void on_keyframe_wanted(std::function<void()> callback) override;

  void on_sent(std::function<void(Duration)> callback) override { sent_->set(std::move(callback)); }
  const SentReportPtr& sent() const { return sent_; }

  /// A viewer's `source` (an appsrc that plays) gets packets from the next key frame on.
  void add(const std::string& id, GstElement* source);
  void remove(const std::string& id);
  void ask_for_keyframe();

 private:
  struct Viewer {
    GstObjectPtr<GstElement> source;
    RtpClock clock;
    bool needs_keyframe = true;
  };
  /// False if the viewer waits for a key frame now.
  bool send(Viewer& viewer, const EncodedPacket& packet);

  const SentReportPtr sent_ = std::make_shared<SentReport>();
  std::atomic<int> count_{0};
  mutable std::mutex mutex_;
  std::map<std::string, Viewer> viewers_;
  uint64_t dropped_ = 0;
  std::function<void()> keyframe_callback_;
};

}  // namespace sightline::stream
