// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/image/picture.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// One displayed picture of a video file.
struct VideoFrame {
  uint64_t index = 0;  ///< from 0, in display order
  FrameStatus status = FrameStatus::kGood;
  /// I420, BT.601 limited range. A picture that could not be decoded is the one before it (grey if
  /// there is none), with status kDamaged, so that counting stays right.
  std::shared_ptr<const Picture> picture;
  /// What `payload` holds; kI420 with an empty payload where there is none to give.
  PixelFormat format = PixelFormat::kI420;
  /// The camera's own bytes: a JPEG, an H.264 access unit (Annex B, parameter sets before key
  /// frames) or a raw picture. Empty for codecs that no camera speaks, for streams with reordered
  /// pictures, and unless VideoReaderOptions::payload is set.
  FramePayload payload;
};

struct VideoReaderOptions {
  bool payload = false;
  /// Of "rawvideo", where the file itself cannot say it; unset: what the file says.
  std::optional<PixelFormat> raw_format;
};

/// Decodes one video file with libavcodec in the calling thread: exact counts, and the same
/// pictures in every run. Container timestamps are not used as times. Not thread-safe; any number
/// of readers may run in different threads.
class VideoReader {
 public:
  /// `codec` as in recording.toml; a file that holds another codec or size is an error.
  static Result<std::unique_ptr<VideoReader>> open(const std::filesystem::path& file,
                                                   const std::string& codec, int width, int height,
                                                   const VideoReaderOptions& options = {});
  virtual ~VideoReader() = default;

  /// The next picture in display order; nullopt at the end. Holds at most the decoder's own
  /// reordering window of pictures.
  virtual Result<std::optional<VideoFrame>> next() = 0;
  /// Back to the first picture.
  virtual Status rewind() = 0;
};

/// Pictures in a video file, by demuxing only.
Result<uint64_t> count_video_frames(const std::filesystem::path& file, const std::string& codec,
                                    int width, int height);

}  // namespace sightline
