// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "sightline/model/frame.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/video_reader.hpp"

namespace sightline::record {

struct ReplayCameraOptions {
  VideoReaderOptions reader;
  size_t keep_decoded_bytes = 0;  ///< images are kept if all of them fit
  /// Of a camera that turns: what its recorded angles are put into as time passes. Null: it stands.
  std::shared_ptr<AxisHistory> axes = nullptr;
  Duration time_offset{0};  ///< of the calibration: frames were taken so much later than stamped
};

/// The rows of one recorded camera with their images, in order.
class ReplayCamera {
 public:
  static Result<std::unique_ptr<ReplayCamera>> open(std::shared_ptr<const Recording> recording,
                                                    size_t camera, CameraId id,
                                                    const ReplayCameraOptions& options);

  const RecordedCamera& camera() const { return recording_->cameras[index_]; }
  /// The next row; empty at the end.
  const std::optional<RecordedRow>& row() const { return row_; }
  bool at_last_row() const { return next_ + 1 == camera().rows.size(); }
  /// The next row's image as a frame with the times, sequence and losses of `stamp`.
  Result<FramePtr> take(const RecordedRow& stamp);
  /// Decodes one more image than was asked for, if there is one and what is ahead then holds
  /// `most_bytes` at most; false: there is nothing left to do. What cannot be decoded is said by
  /// the take() that it is for.
  bool decode_ahead(size_t most_bytes);
  /// Passes over the next row; its image is decoded if later ones need it.
  Status skip();
  Status rewind();

 private:
  ReplayCamera(std::shared_ptr<const Recording> recording, size_t index, CameraId id)
      : recording_(std::move(recording)), index_(index), id_(id) {
    go_to(0);
  }
  void go_to(size_t next);
  /// Where the camera stood, as far as was known when the frame arrived. `now`: the stamps of the
  /// frame as it is played, by which those of the readings are moved, too.
  CameraPlacePtr place_of(const RecordedRow& recorded, const RecordedRow& now);
  Result<VideoFrame> take_image();
  /// The next of the video.
  Result<VideoFrame> decode();

  const std::shared_ptr<const Recording> recording_;
  const size_t index_;
  const CameraId id_;
  std::unique_ptr<VideoReader> reader_;
  std::shared_ptr<ImagePool> half_pool_;
  bool keep_ = false;
  size_t next_ = 0;
  std::optional<RecordedRow> row_;
  std::vector<VideoFrame> kept_;
  std::deque<Result<VideoFrame>> ahead_;  ///< decoded, of the rows from the next one on
  std::shared_ptr<AxisHistory> axes_;
  Duration time_offset_{0};
  size_t next_reading_ = 0;
};

}  // namespace sightline::record
