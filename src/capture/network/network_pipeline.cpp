// SPDX-License-Identifier: Apache-2.0
#include "capture/network/network_pipeline.hpp"

#include <gst/app/gstappsink.h>

#include <algorithm>

#include "capture/common/background_close.hpp"
#include "capture/common/gst_start.hpp"

namespace sightline::capture {
namespace {

// RTSP gives whatever the camera sends, decoded; HTTP only JPEGs, which are decoded by us,
// strictly. Full-range images are brought to the limited range that everything else works in.
constexpr const char* kRtspLine =
    "rtspsrc name=source ! capsfilter name=rtp caps=application/x-rtp,media=(string)video ! "
    "decodebin ! videoconvert ! "
    "video/x-raw,format=I420,colorimetry=(string){bt601,bt709} ! "
    "appsink name=sink sync=false max-buffers=1 drop=true";
constexpr const char* kHttpLine =
    "souphttpsrc name=source is-live=true do-timestamp=true ! multipartdemux single-stream=true ! "
    "jpegparse ! appsink name=sink sync=false max-buffers=1 drop=true";

// What an RTSP camera tells of itself takes a few kilobytes. An image and what may precede it, when
// a camera joins in the middle of what a key frame began, takes no more than this.
constexpr uint64_t kMostOfDescription = uint64_t{256} << 10;
constexpr uint64_t kMostWithoutImage = uint64_t{64} << 20;
constexpr uint64_t kMostPerPixel = 4, kMostBesides = uint64_t{1} << 20;  // of a JPEG
constexpr Duration kClosePatience = std::chrono::milliseconds(500);

uint64_t most_bytes(const NetworkUrl& url, const NetworkOptions& options) {
  if (url.is_rtsp() || options.width <= 0 || options.height <= 0) return kMostWithoutImage;
  const uint64_t pixels =
      static_cast<uint64_t>(options.width) * static_cast<uint64_t>(options.height);
  return std::min(kMostWithoutImage, pixels * kMostPerPixel + kMostBesides);
}

void set_text(GstElement* element, const char* property, const std::string& value) {
  if (g_object_class_find_property(G_OBJECT_GET_CLASS(element), property)) {
    gst_util_set_object_arg(G_OBJECT(element), property, value.c_str());
  }
}

void set_credentials(GstElement* element, const std::string& user, const std::string& password) {
  if (user.empty()) return;
  g_object_set(element, "user-id", user.c_str(), "user-pw", password.c_str(), nullptr);
}

const char* protocols_of(RtspTransport transport) {
  switch (transport) {
    case RtspTransport::kTcp:
      return "tcp";
    case RtspTransport::kUdp:
      return "udp";
    case RtspTransport::kAuto:
      break;
  }
  return "tcp+udp-mcast+udp";
}

// Sound is not even asked for.
bool is_video(GstCaps* caps) {
  const char* media = gst_structure_get_string(gst_caps_get_structure(caps, 0), "media");
  return media && std::string_view(media) == "video";
}

void replace_all(std::string& text, const std::string& what, const std::string& with) {
  if (what.empty() || what == with) return;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at)) {
    text.replace(at, what.size(), with);
    at += with.size();
  }
}

std::string advice_for(const GError& error) {
  if (g_error_matches(&error, GST_CORE_ERROR, GST_CORE_ERROR_MISSING_PLUGIN) ||
      g_error_matches(&error, GST_STREAM_ERROR, GST_STREAM_ERROR_CODEC_NOT_FOUND)) {
    return "; install gstreamer1.0-libav, gstreamer1.0-plugins-good and -bad";
  }
  if (g_error_matches(&error, GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_AUTHORIZED)) {
    return "; check user and password";
  }
  return "";
}

}  // namespace

Result<std::unique_ptr<NetworkPipeline>> NetworkPipeline::start(const NetworkUrl& url,
                                                                const NetworkOptions& options,
                                                                const std::string& name) {
  SL_RETURN_IF_ERROR(start_gstreamer_for_capture());
  std::unique_ptr<NetworkPipeline> made(new NetworkPipeline(url, name, most_bytes(url, options)));
  SL_RETURN_IF_ERROR(made->build(options));
  { const GstCall handed_over(made.get()); }
  gst_element_set_state(made->pipeline_.get(), GST_STATE_PLAYING);
  return made;
}

NetworkPipeline::~NetworkPipeline() {
  if (!pipeline_) return;
  gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  const GstRef<GstBus> bus(gst_element_get_bus(pipeline_.get()));
  gst_bus_set_sync_handler(bus.get(), nullptr, nullptr, nullptr);
  const GstCall call(this);
}

Status NetworkPipeline::build(const NetworkOptions& options) {
  GError* raw = nullptr;
  pipeline_.reset(gst_parse_launch_full(url_.is_rtsp() ? kRtspLine : kHttpLine, nullptr,
                                        GST_PARSE_FLAG_FATAL_ERRORS, &raw));
  const GstRef<GError> error(raw);
  if (!pipeline_ || error) {
    return make_error(ErrorCode::kUnavailable, name_,
                      "cannot open {}: {}; install gstreamer1.0-plugins-good, -bad and "
                      "gstreamer1.0-libav",
                      url_.shown, error ? error->message : "no reason given");
  }
  GstObject* const raw_pipeline = GST_OBJECT(pipeline_.get());
  const GstRef<GstClock> clock(gst_system_clock_obtain());  // CLOCK_MONOTONIC
  gst_pipeline_use_clock(GST_PIPELINE(raw_pipeline), clock.get());
  const GstRef<GstElement> source(gst_bin_get_by_name(GST_BIN(raw_pipeline), "source"));
  g_object_set(source.get(), "location", url_.location.c_str(), nullptr);
  const bool own = !options.user.empty();
  set_credentials(source.get(), own ? options.user : url_.user,
                  own ? options.password : url_.password);
  if (url_.is_rtsp()) {
    set_up_rtsp(source.get(), options);
  } else {
    set_up_http(source.get());
  }
  const GstRef<GstElement> sink(gst_bin_get_by_name(GST_BIN(raw_pipeline), "sink"));
  take_from(sink.get());
  const GstRef<GstBus> bus(gst_element_get_bus(pipeline_.get()));
  gst_bus_set_sync_handler(
      bus.get(),
      [](GstBus*, GstMessage* message, gpointer self) {
        const GstCall call(self);
        auto* const pipeline = static_cast<NetworkPipeline*>(self);
        // The thread that says what it does is the one that connects next.
        NetworkSockets::claim_thread(pipeline->sockets_);
        pipeline->on_message(message);
        gst_message_unref(message);
        return GST_BUS_DROP;
      },
      this, nullptr);
  return {};
}

void NetworkPipeline::set_up_rtsp(GstElement* source, const NetworkOptions& options) {
  set_text(source, "latency", std::to_string(std::max(options.latency_ms, 0)));
  set_text(source, "protocols", protocols_of(options.transport));
  set_text(source, "tcp-timeout", "5000000");
  set_text(source, "timeout", "2000000");
  using DescriptionHandler = void (*)(GstElement*, gpointer, gpointer);
  static const DescriptionHandler on_description = [](GstElement*, gpointer, gpointer self) {
    auto* const pipeline = static_cast<NetworkPipeline*>(self);
    pipeline->described_ = true;
    pipeline->selected_ = false;  // it may be asked again, for another transport
  };
  g_signal_connect(source, "on-sdp", G_CALLBACK(on_description), this);
  using SelectHandler = gboolean (*)(GstElement*, guint, GstCaps*, gpointer);
  static const SelectHandler on_select = [](GstElement*, guint, GstCaps* caps,
                                            gpointer self) -> gboolean {
    if (!is_video(caps)) return FALSE;
    // One: a camera that claims thousands would have as many receivers.
    return static_cast<NetworkPipeline*>(self)->selected_.exchange(true) ? FALSE : TRUE;
  };
  g_signal_connect(source, "select-stream", G_CALLBACK(on_select), this);
  watch_rtp(source);
}

void NetworkPipeline::set_up_http(GstElement* source) {
  set_text(source, "timeout", "5");
  set_text(source, "retries", "0");
  const GstRef<GstPad> pad(gst_element_get_static_pad(source, "src"));
  gst_pad_add_probe(
      pad.get(), GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer self) {
        const GstCall call(self);
        GstBuffer* const buffer = gst_pad_probe_info_get_buffer(info);
        if (static_cast<NetworkPipeline*>(self)->count_http(gst_buffer_get_size(buffer))) {
          return GST_PAD_PROBE_OK;
        }
        gst_buffer_unref(buffer);
        GST_PAD_PROBE_INFO_DATA(info) = nullptr;
        GST_PAD_PROBE_INFO_FLOW_RETURN(info) = GST_FLOW_ERROR;  // the source ends
        return GST_PAD_PROBE_HANDLED;
      },
      this, nullptr);
}

void NetworkPipeline::take_from(GstElement* sink) {
  GstAppSinkCallbacks callbacks{};
  callbacks.new_sample = [](GstAppSink* appsink, gpointer self) {
    const GstCall call(self);
    const GstRef<GstSample> sample(gst_app_sink_pull_sample(appsink));
    if (sample) static_cast<NetworkPipeline*>(self)->on_sample(sample.get());
    return GST_FLOW_OK;
  };
  gst_app_sink_set_callbacks(GST_APP_SINK(sink), &callbacks, this, nullptr);
}

bool NetworkPipeline::count_http(gsize bytes) {
  const uint64_t sum = http_bytes_.fetch_add(bytes) + bytes;
  if (sum <= most_bytes_) return true;
  note_flood(sum);
  return false;
}

void NetworkPipeline::watch_bytes() {
  if (!url_.is_rtsp() || flooded_) return;
  const uint64_t before = bytes_at_image_;  // first: an image may come now
  const uint64_t sum = sockets_->received() - before;
  if (sum <= (described_ ? most_bytes_ : kMostOfDescription)) return;
  note_flood(sum);
  sockets_->cut();  // nothing else keeps it from reading on
}

void NetworkPipeline::note_flood(uint64_t bytes) {
  flooded_ = true;
  fail(ErrorCode::kDamaged,
       fmt::format("{}: the camera sent {} KiB without an image in them: it is none, or broken",
                   url_.shown, bytes >> 10));
}

// Sender reports are told by the jitter buffer, time stamps are in the packets behind it.
void NetworkPipeline::watch_rtp(GstElement* source) {
  using SyncHandler = void (*)(GstElement*, GstStructure*, gpointer);
  static const SyncHandler on_sync = [](GstElement*, GstStructure* sync, gpointer self) {
    const GstCall call(self);
    auto* pipeline = static_cast<NetworkPipeline*>(self);
    guint rate = 0;
    gst_structure_get_uint(sync, "clock-rate", &rate);
    const GValue* value = gst_structure_get_value(sync, "sr-buffer");
    if (!value || !GST_VALUE_HOLDS_BUFFER(value)) return;
    const MappedBuffer report(gst_value_get_buffer(value));
    std::lock_guard lock(pipeline->mutex_);
    pipeline->times_.set_clock_rate(rate);
    pipeline->times_.sender_report({report.data(), report.size()});
  };
  using JitterHandler = void (*)(GstElement*, GstElement*, guint, guint, gpointer);
  static const JitterHandler on_jitter_buffer = [](GstElement*, GstElement* buffer, guint, guint,
                                                   gpointer self) {
    g_signal_connect(buffer, "handle-sync", G_CALLBACK(on_sync), self);
  };
  using ManagerHandler = void (*)(GstElement*, GstElement*, gpointer);
  static const ManagerHandler on_manager = [](GstElement*, GstElement* manager, gpointer self) {
    if (g_signal_lookup("new-jitterbuffer", G_OBJECT_TYPE(manager)) != 0) {
      g_signal_connect(manager, "new-jitterbuffer", G_CALLBACK(on_jitter_buffer), self);
    }
  };
  g_signal_connect(source, "new-manager", G_CALLBACK(on_manager), this);
  const GstRef<GstElement> filter(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "rtp"));
  const GstRef<GstPad> pad(gst_element_get_static_pad(filter.get(), "src"));
  gst_pad_add_probe(
      pad.get(),
      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
      [](GstPad*, GstPadProbeInfo* info, gpointer self) {
        const GstCall call(self);
        static_cast<NetworkPipeline*>(self)->on_rtp(info);
        return GST_PAD_PROBE_OK;
      },
      this, nullptr);
}

void NetworkPipeline::on_rtp(GstPadProbeInfo* info) {
  const auto note = [this](GstBuffer* buffer) {
    if (!GST_BUFFER_PTS_IS_VALID(buffer)) return;
    const MappedBuffer packet(buffer);
    std::lock_guard lock(mutex_);
    times_.packet({packet.data(), packet.size()}, GST_BUFFER_PTS(buffer));
  };
  if (GstBuffer* buffer = gst_pad_probe_info_get_buffer(info)) {
    note(buffer);
  } else if (GstBufferList* list = gst_pad_probe_info_get_buffer_list(info)) {
    for (guint i = 0; i < gst_buffer_list_length(list); ++i) note(gst_buffer_list_get(list, i));
  }
}

void NetworkPipeline::on_sample(GstSample* sample) {
  NetworkSample next;
  next.sample = std::shared_ptr<GstSample>(gst_sample_ref(sample), GstUnref());
  next.arrival = MonotonicClock::now();
  http_bytes_ = 0;
  if (url_.is_rtsp()) bytes_at_image_ = sockets_->received();
  {
    std::lock_guard lock(mutex_);
    next.number = ++count_;
  }
  newest_.put(std::move(next));
}

void NetworkPipeline::fail(ErrorCode code, std::string text) {
  std::lock_guard lock(mutex_);
  if (!failed_) failed_ = Error{code, std::move(text), name_};
}

void NetworkPipeline::on_message(GstMessage* message) {
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS) {
    fail(ErrorCode::kUnavailable, fmt::format("{}: the camera ended the stream", url_.shown));
    return;
  }
  if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR) return;
  GError* raw = nullptr;
  gchar* raw_details = nullptr;
  gst_message_parse_error(message, &raw, &raw_details);
  const GstRef<GError> error(raw);
  const GstRef<gchar> details(raw_details);
  // The last line of the details says it best ("Unauthorized", "Connection refused").
  std::string text = error->message;
  if (details) {
    const std::string_view all(details.get());
    const size_t line = all.rfind('\n');
    if (line != std::string_view::npos) text.append(" ").append(all.substr(line + 1));
  }
  replace_all(text, url_.location, url_.shown);
  fail(ErrorCode::kUnavailable, fmt::format("{}: {}{}", url_.shown, text, advice_for(*error)));
}

std::optional<NetworkSample> NetworkPipeline::take(std::stop_token stop, Duration timeout) {
  const GstCall call(this);
  return newest_.take(std::move(stop), timeout);
}

std::optional<Error> NetworkPipeline::failure() const {
  std::lock_guard lock(mutex_);
  return failed_;
}

std::optional<Time> NetworkPipeline::packet_arrival(GstSample* sample) const {
  const GstClockTime pts = GST_BUFFER_PTS(gst_sample_get_buffer(sample));
  if (!GST_CLOCK_TIME_IS_VALID(pts)) return std::nullopt;
  const GstClockTime running =
      gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, pts);
  if (!GST_CLOCK_TIME_IS_VALID(running)) return std::nullopt;
  return time_from_ns(static_cast<int64_t>(running + gst_element_get_base_time(pipeline_.get())));
}

std::optional<int64_t> NetworkPipeline::sender_utc_ns(GstSample* sample) const {
  std::lock_guard lock(mutex_);
  return times_.utc_ns(GST_BUFFER_PTS(gst_sample_get_buffer(sample)));
}

bool close_in_background(std::unique_ptr<NetworkPipeline> pipeline, const std::string& name) {
  const std::shared_ptr<NetworkSockets> sockets = pipeline->sockets();
  // A std::function can be copied, what it holds then has to be, too.
  std::shared_ptr<NetworkPipeline> held(std::move(pipeline));
  auto close = [held = std::move(held)]() mutable { held.reset(); };
  return BackgroundCloses::of_process().run(name, std::move(close), kClosePatience,
                                            [&] { sockets->cut(); });
}

size_t closing_pipelines(const std::string& name) {
  return BackgroundCloses::of_process().pending(name);
}

}  // namespace sightline::capture
