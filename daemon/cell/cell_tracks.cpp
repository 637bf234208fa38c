// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_tracks.hpp"

#include <algorithm>

namespace sightline {

CellTracks::CellTracks(const CellParts& parts, const std::string& cell)
    : parts_(parts),
      topics_(cell),
      leader_(cell == parts.options.name ? "" : cell),
      sequences_(parts.names.objects.size()) {}

CellLeader::News CellTracks::on_claim(const CellHostState& claim, Time now) {
  const CellLeader::News news = leader_.hear(claim, now);
  if (news == CellLeader::News::kAnother) std::ranges::fill(sequences_, 0);
  return news;
}

CellVerdict CellTracks::judge(std::string_view topic, const CellTrack& track,
                              const ClockWatch& clock, Time now, size_t& object) const {
  if (topic != topics_.track(track.object)) return CellVerdict::kForeign;
  const auto& objects = parts_.names.objects;
  object = static_cast<size_t>(std::ranges::find(objects, track.object) - objects.begin());
  if (object == objects.size()) return CellVerdict::kForeign;
  if (!leader_.is(track.boot)) return CellVerdict::kForeign;
  if (!clock.state(now).fit) return CellVerdict::kClock;
  const Duration age(clock.utc_ns_of(now) - track.time_utc_ns);
  if (age > kOldest) return CellVerdict::kLate;
  if (-age > parts_.options.clock_limit + parts_.options.age_limit) return CellVerdict::kFuture;
  return track.sequence > sequences_[object] ? CellVerdict::kTaken : CellVerdict::kDuplicate;
}

CellVerdict CellTracks::read(std::string_view topic, std::string_view payload,
                             const ClockWatch& clock, Time now, Taken& taken) {
  const auto track = decode_track(payload);
  if (!track) return CellVerdict::kMalformed;
  size_t object = 0;
  const CellVerdict verdict = judge(topic, *track, clock, now, object);
  if (verdict != CellVerdict::kTaken) return verdict;
  sequences_[object] = track->sequence;
  PoseEstimate& estimate = taken.estimate = track->estimate;
  taken.term = track->term;
  estimate.object = ObjectId(static_cast<uint32_t>(object));
  estimate.time = clock.time_of(track->time_utc_ns);
  estimate.last_measured = clock.time_of(track->last_measured_utc_ns);
  for (size_t i = 0; i < parts_.names.cameras.size(); ++i) {
    const auto& cameras = track->cameras;
    if (std::ranges::find(cameras, parts_.names.cameras[i]) == cameras.end()) continue;
    estimate.cameras |= camera_bit(CameraId(static_cast<uint32_t>(i)));
  }
  return verdict;
}

}  // namespace sightline
