// SPDX-License-Identifier: Apache-2.0
#include "network_pipeline.hpp"

#include <gst/app/gstappsink.h>

#include <algorithm>

#include "gst_start.hpp"

namespace sightline {
namespace {

// RTSP gives whatever the camera sends, decoded; HTTP only JPEGs, which are decoded by us,
// strictly. Full-range pictures are brought to the limited range that everything else works in.
constexpr const char* kRtspLine =
    "rtspsrc name=source ! capsfilter name=rtp caps=application/x-rtp,media=(string)video ! "
    "decodebin ! videoconvert ! "
    "video/x-raw,format=I420,colorimetry=(string){bt601,bt709} ! "
    "appsink name=sink sync=false max-buffers=1 drop=true";
constexpr const char* kHttpLine =
    "souphttpsrc name=source is-live=true do-timestamp=true ! multipartdemux single-stream=true ! "
    "jpegparse ! appsink name=sink sync=false max-buffers=1 drop=true";

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
gboolean wants_stream(GstElement*, guint, GstCaps* caps, gpointer) {
  const char* media = gst_structure_get_string(gst_caps_get_structure(caps, 0), "media");
  return media && std::string_view(media) == "video" ? TRUE : FALSE;
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
  std::unique_ptr<NetworkPipeline> made(new NetworkPipeline(url, name));
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
    set_text(source.get(), "latency", std::to_string(std::max(options.latency_ms, 0)));
    set_text(source.get(), "protocols", protocols_of(options.transport));
    set_text(source.get(), "tcp-timeout", "5000000");
    set_text(source.get(), "timeout", "2000000");
    g_signal_connect(source.get(), "select-stream", G_CALLBACK(wants_stream), nullptr);
    watch_rtp(source.get());
  } else {
    set_text(source.get(), "timeout", "5");
    set_text(source.get(), "retries", "0");
  }
  const GstRef<GstElement> sink(gst_bin_get_by_name(GST_BIN(raw_pipeline), "sink"));
  GstAppSinkCallbacks callbacks{};
  callbacks.new_sample = [](GstAppSink* appsink, gpointer self) {
    const GstCall call(self);
    const GstRef<GstSample> sample(gst_app_sink_pull_sample(appsink));
    if (sample) static_cast<NetworkPipeline*>(self)->on_sample(sample.get());
    return GST_FLOW_OK;
  };
  gst_app_sink_set_callbacks(GST_APP_SINK(sink.get()), &callbacks, this, nullptr);
  const GstRef<GstBus> bus(gst_element_get_bus(pipeline_.get()));
  gst_bus_set_sync_handler(
      bus.get(),
      [](GstBus*, GstMessage* message, gpointer self) {
        const GstCall call(self);
        static_cast<NetworkPipeline*>(self)->on_message(message);
        gst_message_unref(message);
        return GST_BUS_DROP;
      },
      this, nullptr);
  return {};
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

}  // namespace sightline
