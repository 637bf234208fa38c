// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// One displayed image of a video file.
struct VideoFrame {
  uint64_t index = 0;  ///< from 0, in display order
  FrameStatus status = FrameStatus::kGood;
  /// I420, BT.601 limited range. An image that could not be decoded is the one before it (gray if
  /// there is none), with status kDamaged, so that counting stays right.
  std::shared_ptr<const Image> image;
  /// What `payload` holds; kI420 with an empty payload where there is none to give.
  PixelFormat format = PixelFormat::kI420;
  /// The camera's own bytes: a JPEG, an H.264 access unit (Annex B, parameter sets before key
  /// frames) or a raw image. Empty for codecs that no camera speaks, for streams with reordered
  /// images, and unless VideoReaderOptions::payload is set.
  FramePayload payload;
};

struct VideoReaderOptions {
  bool payload = false;
  /// Of "rawvideo", where the file itself cannot say it; unset: what the file says.
  std::optional<PixelFormat> raw_format;
};

/// Decodes one video file with libavcodec in the calling thread: exact counts, and the same
/// images in every run. Container timestamps are not used as times. Not thread-safe; any number
/// of readers may run in different threads.
class VideoReader {
 public:
  /// `codec` as in recording.toml; a file that holds another codec or size is an error.
  static Result<std::unique_ptr<VideoReader>> open(const std::filesystem::path& file,
                                                   const std::string& codec, int width, int height,
                                                   const VideoReaderOptions& options = {});
  virtual ~VideoReader() = default;

  /// The next image in display order; nullopt at the end. Holds at most the decoder's own
  /// reordering window of images.
  virtual Result<std::optional<VideoFrame>> next() = 0;
  /// Back to the first image.
  virtual Status rewind() = 0;
};

/// Images in a video file, by demuxing only. After `stop` it gives up between two images
/// (kUnavailable).
Result<uint64_t> count_video_frames(const std::filesystem::path& file, const std::string& codec,
                                    int width, int height, const std::stop_token& stop = {});

}  // namespace sightline
