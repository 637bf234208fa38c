// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/encoder.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/video/video.h>

#include <atomic>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <utility>

#include "encoder_choice.hpp"
#include "gst_ptr.hpp"
#include "handover.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/stream/sei.hpp"

namespace sightline {
namespace {

/// What is known of a picture while the encoder works on it.
struct Ticket {
  GstClockTime pts = 0;
  CameraId camera;
  uint64_t sequence = 0;
  Time capture{};
  std::vector<uint8_t> sei;
};

/// A picture that waits for the encoder.
struct Waiting {
  std::shared_ptr<const Picture> picture;
  Ticket ticket;
};

GstMemory* wrap_plane(const PlaneView& plane, const std::shared_ptr<const Picture>& owner) {
  using Owner = Carried<std::shared_ptr<const Picture>>;
  // The last row ends where its pixels end: nothing beyond the plane is touched.
  const size_t size = static_cast<size_t>(plane.stride * (plane.height - 1) + plane.width);
  return gst_memory_new_wrapped(GST_MEMORY_FLAG_READONLY, const_cast<uint8_t*>(plane.data), size, 0,
                                size, Owner::make(owner), Owner::destroy);
}

/// A buffer over the picture's own planes; they are given back when GStreamer drops the buffer.
GstBuffer* wrap_picture(const std::shared_ptr<const Picture>& picture) {
  const I420View view = picture->view();
  GstBuffer* buffer = gst_buffer_new();
  gsize offsets[GST_VIDEO_MAX_PLANES] = {};
  gint strides[GST_VIDEO_MAX_PLANES] = {};
  gsize offset = 0;
  int n = 0;
  for (const PlaneView& plane : {view.y, view.u, view.v}) {
    GstMemory* memory = wrap_plane(plane, picture);
    offsets[n] = offset;
    strides[n++] = static_cast<gint>(plane.stride);
    offset += gst_memory_get_sizes(memory, nullptr, nullptr);
    gst_buffer_append_memory(buffer, memory);
  }
  gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_I420,
                                 static_cast<guint>(view.width()),
                                 static_cast<guint>(view.height()), 3, offsets, strides);
  return buffer;
}

Status check(const EncoderOptions& options, const std::string& camera) {
  const bool size_ok = options.width >= 16 && options.height >= 16 && options.width <= 8192 &&
                       options.height <= 8192 && options.width % 2 == 0 && options.height % 2 == 0;
  if (!size_ok) {
    return make_error(ErrorCode::kInvalidInput, camera,
                      "cannot encode {}x{} pictures: width and height must be even and from 16 to "
                      "8192",
                      options.width, options.height);
  }
  if (!(options.rate_hz > 0 && options.rate_hz <= 1000) || options.bitrate_kbps < 0 ||
      options.keyframe_interval < 1) {
    return make_error(ErrorCode::kInvalidInput, camera,
                      "cannot encode at {} Hz, {} kbit/s with a key frame every {} pictures",
                      options.rate_hz, options.bitrate_kbps, options.keyframe_interval);
  }
  return {};
}

}  // namespace

int default_bitrate_kbps(int width, int height) {
  const double pixels = static_cast<double>(width) * height;
  const double exponent = std::log(2.0) / std::log(2.25);  // 1080p has 2.25 times 720p's pixels
  return std::max(
      100, static_cast<int>(std::lround(4000 * std::pow(pixels / (1280.0 * 720.0), exponent))));
}

struct VideoEncoder::Impl {
  EncoderOptions options;
  std::string camera;
  std::string element;
  OnPacket on_packet;
  GstClockTime period = 0;

  GstObjectPtr<GstElement> pipeline;
  GstObjectPtr<GstElement> source;
  GstObjectPtr<GstElement> sink;
  GstObjectPtr<GstPad> encoder_pad;

  mutable std::mutex mutex;
  std::condition_variable changed;  ///< idle, at_end or failed
  bool idle = false;                ///< the source asked for a picture and has none yet
  bool finishing = false;
  bool at_end = false;
  std::optional<Error> failed;
  std::optional<Waiting> waiting;
  std::deque<Ticket> tickets;  ///< handed to the encoder, oldest first
  uint64_t next_picture = 0;
  bool keyframe_wanted = false;
  Time next_keyframe_request = Time::min();  ///< not before
  EncoderCounts counts;

  ~Impl() {
    if (!pipeline) return;
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    taken_from_library(this);
    const GstObjectPtr<GstBus> bus(gst_element_get_bus(pipeline.get()));
    gst_bus_set_sync_handler(bus.get(), nullptr, nullptr, nullptr);
  }

  Status start();
  bool refuses(const AnnotatedPicture& picture) const;
  Waiting prepare(const AnnotatedPicture& picture, std::span<const NamedObject> names);
  void feed(Waiting next);
  void force_keyframe_if_due();
  void on_need_data();
  void on_sample(GstSample& sample);
  std::optional<Ticket> take_ticket(GstClockTime pts);
  void on_message(GstMessage& message);
  void fail(std::string text);
};

Status VideoEncoder::Impl::start() {
  SL_ASSIGN(pipeline, build_encoder_pipeline(element, options));
  source = element_of(pipeline.get(), "src");
  sink = element_of(pipeline.get(), "sink");
  encoder_pad.reset(gst_element_get_static_pad(element_of(pipeline.get(), "enc").get(), "src"));

  GstAppSrcCallbacks source_callbacks{};
  source_callbacks.need_data = [](GstAppSrc*, guint, gpointer self) {
    const LibraryCall call(self);
    static_cast<Impl*>(self)->on_need_data();
  };
  gst_app_src_set_callbacks(GST_APP_SRC(source.get()), &source_callbacks, this, nullptr);

  GstAppSinkCallbacks sink_callbacks{};
  sink_callbacks.new_sample = [](GstAppSink* appsink, gpointer self) {
    const LibraryCall call(self);
    const GstMiniPtr<GstSample> sample(gst_app_sink_pull_sample(appsink));
    if (sample) static_cast<Impl*>(self)->on_sample(*sample);
    return GST_FLOW_OK;
  };
  sink_callbacks.eos = [](GstAppSink*, gpointer self) {
    const LibraryCall call(self);
    auto* impl = static_cast<Impl*>(self);
    std::lock_guard lock(impl->mutex);
    impl->at_end = true;
    impl->changed.notify_all();
  };
  gst_app_sink_set_callbacks(GST_APP_SINK(sink.get()), &sink_callbacks, this, nullptr);

  // Every message is consumed here: nobody reads the bus, and it would grow without bound.
  const GstObjectPtr<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_bus_set_sync_handler(
      bus.get(),
      [](GstBus*, GstMessage* message, gpointer self) {
        const LibraryCall call(self);
        static_cast<Impl*>(self)->on_message(*message);
        gst_message_unref(message);
        return GST_BUS_DROP;
      },
      this, nullptr);
  handed_to_library(this);
  if (gst_element_set_state(pipeline.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE) {
    std::lock_guard lock(mutex);
    return make_error(ErrorCode::kUnavailable, camera, "encoder {} does not start: {}", element,
                      failed ? failed->text : "no reason given");
  }
  return {};
}

bool VideoEncoder::Impl::refuses(const AnnotatedPicture& picture) const {
  return failed.has_value() || finishing || !picture.picture ||
         picture.picture->width() != options.width || picture.picture->height() != options.height;
}

Waiting VideoEncoder::Impl::prepare(const AnnotatedPicture& picture,
                                    std::span<const NamedObject> names) {
  Waiting next{picture.picture, {}};
  next.ticket.camera = picture.frame.camera;
  next.ticket.sequence = picture.frame.sequence;
  next.ticket.capture = picture.shown != Time{} ? picture.shown : picture.frame.capture;
  next.ticket.sei = make_sei_nal(sei_message_of(picture, camera, names));
  return next;
}

/// With the lock held, and only when the source is idle.
void VideoEncoder::Impl::feed(Waiting next) {
  idle = false;
  force_keyframe_if_due();
  // Evenly counted, not capture time: encoders want growing, regular time stamps, and the packet
  // gets its capture time back from the ticket.
  next.ticket.pts = next_picture++ * period;
  GstBuffer* buffer = wrap_picture(next.picture);
  set_times(buffer, next.ticket.pts, period);
  tickets.push_back(std::move(next.ticket));
  handed_to_library(this);
  gst_app_src_push_buffer(GST_APP_SRC(source.get()), buffer);
}

void VideoEncoder::Impl::force_keyframe_if_due() {
  if (!keyframe_wanted) return;
  const Time now = MonotonicClock::now();
  if (now < next_keyframe_request) return;
  keyframe_wanted = false;
  next_keyframe_request = now + options.keyframe_request_spacing;
  gst_pad_send_event(encoder_pad.get(),
                     gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0));
}

void VideoEncoder::Impl::on_need_data() {
  std::lock_guard lock(mutex);
  idle = true;
  if (waiting) {
    Waiting next = std::move(*waiting);
    waiting.reset();
    feed(std::move(next));
  }
  changed.notify_all();
}

std::optional<Ticket> VideoEncoder::Impl::take_ticket(GstClockTime pts) {
  std::lock_guard lock(mutex);
  // Drivers may round time stamps; pictures that the encoder skipped are older.
  while (!tickets.empty() && tickets.front().pts + period / 2 < pts) {
    tickets.pop_front();
    ++counts.dropped;
  }
  if (tickets.empty() || tickets.front().pts > pts + period / 2) return std::nullopt;
  Ticket ticket = std::move(tickets.front());
  tickets.pop_front();
  ++counts.encoded;
  return ticket;
}

void VideoEncoder::Impl::on_sample(GstSample& sample) {
  GstBuffer* buffer = gst_sample_get_buffer(&sample);
  // Some encoders move time stamps and say so in the segment (x264enc: by 1000 hours).
  auto ticket = take_ticket(gst_segment_to_running_time(gst_sample_get_segment(&sample),
                                                        GST_FORMAT_TIME, pts_of(buffer)));
  if (!ticket) {
    log::warning("{}: encoder {} gave a packet that belongs to no picture; dropped", camera,
                 element);
    return;
  }
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) {
    fail("the encoded packet cannot be read");
    return;
  }
  EncodedPacket packet;
  packet.camera = ticket->camera;
  packet.codec = Codec::kH264;
  packet.sequence = ticket->sequence;
  packet.capture = ticket->capture;
  packet.keyframe = !is_delta(buffer);
  packet.bytes = std::make_shared<const std::vector<uint8_t>>(
      insert_sei(std::span(map.data, map.size), ticket->sei));
  gst_buffer_unmap(buffer, &map);
  if (on_packet) on_packet(std::move(packet));
}

void VideoEncoder::Impl::on_message(GstMessage& message) {
  if (GST_MESSAGE_TYPE(&message) == GST_MESSAGE_ERROR) {
    fail(text_of_error_message(&message));
  } else if (GST_MESSAGE_TYPE(&message) == GST_MESSAGE_STREAM_STATUS) {
    GstStreamStatusType type;
    gst_message_parse_stream_status(&message, &type, nullptr);
    if (type != GST_STREAM_STATUS_TYPE_ENTER) return;
    std::lock_guard lock(mutex);
    name_this_thread("enc-" + camera);
  }
}

void VideoEncoder::Impl::fail(std::string text) {
  std::lock_guard lock(mutex);
  if (failed) return;
  log::error("{}: encoder {} failed: {}", camera, element, text);
  failed = make_error(ErrorCode::kInternal, camera, "encoder {} failed: {}", element, text);
  counts.dropped += tickets.size() + (waiting ? 1 : 0);
  tickets.clear();
  waiting.reset();
  changed.notify_all();
}

VideoEncoder::VideoEncoder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoEncoder::~VideoEncoder() = default;

Result<std::unique_ptr<VideoEncoder>> VideoEncoder::create(const EncoderOptions& options,
                                                           std::string camera_name,
                                                           OnPacket on_packet) {
  SL_RETURN_IF_ERROR(check(options, camera_name));
  SL_ASSIGN(std::string element, choose_encoder(options, camera_name));
  auto impl = std::make_unique<Impl>();
  impl->options = options;
  if (options.bitrate_kbps == 0) {
    impl->options.bitrate_kbps = default_bitrate_kbps(options.width, options.height);
  }
  impl->period = static_cast<GstClockTime>(std::llround(1e9 / options.rate_hz));
  impl->camera = std::move(camera_name);
  impl->element = std::move(element);
  impl->on_packet = std::move(on_packet);
  SL_RETURN_IF_ERROR(impl->start());
  return std::unique_ptr<VideoEncoder>(new VideoEncoder(std::move(impl)));
}

void VideoEncoder::push(const AnnotatedPicture& picture, std::span<const NamedObject> names) {
  Impl& self = *impl_;
  std::optional<Waiting> replaced;  // given back outside the lock
  std::lock_guard lock(self.mutex);
  ++self.counts.pushed;
  if (self.refuses(picture)) {
    ++self.counts.dropped;
    return;
  }
  Waiting next = self.prepare(picture, names);
  if (self.idle) {
    self.feed(std::move(next));
    return;
  }
  if (self.waiting) ++self.counts.dropped;
  replaced = std::exchange(self.waiting, std::move(next));
}

Status VideoEncoder::push_and_wait(const AnnotatedPicture& picture,
                                   std::span<const NamedObject> names, Duration timeout) {
  Impl& self = *impl_;
  std::unique_lock lock(self.mutex);
  ++self.counts.pushed;
  self.changed.wait_for(lock, timeout, [&] { return self.idle || self.failed.has_value(); });
  if (self.refuses(picture) || !self.idle) {
    ++self.counts.dropped;
    if (self.failed) return Error(*self.failed);
    if (!self.idle) {
      return make_error(ErrorCode::kTimeout, self.camera, "encoder {} took no picture in {:.1f} s",
                        self.element, to_seconds(timeout));
    }
    return make_error(ErrorCode::kInvalidInput, self.camera,
                      "the encoder is finished, or the picture is not {}x{}", self.options.width,
                      self.options.height);
  }
  self.feed(self.prepare(picture, names));
  return {};
}

Status VideoEncoder::finish(Duration timeout) {
  Impl& self = *impl_;
  std::unique_lock lock(self.mutex);
  self.finishing = true;
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  self.changed.wait_until(lock, deadline,
                          [&] { return (self.idle && !self.waiting) || self.failed.has_value(); });
  if (!self.failed) gst_app_src_end_of_stream(GST_APP_SRC(self.source.get()));
  self.changed.wait_until(lock, deadline, [&] { return self.at_end || self.failed.has_value(); });
  if (self.failed) return Error(*self.failed);
  if (!self.at_end) {
    return make_error(ErrorCode::kTimeout, self.camera, "encoder {} did not finish in {:.1f} s",
                      self.element, to_seconds(timeout));
  }
  return {};
}

void VideoEncoder::request_keyframe() {
  std::lock_guard lock(impl_->mutex);
  impl_->keyframe_wanted = true;
}

const std::string& VideoEncoder::encoder_name() const { return impl_->element; }

EncoderCounts VideoEncoder::counts() const {
  std::lock_guard lock(impl_->mutex);
  return impl_->counts;
}

std::optional<Error> VideoEncoder::failure() const {
  std::lock_guard lock(impl_->mutex);
  return impl_->failed;
}

}  // namespace sightline
