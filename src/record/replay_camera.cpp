// SPDX-License-Identifier: Apache-2.0
#include "replay_camera.hpp"

#include "csv.hpp"

namespace sightline {

Result<std::unique_ptr<ReplayCamera>> ReplayCamera::open(std::shared_ptr<const Recording> recording,
                                                         size_t camera, CameraId id,
                                                         const ReplayCameraOptions& options) {
  SL_CHECK(camera < recording->cameras.size(), "no such camera in the recording");
  std::unique_ptr<ReplayCamera> replay(new ReplayCamera(std::move(recording), camera, id));
  const RecordedCamera& from = replay->camera();
  if (from.rows.empty()) return replay;  // its video need not be there
  VideoReaderOptions reader = options.reader;
  reader.raw_format = from.pixels;
  SL_ASSIGN(replay->reader_,
            VideoReader::open(from.file, from.codec, from.width, from.height, reader));
  replay->half_pool_ = std::make_shared<PicturePool>(from.width, from.height);
  const size_t picture = static_cast<size_t>(from.width) * static_cast<size_t>(from.height) * 3 / 2;
  replay->keep_ = from.rows.size() <= options.keep_decoded_bytes / picture;
  return replay;
}

const RecordedRow* ReplayCamera::row() const {
  return next_ < camera().rows.size() ? &camera().rows[next_] : nullptr;
}

Result<VideoFrame> ReplayCamera::take_picture() {
  if (next_ < kept_.size()) return kept_[next_++];
  SL_ASSIGN(auto picture, reader_->next());
  if (!picture) {
    return make_error(ErrorCode::kDamaged, camera().file.string(),
                      "ends after {} pictures; frames.csv line {} has no picture", next_,
                      camera().rows[next_].line);
  }
  ++next_;
  if (keep_) kept_.push_back(*picture);
  return *std::move(picture);
}

Result<FramePtr> ReplayCamera::take(const RecordedRow& stamp) {
  SL_ASSIGN(VideoFrame picture, take_picture());
  FrameInfo info;
  info.camera = id_;
  info.sequence = stamp.sequence;
  info.dropped_before = stamp.dropped_before;
  info.status = picture.status;
  info.capture = stamp.capture;
  info.arrival = stamp.arrival;
  info.format = picture.format;
  info.width = camera().width;
  info.height = camera().height;
  return Frame::decoded(info, std::move(picture.picture), std::move(picture.payload), half_pool_);
}

Status ReplayCamera::skip() {
  SL_ASSIGN(const VideoFrame ignored, take_picture());
  return {};
}

Status ReplayCamera::rewind() {
  const bool all_kept = kept_.size() == camera().rows.size();
  next_ = 0;
  if (all_kept) {
    reader_.reset();  // its decoder and pictures are not needed any more
    return {};
  }
  kept_.clear();
  return reader_->rewind();
}

}  // namespace sightline
