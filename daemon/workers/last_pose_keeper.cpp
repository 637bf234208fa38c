// SPDX-License-Identifier: Apache-2.0
#include "workers/last_pose_keeper.hpp"

#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 500ms;
constexpr int kTurnsBetween = 6;  // between two writes
constexpr Duration kStallLimit = 10s;
// What is nearer to the pose in the file is the same: a resting object is written once.
constexpr double kSamePlace = 0.005, kSameAngle = 0.02;  // [m, rad]

bool same(const Rigid3& a, const Rigid3& b) {
  return translation_distance(a, b) < kSamePlace && rotation_angle(a, b) < kSameAngle;
}

}  // namespace

std::shared_ptr<LastPoseKeeper> LastPoseKeeper::start(std::filesystem::path file,
                                                      std::vector<NamedObject> objects,
                                                      std::shared_ptr<TrackBoard> board,
                                                      HeartbeatBoard& beats) {
  std::shared_ptr<LastPoseKeeper> keeper(
      new LastPoseKeeper(std::move(file), std::move(objects), std::move(board)));
  keeper->thread_ = WatchedThread(
      beats, "last", kStallLimit,
      [raw = keeper.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return keeper;
}

LastPoseKeeper::LastPoseKeeper(std::filesystem::path file, std::vector<NamedObject> objects,
                               std::shared_ptr<TrackBoard> board)
    : file_(std::move(file)), objects_(std::move(objects)), board_(std::move(board)) {}

bool LastPoseKeeper::stop_unless_waiting(Duration patience) {
  thread_.request_stop();
  return !thread_.joinable() || thread_.join_unless_waiting(patience);
}

void LastPoseKeeper::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  {
    const Waiting waiting("the disk");
    // Of a damaged file nothing stays; whoever starts the search has said so.
    if (auto before = load_last_poses(file_)) {
      for (PoseLogRow& row : *before) written_[row.object] = std::move(row);
    }
  }
  newest_ = written_;
  for (int turn = 1; !stop.stop_requested(); ++turn) {
    heartbeat.beat();
    const bool moved = look();
    if (moved && turn % kTurnsBetween == 0) write();
    std::unique_lock lock(mutex_);
    never_.wait_for(lock, stop, kTurn, [] { return false; });
  }
  if (look()) write();
}

bool LastPoseKeeper::look() {
  board_->read(tracks_);
  bool moved = false;
  for (const NamedObject& object : objects_) {
    const PoseTrackPtr& track = tracks_.at(object.id.index());
    if (track && !track->empty() && track->newest().state == TrackState::kTracking) {
      newest_[object.name] = make_pose_log_row(track->newest(), object.name, {});
      newest_[object.name].cameras.clear();
    }
    const auto now = newest_.find(object.name), before = written_.find(object.name);
    if (now == newest_.end()) continue;
    moved = moved || before == written_.end() ||
            !same(*now->second.world_from_object, *before->second.world_from_object);
  }
  return moved;
}

void LastPoseKeeper::write() {
  std::vector<PoseLogRow> rows;
  for (const auto& [name, row] : newest_) rows.push_back(row);
  const Waiting waiting("the disk");
  const Status done = write_last_poses(file_, rows);
  if (!done && !failed_) {
    log::warning("the last poses are not kept: {}", done.error().message());
  }
  failed_ = !done;
  if (done) written_ = newest_;
}

}  // namespace sightline
