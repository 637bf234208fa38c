// SPDX-License-Identifier: Apache-2.0
#include "pipeline/view/rolling_view.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "pipeline/view/moved_term.hpp"
#include "sightline/geometry/rolling_shutter.hpp"

namespace sightline::pipeline {
namespace {

// As far back as who looks at a frame asks: colors are learned from the frame before.
constexpr Duration kAskedFor = std::chrono::milliseconds(300);

// The track, with what it says of a time said `delay` before.
PoseTrackPtr sooner(const PoseTrack& track, Time capture, Duration delay) {
  const std::vector<PoseEstimate>& all = track.history();
  auto first = std::lower_bound(all.begin(), all.end(), capture - kAskedFor,
                                [](const PoseEstimate& e, Time time) { return e.time < time; });
  if (first != all.begin()) --first;
  std::vector<PoseEstimate> history(first, all.end());
  for (PoseEstimate& estimate : history) {
    estimate.time -= delay;
    estimate.last_measured -= delay;
  }
  return std::make_shared<const PoseTrack>(track.object(), std::move(history), track.noise());
}

}  // namespace

RollingView::RollingView(CalibratedCamera camera, std::vector<Eigen::Vector3d> centers)
    : camera_(std::move(camera)), centers_(std::move(centers)) {}

Duration RollingView::delay_of(ObjectId object, const PoseEstimate& estimate) const {
  if (object.index() >= centers_.size()) return Duration(0);
  const Eigen::Vector3d center = estimate.world_from_object * centers_[object.index()];
  return from_seconds(row_delay_s(camera_, camera_.world_from_camera.inverse() * center));
}

void RollingView::look(const FrameInfo& info, std::span<const PoseTrackPtr> tracks) {
  if (info.place) camera_.world_from_camera = info.place->world_from_camera;
  tracks_.assign(tracks.begin(), tracks.end());
  motions_.clear();
  for (PoseTrackPtr& track : tracks_) {
    if (!track) continue;
    const PoseAt at = track->at(info.capture);
    PoseAt then = at;
    Duration delay{0};
    // Until its row is exposed it gets to another one.
    for (int round = 0; round < 2 && then.source != PoseSource::kNone; ++round) {
      delay = delay_of(track->object(), then.estimate);
      then = track->at(info.capture + delay);
    }
    if (then.source == PoseSource::kNone || delay == Duration(0)) continue;
    motions_.push_back({track->object(),
                        at.estimate.world_from_object.inverse() * then.estimate.world_from_object});
    track = sooner(*track, info.capture, delay);
  }
}

void RollingView::bring_back(std::span<Observation> observations) const {
  for (Observation& observation : observations) {
    const auto known = std::ranges::find(motions_, observation.object, &Motion::object);
    if (known == motions_.end()) continue;
    say_of_pose(Rigid3(), known->moved, observation);
  }
}

}  // namespace sightline::pipeline
