// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/replay_library.hpp"

#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

namespace fs = std::filesystem;

// Time for the other cameras of the recording to be opened before the first frame is due.
constexpr Duration kHeadStart = 500ms;

// In step, turns begin at multiples of their length in UTC: each host finds that out by itself.
std::shared_ptr<const ReplayClock> make_clock(const Recording& recording,
                                              const CameraConfig& camera) {
  const Time start = MonotonicClock::now() + kHeadStart;
  auto clock = std::make_shared<const ReplayClock>(recording, start);
  const int64_t turn = clock->loop_period().count();
  if (!camera.in_step || turn <= 0) return clock;
  const Duration over(utc_ns_of(start) % turn);
  const Duration shift = camera.loop ? -over : Duration(turn) - over;
  return std::make_shared<const ReplayClock>(recording, start + shift);
}

Result<size_t> index_in(const Recording& recording, const CameraConfig& camera) {
  for (size_t i = 0; i < recording.cameras.size(); ++i) {
    if (recording.cameras[i].name == camera.recorded_as) return i;
  }
  return make_error(ErrorCode::kNotFound, camera.place.text, "recording {} has no camera '{}'",
                    recording.path.string(), camera.recorded_as);
}

}  // namespace

Result<ReplayLibrary::Entry> ReplayLibrary::entry_or_turn(const fs::path& folder,
                                                          const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  for (;;) {
    const auto [found, first] = entries_.try_emplace(folder);
    if (first || found->second.recording) return found->second;
    const Waiting wait("the recording");
    const bool settled = settled_.wait(lock, stop, [&] {
      const auto now = entries_.find(folder);
      return now == entries_.end() || now->second.recording;
    });
    if (!settled) {
      return make_error(ErrorCode::kUnavailable, folder.string(), "stopped while it was opened");
    }
  }
}

// Without a recording: it could not be read, the next one may try.
void ReplayLibrary::settle(const fs::path& folder, const Entry& made) {
  std::lock_guard lock(mutex_);
  if (made.recording) {
    entries_[folder] = made;
  } else {
    entries_.erase(folder);
  }
  settled_.notify_all();
}

Result<ReplayLibrary::Entry> ReplayLibrary::entry(const CameraConfig& camera,
                                                  const std::stop_token& stop) {
  const fs::path& folder = camera.recording;
  SL_ASSIGN(const Entry known, entry_or_turn(folder, stop));
  if (known.recording) return known;
  struct Settler {
    ReplayLibrary& library;
    const fs::path& folder;
    Entry made;
    ~Settler() { library.settle(folder, made); }
  } settler{*this, folder, {}};
  const Waiting wait("the disk");
  SL_ASSIGN(Recording opened, open_recording(folder, RecordingMode::kReplay, stop));
  for (const std::string& warning : opened.warnings) log::warning("{}", warning);
  settler.made.clock = make_clock(opened, camera);
  settler.made.recording = std::make_shared<const Recording>(std::move(opened));
  return Entry(settler.made);  // a copy: what is settled must not be moved from
}

Result<std::unique_ptr<FrameSource>> ReplayLibrary::open(const CameraConfig& camera, CameraId id,
                                                         bool payload,
                                                         const std::stop_token& stop) {
  SL_ASSIGN(const Entry played, entry(camera, stop));
  SL_ASSIGN(const size_t index, index_in(*played.recording, camera));
  PacedReplayOptions options;
  options.loop = camera.loop;
  options.payload = payload;
  options.axes = axis_history_of(camera);
  options.time_offset = from_seconds(camera.calibration.time_offset_s);
  if (options.axes && played.recording->cameras[index].axes.empty()) {
    log::warning("{}: the camera turns, but {} has no angles of it: it has no vote", camera.name,
                 (camera.recording / "axes.csv").string());
  }
  const Waiting wait("the disk");
  return open_paced_replay(played.recording, index, id, played.clock, options);
}

Result<PixelFormat> ReplayLibrary::payload_format(const CameraConfig& camera) {
  SL_ASSIGN(const Entry played, entry(camera, {}));
  SL_ASSIGN(const size_t index, index_in(*played.recording, camera));
  const RecordedCamera& recorded = played.recording->cameras[index];
  // Whether packets can be passed on depends on the stream (reordered images), not on its codec.
  VideoReaderOptions options;
  options.payload = true;
  options.raw_format = recorded.pixels;
  SL_ASSIGN(auto reader, VideoReader::open(recorded.file, recorded.codec, recorded.width,
                                           recorded.height, options));
  SL_ASSIGN(const auto first, reader->next());
  return first ? first->format : PixelFormat::kI420;
}

std::vector<Duration> time_offsets(const Recording& recording, const Installation& installation) {
  std::vector<Duration> offsets(recording.cameras.size());
  for (size_t i = 0; i < offsets.size(); ++i) {
    for (const CameraConfig& camera : installation.cameras) {
      const std::string& name = camera.recorded_as.empty() ? camera.name : camera.recorded_as;
      if (name != recording.cameras[i].name) continue;
      offsets[i] = from_seconds(camera.calibration.time_offset_s);
    }
  }
  return offsets;
}

std::shared_ptr<AxisHistory> axis_history_of(const CameraConfig& camera) {
  const CalibratedCamera& calibration = camera.calibration;
  if (!calibration.axes) return nullptr;
  return std::make_shared<AxisHistory>(*calibration.axes, calibration.model.parameters().fx);
}

AxisHistories axis_histories(const Recording& recording, const Installation& installation) {
  AxisHistories histories(recording.cameras.size());
  for (size_t i = 0; i < histories.size(); ++i) {
    for (const CameraConfig& camera : installation.cameras) {
      const std::string& name = camera.recorded_as.empty() ? camera.name : camera.recorded_as;
      if (name != recording.cameras[i].name) continue;
      histories[i] = axis_history_of(camera);
      if (histories[i] && recording.cameras[i].axes.empty()) {
        log::warning("{}: the camera turns, but {} has no angles of it: it has no vote", name,
                     (recording.path / "axes.csv").string());
      }
    }
  }
  return histories;
}

}  // namespace sightline
