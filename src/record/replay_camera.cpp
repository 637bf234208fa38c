// SPDX-License-Identifier: Apache-2.0
#include "record/replay_camera.hpp"

#include "record/csv.hpp"

namespace sightline::record {
namespace {

size_t image_bytes(const RecordedCamera& camera) {
  return static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height) * 3 / 2;
}

}  // namespace

Result<std::unique_ptr<ReplayCamera>> ReplayCamera::open(std::shared_ptr<const Recording> recording,
                                                         size_t camera, CameraId id,
                                                         const ReplayCameraOptions& options) {
  SL_CHECK(camera < recording->cameras.size(), "no such camera in the recording");
  std::unique_ptr<ReplayCamera> replay(new ReplayCamera(std::move(recording), camera, id));
  const RecordedCamera& from = replay->camera();
  replay->axes_ = options.axes;
  replay->time_offset_ = options.time_offset;
  if (from.rows.empty()) return replay;  // its video need not be there
  VideoReaderOptions reader = options.reader;
  reader.raw_format = from.pixels;
  SL_ASSIGN(replay->reader_,
            VideoReader::open(from.file, from.codec, from.width, from.height, reader));
  replay->half_pool_ = std::make_shared<ImagePool>(from.width, from.height);
  replay->keep_ = from.rows.size() <= options.keep_decoded_bytes / image_bytes(from);
  return replay;
}

void ReplayCamera::go_to(size_t next) {
  next_ = next;
  row_.reset();
  if (next_ < camera().rows.size()) row_ = camera().rows[next_];
}

Result<VideoFrame> ReplayCamera::take_image() {
  if (next_ < kept_.size()) {
    VideoFrame kept = kept_[next_];
    go_to(next_ + 1);
    return kept;
  }
  Result<VideoFrame> image = ahead_.empty() ? decode() : std::move(ahead_.front());
  if (!ahead_.empty()) ahead_.pop_front();
  if (!image) return image;
  go_to(next_ + 1);
  if (keep_) kept_.push_back(*image);
  return image;
}

Result<VideoFrame> ReplayCamera::decode() {
  SL_ASSIGN(auto image, reader_->next());
  if (image) return *std::move(image);
  const size_t row = next_ + ahead_.size();
  return make_error(ErrorCode::kDamaged, camera().file.string(),
                    "ends after {} images; frames.csv line {} has no image", row,
                    row < camera().rows.size() ? camera().rows[row].line : 0);
}

bool ReplayCamera::decode_ahead(size_t most_bytes) {
  if (!reader_ || next_ < kept_.size()) return false;
  if (next_ + ahead_.size() >= camera().rows.size()) return false;
  if ((ahead_.size() + 1) * image_bytes(camera()) > most_bytes) return false;
  if (!ahead_.empty() && !ahead_.back()) return false;
  ahead_.push_back(decode());
  return true;
}

// A reading counts from its stamp on: live, too, nobody would have had it sooner.
CameraPlacePtr ReplayCamera::place_of(const RecordedRow& recorded, const RecordedRow& now) {
  const std::vector<AxisReading>& readings = camera().axes;
  while (next_reading_ < readings.size() && readings[next_reading_].stamp <= recorded.arrival) {
    axes_->add(readings[next_reading_++]);
  }
  CameraPlace place = axes_->place(recorded.capture + time_offset_);
  for (AxisReading& reading : place.readings) reading.stamp += now.capture - recorded.capture;
  return std::make_shared<const CameraPlace>(std::move(place));
}

Result<FramePtr> ReplayCamera::take(const RecordedRow& stamp) {
  const std::optional<RecordedRow> recorded = row_;
  SL_ASSIGN(VideoFrame image, take_image());
  FrameInfo info;
  info.camera = id_;
  info.sequence = stamp.sequence;
  info.dropped_before = stamp.dropped_before;
  info.status = image.status;
  info.capture = stamp.capture;
  info.arrival = stamp.arrival;
  info.format = image.format;
  info.width = camera().width;
  info.height = camera().height;
  if (axes_ && recorded) info.place = place_of(*recorded, stamp);
  return Frame::decoded(info, std::move(image.image), std::move(image.payload), half_pool_);
}

Status ReplayCamera::skip() {
  SL_ASSIGN(const VideoFrame ignored, take_image());
  return {};
}

Status ReplayCamera::rewind() {
  const bool all_kept = kept_.size() == camera().rows.size();
  go_to(0);
  next_reading_ = 0;
  if (axes_) axes_->clear();
  if (all_kept) {
    reader_.reset();  // its decoder and images are not needed any more
    return {};
  }
  kept_.clear();
  ahead_.clear();
  return reader_->rewind();
}

}  // namespace sightline::record
