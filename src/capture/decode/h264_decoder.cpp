// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/h264_decoder.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "capture/common/gst_ref.hpp"
#include "capture/common/gst_start.hpp"
#include "capture/common/gst_video.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::capture {
namespace {

// One thread and no frames in flight: an image must come out before the next unit goes in.
constexpr const char* kLine =
    "appsrc name=in is-live=true format=time block=false "
    "caps=video/x-h264,stream-format=(string)byte-stream,alignment=(string)au ! h264parse ! "
    "avdec_h264 max-threads=1 output-corrupt=false ! videoconvert ! "
    "video/x-raw,format=I420,colorimetry=(string){bt601,bt709} ! "
    "appsink name=out sync=false max-buffers=8";
// Presentation times only carry the unit's number.
constexpr GstClockTime kTick = GST_MSECOND;

}  // namespace

struct H264Decoder::State {
  ~State() {
    if (pipeline) gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    const GstCall call(this);
  }

  std::string where;
  int width = 0, height = 0;
  GstRef<GstElement> pipeline, in, out;
};

H264Decoder::H264Decoder(std::unique_ptr<State> state) : state_(std::move(state)) {}
H264Decoder::~H264Decoder() = default;

Result<std::unique_ptr<H264Decoder>> H264Decoder::create(int width, int height,
                                                         const std::string& where) {
  SL_RETURN_IF_ERROR(start_gstreamer_for_capture());
  auto state = std::make_unique<State>();
  state->where = where;
  state->width = width;
  state->height = height;
  GError* raw = nullptr;
  state->pipeline.reset(gst_parse_launch_full(kLine, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &raw));
  const GstRef<GError> error(raw);
  if (!state->pipeline || error) {
    return make_error(ErrorCode::kUnavailable, where,
                      "cannot decode H264: {}; install gstreamer1.0-libav and "
                      "gstreamer1.0-plugins-bad, or choose another format",
                      error ? error->message : "no reason given");
  }
  state->in.reset(gst_bin_get_by_name(GST_BIN(state->pipeline.get()), "in"));
  state->out.reset(gst_bin_get_by_name(GST_BIN(state->pipeline.get()), "out"));
  { const GstCall handed_over(state.get()); }
  gst_element_set_state(state->pipeline.get(), GST_STATE_PLAYING);
  return std::unique_ptr<H264Decoder>(new H264Decoder(std::move(state)));
}

Status H264Decoder::push(std::span<const uint8_t> unit, uint64_t number) {
  GstBuffer* const buffer = gst_buffer_new_allocate(nullptr, unit.size(), nullptr);
  gst_buffer_fill(buffer, 0, unit.data(), unit.size());
  GST_BUFFER_PTS(buffer) = GST_BUFFER_DTS(buffer) = number * kTick;
  const GstCall call(state_.get());
  if (gst_app_src_push_buffer(GST_APP_SRC(state_->in.get()), buffer) != GST_FLOW_OK) {
    return make_error(ErrorCode::kInternal, state_->where, "the H264 decoder has stopped");
  }
  return {};
}

Result<std::optional<uint64_t>> H264Decoder::pull(Duration limit, const MutableI420View& to) {
  auto* const sink = GST_APP_SINK(state_->out.get());
  const GstRef<GstSample> sample(
      gst_app_sink_try_pull_sample(sink, static_cast<GstClockTime>(limit.count())));
  const GstCall call(state_.get());
  if (!sample) {
    const GstRef<GstBus> bus(gst_element_get_bus(state_->pipeline.get()));
    GstMessage* const message = gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR);
    if (message == nullptr) return std::optional<uint64_t>();
    GError* raw = nullptr;
    gst_message_parse_error(message, &raw, nullptr);
    const GstRef<GError> error(raw);
    gst_message_unref(message);
    return make_error(ErrorCode::kInternal, state_->where, "the H264 decoder has stopped: {}",
                      error->message);
  }
  GstBuffer* const buffer = gst_sample_get_buffer(sample.get());
  GstVideoInfo info;
  GstVideoFrame image;
  if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())) ||
      GST_VIDEO_INFO_WIDTH(&info) != state_->width ||
      GST_VIDEO_INFO_HEIGHT(&info) != state_->height || !GST_BUFFER_PTS_IS_VALID(buffer)) {
    return make_error(ErrorCode::kDamaged, state_->where,
                      "the H264 stream holds {}x{} images, {}x{} were agreed on",
                      GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info), state_->width,
                      state_->height);
  }
  if (!gst_video_frame_map(&image, &info, buffer, GST_MAP_READ)) {
    return make_error(ErrorCode::kInternal, state_->where, "a decoded image cannot be read");
  }
  copy_i420(i420_view(image), to);
  gst_video_frame_unmap(&image);
  return std::optional(static_cast<uint64_t>(GST_BUFFER_PTS(buffer) / kTick));
}

}  // namespace sightline::capture
