// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "record/media/av.hpp"
#include "record/out_file.hpp"
#include "sightline/base/time.hpp"

namespace sightline::record {

/// Both can be read up to the last flush() after a crash; browsers play the second.
enum class Container { kMatroska, kFragmentedMp4 };

/// One video stream written into a file of ours, so that errors carry the system's reason and what
/// is flushed can be read after a crash.
class VideoFile {
 public:
  /// Writes the head and flushes it. `parameters` are copied.
  static Result<std::unique_ptr<VideoFile>> create(const std::filesystem::path& path,
                                                   OutFile::Existing existing,
                                                   const AVCodecParameters& parameters,
                                                   double rate_hz,
                                                   Container container = Container::kMatroska);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// Appends one image, shown `since_start` after the first; made to grow if it does not.
  Status write(std::span<const uint8_t> bytes, Duration since_start, bool keyframe);
  /// Appends a packet whose times count milliseconds already (they may be reordered).
  Status write(AVPacket* packet);
  /// Ends the cluster or fragment and hands everything to the operating system.
  Status flush();
  Status sync() { return file_.sync(); }
  /// Writes index and duration, where there are such. Only the first call does something.
  Status close();

 private:
  explicit VideoFile(OutFile file) : file_(std::move(file)) {}
  Status start(const AVCodecParameters& parameters, double rate_hz, Container container);
  Status check(const char* tried, int code);
  static int write_callback(void* self, const uint8_t* bytes, int size);
  static int64_t seek_callback(void* self, int64_t offset, int whence);

  OutFile file_;
  Status written_;  ///< first failure of the file
  AVFormatContext* format_ = nullptr;
  AVIOContext* io_ = nullptr;
  av::PacketPtr packet_;
  bool started_ = false;          ///< the head is written
  bool cut_ = false;              ///< a part of a fragment is of no use
  bool large_ = false;            ///< raw images
  int64_t size_ = 0, whole_ = 0;  ///< [bytes] written, and of these up to the last flush
  int64_t last_ms_ = -1;
};

/// Parameters of a video stream; free with avcodec_parameters_free (ParametersPtr does).
using ParametersPtr = std::unique_ptr<AVCodecParameters, av::Freer<avcodec_parameters_free>>;
ParametersPtr make_parameters(AVCodecID codec, int width, int height,
                              std::span<const uint8_t> extradata = {});

}  // namespace sightline::record
