// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "sightline/stream/rtsp_server.hpp"
#include "stream/gst_ptr.hpp"
#include "stream/rtp_clock.hpp"
#include "stream/sent_probe.hpp"

namespace sightline::stream {

/// The stream behind one mount point: the media pipelines that exist for it, and who plays it.
///
/// A pipeline's state is kept under the address of its GstRTSPMedia. There is one normally, but the
/// `unprepared` signal of an old one may come after a new one was configured, and must clear the
/// old one's state only.
class SharedStream : public RtspStream, public std::enable_shared_from_this<SharedStream> {
 public:
  SharedStream(std::string name, std::string url, const RtspStreamOptions& options);

  int viewers() const override;
  bool wanted() const override;
  void push(const EncodedPacket& packet) override;
  uint64_t dropped() const override;
  void on_wanted(std::function<void(bool wanted)> callback) override;
  void on_keyframe_wanted(std::function<void()> callback) override;
  void on_sent(std::function<void(Duration)> callback) override { sent_->set(std::move(callback)); }
  std::string url() const override { return url_; }

  /// The factory for the mount point; it keeps the stream alive. RTP over UDP is sent from one of
  /// `udp_addresses`; null: from any address.
  /// `inside_only`: RTP inside the RTSP connection alone, which is encrypted.
  GObjectPtr<GstRTSPMediaFactory> make_factory(GstRTSPAddressPool* udp_addresses, bool inside_only);

  void viewer_started(const GstRTSPClient* client, const std::string& session);
  void viewer_stopped(const GstRTSPClient* client, const std::string& session);
  void session_gone(const std::string& session);
  void client_gone(const GstRTSPClient* client);
  bool is_watched_by(const void* client) const;
  /// Lets go of all pipelines; push() does nothing from now on.
  void close();

 private:
  struct Media {
    GstObjectPtr<GstElement> source;
    RtpClock clock;
    bool needs_keyframe = true;
  };

  void add_media(GstRTSPMedia* media);
  void remove_media(const void* media);
  bool send(Media& media, const EncodedPacket& packet);
  void report_wanted();
  void ask_for_keyframe();

  const std::string name_;
  const std::string url_;
  const RtspStreamOptions options_;

  const SentReportPtr sent_ = std::make_shared<SentReport>();
  mutable std::mutex mutex_;
  std::map<const void*, Media> medias_;
  std::set<std::pair<const void*, std::string>> playing_;  ///< client, session
  bool closed_ = false;
  uint64_t dropped_ = 0;
  std::function<void()> keyframe_callback_;

  std::mutex report_mutex_;  ///< keeps reports in order; taken before mutex_
  std::function<void(bool)> wanted_callback_;
  bool reported_ = false;
};

}  // namespace sightline::stream
