// SPDX-License-Identifier: Apache-2.0
#include "stream/rtsp_stream.hpp"

#include "stream/rtsp_access.hpp"

#include <gst/app/gstappsrc.h>

#include "sightline/base/log.hpp"
#include "stream/handover.hpp"
#include "stream/packet_buffer.hpp"

namespace sightline::stream {
namespace {

/// Packets that may wait for a media pipeline's thread; more, and the stream skips to a key frame.
constexpr guint64 kMaxQueued = 8;

using StreamPtr = UserData<std::shared_ptr<SharedStream>>;

std::string launch_line(const RtspStreamOptions& options) {
  int numerator = 30, denominator = 1;
  gst_util_double_to_fraction(options.rate_hz, &numerator, &denominator);
  return fmt::format(
      "( appsrc name=src is-live=true do-timestamp=false format=time min-latency=0 max-bytes=0 "
      "max-buffers=0 max-time=0 caps=\"video/x-h264,stream-format=byte-stream,alignment=au,"
      "width={},height={},framerate={}/{}\" ! h264parse ! "
      "rtph264pay name=pay0 pt=96 config-interval=-1 aggregate-mode=zero-latency )",
      options.width, options.height, numerator, denominator);
}

/// Only then has the element a clock and the time base that goes with it. (Between the two a time
/// stamp would be hours ahead, and the sink would wait for it.)
bool is_playing(GstElement* element) {
  GstState state = GST_STATE_NULL;
  gst_element_get_state(element, &state, nullptr, 0);
  return state == GST_STATE_PLAYING;
}

/// The media's sinks send a packet at its capture time plus the pipeline's latency, which GStreamer
/// makes at least 20 ms (processing-deadline). With latency 0 that time is always past, so packets
/// leave when they are made. (Switching the sinks' clock off does not last: PLAY sets it again.)
void send_without_delay(GstElement* bin) {
  const GstObjectPtr<GstObject> pipeline(gst_object_get_parent(GST_OBJECT(bin)));
  if (pipeline && GST_IS_PIPELINE(pipeline.get())) {
    gst_pipeline_set_latency(GST_PIPELINE(pipeline.get()), 0);
  }
}

}  // namespace

SharedStream::SharedStream(std::string name, std::string url, const RtspStreamOptions& options)
    : name_(std::move(name)), url_(std::move(url)), options_(options) {}

int SharedStream::viewers() const {
  std::lock_guard lock(mutex_);
  return static_cast<int>(playing_.size());
}

bool SharedStream::wanted() const {
  std::lock_guard lock(mutex_);
  return !medias_.empty();
}

uint64_t SharedStream::dropped() const {
  std::lock_guard lock(mutex_);
  return dropped_;
}

void SharedStream::on_wanted(std::function<void(bool)> callback) {
  {
    std::lock_guard lock(report_mutex_);
    wanted_callback_ = std::move(callback);
    reported_ = false;
  }
  report_wanted();
}

void SharedStream::on_keyframe_wanted(std::function<void()> callback) {
  std::lock_guard lock(mutex_);
  keyframe_callback_ = std::move(callback);
}

void SharedStream::report_wanted() {
  std::lock_guard lock(report_mutex_);
  const bool now = wanted();
  if (now == reported_) return;
  reported_ = now;
  if (wanted_callback_) wanted_callback_(now);
}

void SharedStream::ask_for_keyframe() {
  std::function<void()> callback;
  {
    std::lock_guard lock(mutex_);
    callback = keyframe_callback_;
  }
  if (callback) callback();
}

void SharedStream::push(const EncodedPacket& packet) {
  bool lacks_keyframe = false;
  {
    std::lock_guard lock(mutex_);
    for (auto& [key, media] : medias_) lacks_keyframe |= !send(media, packet);
  }
  if (lacks_keyframe) ask_for_keyframe();
}

/// False if the media waits for a key frame now.
bool SharedStream::send(Media& media, const EncodedPacket& packet) {
  if (media.needs_keyframe && !packet.keyframe) return false;
  auto* source = GST_APP_SRC(media.source.get());
  if (!is_playing(media.source.get()) ||
      gst_app_src_get_current_level_buffers(source) >= kMaxQueued) {
    ++dropped_;
    media.needs_keyframe = true;
    return false;
  }
  media.needs_keyframe = false;
  GstBuffer* buffer = wrap_packet(packet.bytes);
  const GstObjectPtr<GstClock> clock(gst_element_get_clock(media.source.get()));
  const uint64_t pts = media.clock.running_time(
      to_ns(packet.capture), static_cast<int64_t>(gst_clock_get_time(clock.get())),
      static_cast<int64_t>(gst_element_get_base_time(media.source.get())));
  set_times(buffer, pts, GST_CLOCK_TIME_NONE);
  if (!packet.keyframe) mark_as_delta(buffer);
  gst_app_src_push_buffer(source, buffer);
  return true;
}

GObjectPtr<GstRTSPMediaFactory> SharedStream::make_factory(GstRTSPAddressPool* udp_addresses,
                                                           bool inside_only) {
  GObjectPtr<GstRTSPMediaFactory> factory(gst_rtsp_media_factory_new());
  gst_rtsp_media_factory_set_launch(factory.get(), launch_line(options_).c_str());
  gst_rtsp_media_factory_set_shared(factory.get(), TRUE);
  let_users_watch(factory.get());
  gst_rtsp_media_factory_set_latency(factory.get(), 0);
  gst_rtsp_media_factory_set_stop_on_disconnect(factory.get(), TRUE);
  gst_rtsp_media_factory_set_address_pool(factory.get(), udp_addresses);
  gst_rtsp_media_factory_set_protocols(
      factory.get(), inside_only ? GST_RTSP_LOWER_TRANS_TCP
                                 : static_cast<GstRTSPLowerTrans>(GST_RTSP_LOWER_TRANS_UDP |
                                                                  GST_RTSP_LOWER_TRANS_TCP));
  g_signal_connect_data(factory.get(), "media-configure",
                        G_CALLBACK(+[](GstRTSPMediaFactory*, GstRTSPMedia* media, gpointer self) {
                          const LibraryCall call(self);
                          StreamPtr::in(self)->add_media(media);
                        }),
                        StreamPtr::make(shared_from_this()), StreamPtr::destroy_closure,
                        static_cast<GConnectFlags>(0));
  return factory;
}

void SharedStream::add_media(GstRTSPMedia* media) {
  const GstObjectPtr<GstElement> bin(gst_rtsp_media_get_element(media));
  send_without_delay(bin.get());
  const GstObjectPtr<GstElement> payloader(
      gst_bin_get_by_name_recurse_up(GST_BIN(bin.get()), "pay0"));
  report_sent(payloader.get(), sent_);
  Media state;
  state.source =
      GstObjectPtr<GstElement>(gst_bin_get_by_name_recurse_up(GST_BIN(bin.get()), "src"));
  {
    std::lock_guard lock(mutex_);
    if (closed_) return;
    medias_.insert_or_assign(media, std::move(state));
  }
  g_signal_connect_data(media, "unprepared", G_CALLBACK(+[](GstRTSPMedia* gone, gpointer self) {
                          const LibraryCall call(self);
                          StreamPtr::in(self)->remove_media(gone);
                        }),
                        StreamPtr::make(shared_from_this()), StreamPtr::destroy_closure,
                        static_cast<GConnectFlags>(0));
  // A media that never got as far as being prepared ends without that signal.
  g_object_weak_ref(
      G_OBJECT(media),
      [](gpointer self, GObject* gone) {
        taken_from_library(self);
        StreamPtr::in(self)->remove_media(gone);
        StreamPtr::destroy(self);
      },
      StreamPtr::make(shared_from_this()));
  report_wanted();
  ask_for_keyframe();
}

void SharedStream::remove_media(const void* media) {
  {
    std::lock_guard lock(mutex_);
    if (medias_.erase(media) == 0) return;
    if (medias_.empty()) playing_.clear();
  }
  report_wanted();
}

void SharedStream::viewer_started(const GstRTSPClient* client, const std::string& session) {
  {
    std::lock_guard lock(mutex_);
    if (closed_) return;
    playing_.emplace(client, session);
  }
  log::debug("rtsp: a viewer of /{} starts", name_);
  ask_for_keyframe();
}

void SharedStream::viewer_stopped(const GstRTSPClient* client, const std::string& session) {
  std::lock_guard lock(mutex_);
  playing_.erase({client, session});
}

void SharedStream::session_gone(const std::string& session) {
  std::lock_guard lock(mutex_);
  std::erase_if(playing_, [&](const auto& viewer) { return viewer.second == session; });
}

void SharedStream::client_gone(const GstRTSPClient* client) {
  std::lock_guard lock(mutex_);
  std::erase_if(playing_, [&](const auto& viewer) { return viewer.first == client; });
}

bool SharedStream::is_watched_by(const void* client) const {
  std::lock_guard lock(mutex_);
  return std::any_of(playing_.begin(), playing_.end(),
                     [&](const auto& viewer) { return viewer.first == client; });
}

void SharedStream::close() {
  std::map<const void*, Media> gone;  // given back outside the lock
  {
    std::lock_guard lock(mutex_);
    closed_ = true;
    gone.swap(medias_);
    playing_.clear();
  }
  report_wanted();
}

}  // namespace sightline::stream
