// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "record/media/encoder.hpp"
#include "record/media/video_file.hpp"
#include "sightline/record/writer.hpp"

namespace sightline::record {

/// CAMERA.mkv of a recording that is being written. The file is made with the first image,
/// because its head holds what H.264 says of itself in the stream.
class CameraFile {
 public:
  static Result<std::unique_ptr<CameraFile>> create(const RecordingWriterCamera& camera,
                                                    RawStorage storage, std::filesystem::path path);

  const std::string& codec() const { return codec_; }
  const RecordingWriterCamera& camera() const { return camera_; }

  /// False if this frame cannot be taken: H.264 before a key frame, a damaged image.
  Result<bool> append(const Frame& frame, Duration since_start);
  /// After a gap: images that build on others go on at the next key frame.
  void wait_for_keyframe_if_coded() { needs_keyframe_ = codec_ == "h264"; }

  bool is_open() const { return file_ != nullptr; }
  Status flush() { return file_ ? file_->flush() : Status(); }
  Status sync() { return file_ ? file_->sync() : Status(); }
  Status close() { return file_ ? file_->close() : Status(); }

 private:
  CameraFile(const RecordingWriterCamera& camera, std::filesystem::path path)
      : camera_(camera),
        path_(std::move(path)),
        needs_keyframe_(camera.format == PixelFormat::kH264) {}
  Status open_file(const AVCodecParameters& parameters);
  Status open_for(std::span<const uint8_t> bytes);
  Status check_frame(const Frame& frame) const;
  Result<bool> append_compressed(const Frame& frame, Duration since_start);
  Status append_raw(const Frame& frame, Duration since_start);
  Status append_ffv1(std::span<const uint8_t> tight, Duration since_start);

  const RecordingWriterCamera camera_;
  const std::filesystem::path path_;
  std::string codec_;
  bool needs_keyframe_;
  std::unique_ptr<Encoder> encoder_;  ///< FFV1
  std::unique_ptr<VideoFile> file_;
  std::vector<uint8_t> scratch_;
};

}  // namespace sightline::record
