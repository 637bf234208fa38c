// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/model/frame.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/video_reader.hpp"

namespace sightline {

struct ReplayCameraOptions {
  VideoReaderOptions reader;
  size_t keep_decoded_bytes = 0;  ///< pictures are kept if all of them fit
};

/// The rows of one recorded camera with their pictures, in order.
class ReplayCamera {
 public:
  static Result<std::unique_ptr<ReplayCamera>> open(std::shared_ptr<const Recording> recording,
                                                    size_t camera, CameraId id,
                                                    const ReplayCameraOptions& options);

  const RecordedCamera& camera() const { return recording_->cameras[index_]; }
  /// The next row; null at the end.
  const RecordedRow* row() const;
  /// The next row's picture as a frame with the times, sequence and losses of `stamp`.
  Result<FramePtr> take(const RecordedRow& stamp);
  /// Passes over the next row; its picture is decoded if later ones need it.
  Status skip();
  Status rewind();

 private:
  ReplayCamera(std::shared_ptr<const Recording> recording, size_t index, CameraId id)
      : recording_(std::move(recording)), index_(index), id_(id) {}
  Result<VideoFrame> take_picture();

  const std::shared_ptr<const Recording> recording_;
  const size_t index_;
  const CameraId id_;
  std::unique_ptr<VideoReader> reader_;
  std::shared_ptr<PicturePool> half_pool_;
  bool keep_ = false;
  size_t next_ = 0;
  std::vector<VideoFrame> kept_;
};

}  // namespace sightline
