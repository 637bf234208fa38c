// SPDX-License-Identifier: Apache-2.0
#include "record/media/camera_file.hpp"

#include "record/media/raw_images.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/h264.hpp"

namespace sightline::record {
namespace {

std::string_view codec_for(PixelFormat format, RawStorage storage) {
  if (format == PixelFormat::kMjpeg) return "mjpeg";
  if (format == PixelFormat::kH264) return "h264";
  return storage == RawStorage::kFfv1 ? "ffv1" : "rawvideo";
}

Result<std::unique_ptr<Encoder>> make_ffv1(const RecordingWriterCamera& camera) {
  const auto format = planar_format(camera.format);
  if (!format) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "FFV1 does not hold this camera's pixel format; store it raw");
  }
  Encoder::Settings settings;
  settings.codec = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  settings.format = *format;
  settings.width = camera.width;
  settings.height = camera.height;
  // Checksums tell damage; a small context and Golomb-Rice coding are the fastest settings.
  settings.options = {{"level", "3"}, {"slicecrc", "1"}, {"coder", "rice"}, {"context", "0"}};
  if (!settings.codec) {
    return make_error(ErrorCode::kUnavailable, camera.name, "this libavcodec has no FFV1 encoder");
  }
  return Encoder::create(settings, camera.name);
}

}  // namespace

Result<std::unique_ptr<CameraFile>> CameraFile::create(const RecordingWriterCamera& camera,
                                                       RawStorage storage,
                                                       std::filesystem::path path) {
  std::unique_ptr<CameraFile> file(new CameraFile(camera, std::move(path)));
  file->codec_ = codec_for(camera.format, storage);
  if (file->codec_ == "ffv1") {
    SL_ASSIGN(file->encoder_, make_ffv1(camera));
  }
  return file;
}

Status CameraFile::open_file(const AVCodecParameters& parameters) {
  SL_ASSIGN(file_, VideoFile::create(path_, OutFile::Existing::kRefuse, parameters, 0));
  return file_->sync();
}

/// Makes the file for a first image of `bytes`.
Status CameraFile::open_for(std::span<const uint8_t> bytes) {
  if (encoder_) return open_file(*encoder_->parameters());
  std::vector<uint8_t> extradata;
  if (codec_ == "h264") extradata = annex_b_parameter_sets(bytes);
  const auto parameters =
      make_parameters(av::codec_id(codec_), camera_.width, camera_.height, extradata);
  if (const auto raw = av::to_av(camera_.format); raw && codec_ == "rawvideo") {
    parameters->format = *raw;
    parameters->codec_tag = avcodec_pix_fmt_to_codec_tag(*raw);
  }
  return open_file(*parameters);
}

Status CameraFile::check_frame(const Frame& frame) const {
  const FrameInfo& info = frame.info();
  // Every frame can be had as I420: a live camera may choose its format when it is plugged in.
  const bool as_i420 = camera_.format == PixelFormat::kI420 || frame.payload().bytes.empty();
  const PixelFormat format = as_i420 ? PixelFormat::kI420 : info.format;
  if (info.width != camera_.width || info.height != camera_.height || format != camera_.format) {
    return make_error(ErrorCode::kInvalidInput, camera_.name,
                      "sends {} x {} images in {}, the recording was begun for {} x {} in {}",
                      info.width, info.height, to_string(format), camera_.width, camera_.height,
                      to_string(camera_.format));
  }
  return {};
}

Result<bool> CameraFile::append(const Frame& frame, Duration since_start) {
  SL_RETURN_IF_ERROR(check_frame(frame));
  if (frame.payload().bytes.empty() && frame.info().status == FrameStatus::kDamaged) return false;
  if (codec_ == "h264" || codec_ == "mjpeg") return append_compressed(frame, since_start);
  SL_RETURN_IF_ERROR(append_raw(frame, since_start));
  return true;
}

Result<bool> CameraFile::append_compressed(const Frame& frame, Duration since_start) {
  const auto bytes = frame.payload().bytes;
  if (needs_keyframe_) {
    if (!annex_b_has_idr(bytes)) return false;
    if (!file_ && annex_b_parameter_sets(bytes).empty()) return false;
    needs_keyframe_ = false;
  }
  if (!file_) SL_RETURN_IF_ERROR(open_for(bytes));
  SL_RETURN_IF_ERROR(file_->write(bytes, since_start, frame.payload().keyframe));
  return true;
}

Status CameraFile::append_raw(const Frame& frame, Duration since_start) {
  SL_ASSIGN(const auto tight, tight_raw_image(frame, camera_.format, scratch_));
  if (!file_) SL_RETURN_IF_ERROR(open_for(tight));
  if (encoder_) return append_ffv1(tight, since_start);
  return file_->write(tight, since_start, true);
}

Status CameraFile::append_ffv1(std::span<const uint8_t> tight, Duration since_start) {
  SL_ASSIGN(AVFrame * frame, encoder_->frame());
  fill_planar(camera_.format, tight, *frame);
  const int64_t ms = std::chrono::duration_cast<std::chrono::milliseconds>(since_start).count();
  return encoder_->encode(ms, [&](AVPacket* packet) {
    return file_->write({packet->data, static_cast<size_t>(packet->size)}, since_start, true);
  });
}

}  // namespace sightline::record
