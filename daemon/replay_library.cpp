// SPDX-License-Identifier: Apache-2.0
#include "replay_library.hpp"

#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

// Time for the other cameras of the recording to be opened before the first frame is due.
constexpr Duration kHeadStart = 500ms;

Result<size_t> index_in(const Recording& recording, const CameraConfig& camera) {
  for (size_t i = 0; i < recording.cameras.size(); ++i) {
    if (recording.cameras[i].name == camera.recorded_as) return i;
  }
  return make_error(ErrorCode::kNotFound, camera.where, "recording {} has no camera '{}'",
                    recording.path.string(), camera.recorded_as);
}

}  // namespace

Result<ReplayLibrary::Entry> ReplayLibrary::entry(const std::filesystem::path& folder) {
  std::lock_guard lock(mutex_);
  const auto found = entries_.find(folder);
  if (found != entries_.end()) return found->second;
  SL_ASSIGN(Recording opened, open_recording(folder));
  for (const std::string& warning : opened.warnings) log::warning("{}", warning);
  Entry made;
  made.recording = std::make_shared<const Recording>(std::move(opened));
  made.clock =
      std::make_shared<const ReplayClock>(*made.recording, MonotonicClock::now() + kHeadStart);
  entries_.emplace(folder, made);
  return made;
}

Result<std::unique_ptr<FrameSource>> ReplayLibrary::open(const CameraConfig& camera, CameraId id,
                                                         bool payload) {
  SL_ASSIGN(const Entry played, entry(camera.recording));
  SL_ASSIGN(const size_t index, index_in(*played.recording, camera));
  PacedReplayOptions options;
  options.loop = camera.loop;
  options.payload = payload;
  return open_paced_replay(played.recording, index, id, played.clock, options);
}

Result<PixelFormat> ReplayLibrary::payload_format(const CameraConfig& camera) {
  SL_ASSIGN(const Entry played, entry(camera.recording));
  SL_ASSIGN(const size_t index, index_in(*played.recording, camera));
  const RecordedCamera& recorded = played.recording->cameras[index];
  // Whether packets can be passed on depends on the stream (reordered pictures), not on its codec.
  VideoReaderOptions options;
  options.payload = true;
  options.raw_format = recorded.pixels;
  SL_ASSIGN(auto reader, VideoReader::open(recorded.file, recorded.codec, recorded.width,
                                           recorded.height, options));
  SL_ASSIGN(const auto first, reader->next());
  return first ? first->format : PixelFormat::kI420;
}

}  // namespace sightline
