// SPDX-License-Identifier: Apache-2.0
#include "workers/calibration_keeper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/pipeline/calibration_proposal.hpp"
#include "sightline/pipeline/room_watch.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 500ms;
constexpr Duration kStallLimit = 10s;
constexpr Duration kBetweenProposals = 10s;
constexpr Duration kBetweenRooms = 15s;
constexpr Duration kOldLook = 10s;  // looks come once a second, verdicts every other
// A place that is taken over without being asked has been measured for so long, so well.
constexpr Duration kMeasured = 30s;
constexpr double kSure = 1;  // CameraWatch::look_ratio

std::string clock_text(Time time) {
  const auto seconds = static_cast<std::time_t>(utc_ns_of(time) / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%H:%M:%S UTC", &parts);
  return text;
}

std::string since_words(const CameraWatch& watch) {
  return watch.since_start ? "since before the start" : "since about " + clock_text(watch.since);
}

void log_event(const std::string& name, const CameraWatch& watch, CalibrationState before) {
  switch (watch.state) {
    case CalibrationState::kKnocked:
      log::warning("camera {}: knocked, {}: {}; it has {:.0f} % of its vote left", name,
                   since_words(watch), correction_words(watch), 100 * watch.vote);
      return;
    case CalibrationState::kDrifting:
      log::warning("camera {}: drifting, {}: {}; it has {:.0f} % of its vote left", name,
                   since_words(watch), correction_words(watch), 100 * watch.vote);
      return;
    case CalibrationState::kDisputed:
      log::warning("camera {}: contradicts another camera, {}; nobody tells which of them is wrong",
                   name, since_words(watch));
      return;
    case CalibrationState::kInOrder:
      if (before == CalibrationState::kUnknown) {
        log::debug("camera {}: agrees with its calibration", name);
      } else {
        log::info("camera {}: agrees with its calibration again", name);
      }
      return;
    case CalibrationState::kUnknown:
    case CalibrationState::kUnfit:
      return;
  }
}

}  // namespace

std::shared_ptr<CalibrationKeeper> CalibrationKeeper::start(Options options,
                                                            Installation installation,
                                                            std::shared_ptr<FusionWorker> fusion,
                                                            Registry& registry,
                                                            HeartbeatBoard& beats) {
  std::shared_ptr<CalibrationKeeper> keeper(new CalibrationKeeper(
      std::move(options), std::move(installation), std::move(fusion), registry));
  keeper->thread_ = WatchedThread(
      beats, "calib", kStallLimit,
      [raw = keeper.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return keeper;
}

CalibrationKeeper::CalibrationKeeper(Options options, Installation installation,
                                     std::shared_ptr<FusionWorker> fusion, Registry& registry)
    : options_(std::move(options)),
      installation_(std::move(installation)),
      fusion_(std::move(fusion)) {
  for (const CameraConfig& camera : installation_.cameras) {
    const Labels labels{{"camera", camera.name}};
    cameras_.push_back(
        {camera.name,
         &registry.gauge("sightline_camera_calibration_state",
                         "0 unknown, 1 in order, 2 knocked, 3 drifting, 4 disputed, 5 unfit",
                         labels),
         &registry.gauge("sightline_camera_turned_degrees",
                         "How far the camera is turned from its calibration", labels),
         &registry.gauge("sightline_camera_shifted_meters",
                         "How far the camera is shifted from its calibration", labels),
         &registry.gauge("sightline_camera_vote_ratio",
                         "Share of its weight that the camera has in the estimate", labels),
         &registry.gauge("sightline_camera_room_patches",
                         "Patches of the room that the camera found where it expects them",
                         labels)});
    cameras_.back().vote->set(1);
  }
}

bool CalibrationKeeper::stop_unless_waiting(Duration patience) {
  thread_.request_stop();
  return !thread_.joinable() || thread_.join_unless_waiting(patience);
}

void CalibrationKeeper::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (const auto watches = fusion_->calibration()) {
      const bool event = tell(*watches);
      const Time now = MonotonicClock::now();
      const bool wrong =
          std::ranges::any_of(*watches, [](const CameraWatch& w) { return is_wrong(w.state); });
      if (wrong != proposed_ || event || (wrong && now >= next_proposal_)) {
        propose(*watches);
        next_proposal_ = now + kBetweenProposals;
        if (wrong) recover(*watches);
      }
    }
    if (MonotonicClock::now() >= next_rooms_) keep_rooms();
    std::unique_lock lock(mutex_);
    never_.wait_for(lock, stop, kTurn, [] { return false; });
  }
  keep_rooms();
}

// Once for all of them.
void CalibrationKeeper::tell_light(const std::vector<CameraWatch>& watches) {
  const bool changed = std::ranges::any_of(watches, &CameraWatch::light_changed);
  if (changed && !light_changed_) {
    log::warning(
        "what most cameras see of their rooms has changed at once: the light? Until it is as "
        "before, their places are watched by the objects alone");
  }
  light_changed_ = changed;
}

bool CalibrationKeeper::tell(const std::vector<CameraWatch>& watches) {
  tell_light(watches);
  bool event = false;
  for (size_t i = 0; i < std::min(cameras_.size(), watches.size()); ++i) {
    Camera& camera = cameras_[i];
    const CameraWatch& watch = watches[i];
    const bool wrong = is_wrong(watch.state);
    camera.state->set(static_cast<double>(watch.state));
    camera.turned->set(wrong ? watch.correction.head<3>().norm() * 180 / std::numbers::pi : 0);
    camera.shifted->set(wrong ? watch.correction.tail<3>().norm() : 0);
    camera.vote->set(watch.vote);
    camera.patches->set(MonotonicClock::now() - watch.looked < kOldLook ? watch.patches : 0);
    if (watch.state == CalibrationState::kUnfit) {
      event |= tell_unfit(watches, i);
      continue;
    }
    camera.unfit.clear();
    // Nothing is known for a while of one that is put back; then it is in order again.
    if (watch.state == camera.said || watch.state == CalibrationState::kUnknown) continue;
    log_event(camera.name, watch, camera.said);
    camera.said = watch.state;
    event = true;
  }
  return event;
}

// Again if more is known: the other camera of two that were exchanged comes a moment later.
bool CalibrationKeeper::tell_unfit(const std::vector<CameraWatch>& watches, size_t index) {
  Camera& camera = cameras_[index];
  std::vector<std::string> names;
  for (const Camera& c : cameras_) names.push_back(c.name);
  std::string words = unfit_words(names, watches, index);
  if (camera.said == CalibrationState::kUnfit && words == camera.unfit) return false;
  log::warning({.camera = camera.name, .cause = "unfit"}, "camera {}: {}; it has no vote",
               camera.name, words);
  camera.said = CalibrationState::kUnfit;
  camera.unfit = std::move(words);
  return true;
}

void CalibrationKeeper::keep_rooms() {
  if (options_.rooms_file.empty() || !options_.rooms) return;
  const uint64_t version = options_.rooms->version();
  if (version == kept_rooms_) return;
  next_rooms_ = MonotonicClock::now() + kBetweenRooms;
  const Waiting waiting("the disk");
  const Status done = write_scene(options_.rooms_file, *options_.rooms);
  if (done) {
    kept_rooms_ = version;
  } else if (!rooms_failed_) {
    log::warning("what the cameras see of their room is not kept: {}", done.error().message());
  }
  rooms_failed_ = !done;
}

void CalibrationKeeper::propose(const std::vector<CameraWatch>& watches) {
  if (options_.proposal.empty()) return;
  const bool wrong =
      std::ranges::any_of(watches, [](const CameraWatch& w) { return is_wrong(w.state); });
  const Waiting waiting("the disk");
  if (!wrong) {
    // Also what a run before this one left, once every camera is known to be in order.
    const bool in_order = std::ranges::all_of(
        watches, [](const CameraWatch& w) { return w.state == CalibrationState::kInOrder; });
    std::error_code error;
    if (proposed_ || in_order) std::filesystem::remove(options_.proposal, error);
    proposed_ = false;
    return;
  }
  const Status done = write_proposal(options_.proposal, installation_, watches);
  if (!done && !failed_) {
    log::warning("no calibration is proposed: {}", done.error().message());
  } else if (done && !proposed_) {
    log::info("proposed calibration: {} (sightline calibrate accept)", options_.proposal.string());
  }
  failed_ = !done;
  proposed_ = true;
}

void CalibrationKeeper::recover(const std::vector<CameraWatch>& watches) {
  if (!installation_.watch.auto_recover || !options_.request_reload || recovered_ || failed_) {
    return;
  }
  std::vector<std::string> sure;
  const Time now = MonotonicClock::now();
  for (size_t i = 0; i < std::min(cameras_.size(), watches.size()); ++i) {
    const CameraWatch& watch = watches[i];
    if (watch.state != CalibrationState::kKnocked || now - watch.flagged < kMeasured) continue;
    if (watch.look_ratio < kSure) sure.push_back(cameras_[i].name);
  }
  if (sure.empty()) return;
  const Waiting waiting("the disk");
  auto accepted = accept_proposal(installation_.calibration, options_.proposal, sure);
  recovered_ = true;  // once, also if it cannot be done: the reload makes another of these
  if (!accepted) {
    log::error("the proposed calibration is not taken over: {}", accepted.error().message());
    return;
  }
  for (const AcceptedCamera& camera : accepted->cameras) {
    log::warning(
        "camera {}: new place taken over, turned {:.3f} deg, shifted {:.2f} mm; the "
        "calibration before is {}",
        camera.name, camera.turned_deg, camera.shifted_mm, accepted->kept.string());
  }
  std::error_code error;
  std::filesystem::remove(options_.proposal, error);
  options_.request_reload();
}

}  // namespace sightline
