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

#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/stream/sei.hpp"
#include "stream/encoder_choice.hpp"
#include "stream/gst_ptr.hpp"
#include "stream/handover.hpp"

namespace sightline {

using namespace stream;

namespace {

/// What is known of an image while the encoder works on it.
struct Ticket {
  GstClockTime pts = 0;
  CameraId camera;
  uint64_t sequence = 0;
  Time capture{};
  std::vector<uint8_t> sei;
};

/// An image that waits for the encoder.
struct Waiting {
  std::shared_ptr<const Image> image;
  Ticket ticket;
};

/// What the encoder gets next.
struct Turn {
  GstMiniPtr<GstBuffer> buffer;
  bool as_keyframe = false;
};

GstMemory* wrap_plane(const PlaneView& plane, const std::shared_ptr<const Image>& owner) {
  using Owner = UserData<std::shared_ptr<const Image>>;
  // The last row ends where its pixels end: nothing beyond the plane is touched.
  const size_t size = static_cast<size_t>(plane.stride * (plane.height - 1) + plane.width);
  return gst_memory_new_wrapped(GST_MEMORY_FLAG_READONLY, const_cast<uint8_t*>(plane.data), size, 0,
                                size, Owner::make(owner), Owner::destroy);
}

/// A buffer over the image's own planes; they are given back when GStreamer drops the buffer.
GstBuffer* wrap_image(const std::shared_ptr<const Image>& image) {
  const I420View view = image->view();
  GstBuffer* buffer = gst_buffer_new();
  gsize offsets[GST_VIDEO_MAX_PLANES] = {};
  gint strides[GST_VIDEO_MAX_PLANES] = {};
  gsize offset = 0;
  int n = 0;
  for (const PlaneView& plane : {view.y, view.u, view.v}) {
    GstMemory* memory = wrap_plane(plane, image);
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
                      "cannot encode {}x{} images: width and height must be even and from 16 to "
                      "8192",
                      options.width, options.height);
  }
  if (!(options.rate_hz > 0 && options.rate_hz <= 1000) || options.bitrate_kbps < 0 ||
      options.keyframe_interval < 1) {
    return make_error(ErrorCode::kInvalidInput, camera,
                      "cannot encode at {} Hz, {} kbit/s with a key frame every {} images",
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
  bool idle = false;                ///< the source asked for an image and has none yet
  bool feeding = false;             ///< a thread is handing it one
  bool finishing = false;
  bool at_end = false;
  std::optional<Error> failed;
  std::optional<Waiting> waiting;
  std::deque<Ticket> tickets;  ///< handed to the encoder, oldest first
  uint64_t next_image = 0;
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
  bool refuses(const AnnotatedImage& image) const;
  Waiting prepare(const AnnotatedImage& image, std::span<const NamedObject> names);
  void feed(std::unique_lock<std::mutex>& lock);
  Turn take_turn(Waiting next);
  void hand_over(Turn turn);
  bool keyframe_is_due();
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

bool VideoEncoder::Impl::refuses(const AnnotatedImage& image) const {
  return failed.has_value() || finishing || !image.image || image.image->width() != options.width ||
         image.image->height() != options.height;
}

Waiting VideoEncoder::Impl::prepare(const AnnotatedImage& image,
                                    std::span<const NamedObject> names) {
  Waiting next{image.image, {}};
  next.ticket.camera = image.frame.camera;
  next.ticket.sequence = image.frame.sequence;
  next.ticket.capture = image.shown != Time{} ? image.shown : image.frame.capture;
  next.ticket.sei = make_sei_nal(sei_message_of(image, camera, names));
  return next;
}

/// Hands the source what waits for it, if it asked. The lock is held before and after, but not
/// while GStreamer is called: an element may post a message on the thread that hands it something,
/// and what an error says is noted under this lock.
void VideoEncoder::Impl::feed(std::unique_lock<std::mutex>& lock) {
  while (idle && waiting && !feeding && !failed) {
    Turn turn = take_turn(*std::exchange(waiting, std::nullopt));
    feeding = true;
    lock.unlock();
    hand_over(std::move(turn));
    lock.lock();
    feeding = false;
  }
  changed.notify_all();
}

Turn VideoEncoder::Impl::take_turn(Waiting next) {
  idle = false;
  // Evenly counted, not capture time: encoders want growing, regular time stamps, and the packet
  // gets its capture time back from the ticket.
  next.ticket.pts = next_image++ * period;
  Turn turn{GstMiniPtr<GstBuffer>(wrap_image(next.image)), keyframe_is_due()};
  set_times(turn.buffer.get(), next.ticket.pts, period);
  tickets.push_back(std::move(next.ticket));
  return turn;
}

void VideoEncoder::Impl::hand_over(Turn turn) {
  if (turn.as_keyframe) {
    gst_pad_send_event(encoder_pad.get(),
                       gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0));
  }
  handed_to_library(this);
  gst_app_src_push_buffer(GST_APP_SRC(source.get()), turn.buffer.release());
}

bool VideoEncoder::Impl::keyframe_is_due() {
  if (!keyframe_wanted) return false;
  const Time now = MonotonicClock::now();
  if (now < next_keyframe_request) return false;
  keyframe_wanted = false;
  next_keyframe_request = now + options.keyframe_request_spacing;
  return true;
}

void VideoEncoder::Impl::on_need_data() {
  std::unique_lock lock(mutex);
  idle = true;
  feed(lock);
}

std::optional<Ticket> VideoEncoder::Impl::take_ticket(GstClockTime pts) {
  std::lock_guard lock(mutex);
  // Drivers may round time stamps; images that the encoder skipped are older.
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
    log::warning("{}: encoder {} gave a packet that belongs to no image; dropped", camera, element);
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

void VideoEncoder::push(const AnnotatedImage& image, std::span<const NamedObject> names) {
  Impl& self = *impl_;
  std::optional<Waiting> replaced;  // given back outside the lock
  std::unique_lock lock(self.mutex);
  ++self.counts.pushed;
  if (self.refuses(image)) {
    ++self.counts.dropped;
    return;
  }
  if (self.waiting) ++self.counts.dropped;
  replaced = std::exchange(self.waiting, self.prepare(image, names));
  self.feed(lock);
}

Status VideoEncoder::push_and_wait(const AnnotatedImage& image, std::span<const NamedObject> names,
                                   Duration timeout) {
  Impl& self = *impl_;
  std::unique_lock lock(self.mutex);
  ++self.counts.pushed;
  const auto has_time = [&] { return self.idle && !self.waiting; };
  self.changed.wait_for(lock, timeout, [&] { return has_time() || self.failed.has_value(); });
  if (self.refuses(image) || !has_time()) {
    ++self.counts.dropped;
    if (self.failed) return Error(*self.failed);
    if (!has_time()) {
      return make_error(ErrorCode::kTimeout, self.camera, "encoder {} took no image in {:.1f} s",
                        self.element, to_seconds(timeout));
    }
    return make_error(ErrorCode::kInvalidInput, self.camera,
                      "the encoder is finished, or the image is not {}x{}", self.options.width,
                      self.options.height);
  }
  self.waiting = self.prepare(image, names);
  self.feed(lock);
  if (self.failed) return Error(*self.failed);
  return {};
}

Status VideoEncoder::finish(Duration timeout) {
  Impl& self = *impl_;
  std::unique_lock lock(self.mutex);
  self.finishing = true;
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  self.changed.wait_until(lock, deadline, [&] {
    return (self.idle && !self.waiting && !self.feeding) || self.failed.has_value();
  });
  if (!self.failed) {
    lock.unlock();
    gst_app_src_end_of_stream(GST_APP_SRC(self.source.get()));
    lock.lock();
  }
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
