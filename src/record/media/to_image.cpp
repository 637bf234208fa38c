// SPDX-License-Identifier: Apache-2.0
#include "record/media/to_image.hpp"

#include "sightline/image/convert.hpp"

namespace sightline::record {
namespace {

/// The yuvj formats are the yuv ones with the range in the name.
AVPixelFormat without_range(int format) {
  switch (format) {
    case AV_PIX_FMT_YUVJ420P:
      return AV_PIX_FMT_YUV420P;
    case AV_PIX_FMT_YUVJ422P:
      return AV_PIX_FMT_YUV422P;
    case AV_PIX_FMT_YUVJ444P:
      return AV_PIX_FMT_YUV444P;
    case AV_PIX_FMT_YUVJ440P:
      return AV_PIX_FMT_YUV440P;
    default:
      return static_cast<AVPixelFormat>(format);
  }
}

bool is_full_range(const AVFrame& frame) {
  return frame.color_range == AVCOL_RANGE_JPEG || without_range(frame.format) != frame.format;
}

}  // namespace

I420View view_of(const AVFrame& frame) {
  const int half_width = (frame.width + 1) / 2, half_height = (frame.height + 1) / 2;
  return {{frame.data[0], frame.width, frame.height, frame.linesize[0]},
          {frame.data[1], half_width, half_height, frame.linesize[1]},
          {frame.data[2], half_width, half_height, frame.linesize[2]}};
}

Status ToImage::prepare_scaler(const AVFrame& frame, const std::string& where) {
  const AVPixelFormat format = without_range(frame.format);
  const bool full = is_full_range(frame);
  if (scaler_ && scaler_format_ == format && scaler_full_range_ == full) return {};
  scaler_.reset(sws_alloc_context());
  SL_CHECK(scaler_ != nullptr, "out of memory");
  const struct {
    const char* name;
    int64_t value;
  } settings[] = {
      {"srcw", frame.width},
      {"srch", frame.height},
      {"dstw", frame.width},
      {"dsth", frame.height},
      {"src_format", format},
      {"dst_format", AV_PIX_FMT_YUV420P},
      {"src_range", full ? 1 : 0},
      {"dst_range", 0},
      {"sws_flags", SWS_BILINEAR | SWS_ACCURATE_RND | SWS_BITEXACT},
  };
  for (const auto& [name, value] : settings) {
    SL_CHECK(av_opt_set_int(scaler_.get(), name, value, 0) >= 0, name);
  }
  const int code = sws_init_context(scaler_.get(), nullptr, nullptr);
  if (code < 0) {
    scaler_.reset();
    const char* name = av_get_pix_fmt_name(format);
    return make_error(ErrorCode::kInvalidInput, where, "cannot convert {} images: {}",
                      name ? name : "unknown", av::error_text(code));
  }
  scaler_format_ = format;
  scaler_full_range_ = full;
  return {};
}

Status ToImage::convert(const AVFrame& frame, Image& image, const std::string& where) {
  const MutableI420View to = image.mutable_view();
  if (frame.format == AV_PIX_FMT_YUV420P && !is_full_range(frame)) {
    copy_i420(view_of(frame), to);
    return {};
  }
  const auto raw = av::from_av(static_cast<AVPixelFormat>(frame.format));
  if (raw == PixelFormat::kGray || raw == PixelFormat::kY16) {
    // The same mapping as for a live gray camera.
    const auto bytes = static_cast<size_t>(frame.linesize[0]) * static_cast<size_t>(frame.height);
    return raw_to_i420(*raw, {frame.data[0], bytes}, frame.linesize[0], to);
  }
  SL_RETURN_IF_ERROR(prepare_scaler(frame, where));
  uint8_t* const planes[] = {to.y.data, to.u.data, to.v.data};
  const int strides[] = {static_cast<int>(to.y.stride), static_cast<int>(to.u.stride),
                         static_cast<int>(to.v.stride)};
  const int rows =
      sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, planes, strides);
  if (rows == frame.height) return {};
  return make_error(ErrorCode::kInternal, where, "swscale converted {} of {} rows", rows,
                    frame.height);
}

}  // namespace sightline::record
