// SPDX-License-Identifier: Apache-2.0
#include "workers/points_worker.hpp"

#include <algorithm>
#include <cmath>

#include "sightline/base/priority.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 50ms;
constexpr Duration kBefore = 200ms;
constexpr Duration kStallLimit = 10s;
constexpr size_t kMinPoints = 30;
constexpr double kFar = 0.005;  // [m] from the mesh, median, beside the pose's own sigma
constexpr double kSigmas = 3;
constexpr int kContradictions = 3;  // in a row

double rms(const std::vector<double>& values) {
  double squares = 0;
  for (const double value : values) squares += value * value;
  return values.empty() ? 0 : std::sqrt(squares / static_cast<double>(values.size()));
}

}  // namespace

std::unique_ptr<PointsWorker> PointsWorker::start(
    const PointsConfig& config, std::unique_ptr<ObjectPoints> finder, size_t cameras,
    const std::vector<NamedObject>& objects, std::shared_ptr<TrackBoard> board, Registry& registry,
    HeartbeatBoard& beats, double rest) {
  std::unique_ptr<PointsWorker> worker(new PointsWorker(config, std::move(finder), cameras, objects,
                                                        std::move(board), registry, rest));
  worker->thread_ = start_watched_thread(
      beats, "points", kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

PointsWorker::PointsWorker(const PointsConfig& config, std::unique_ptr<ObjectPoints> finder,
                           size_t cameras, const std::vector<NamedObject>& objects,
                           std::shared_ptr<TrackBoard> board, Registry& registry, double rest)
    : config_(config),
      rest_(rest),
      period_(from_seconds(1 / config.rate_hz)),
      finder_(std::move(finder)),
      board_(std::move(board)),
      runs_(registry.counter("sightline_points_reconstructions_total",
                             "Times stereo points were reconstructed")),
      dropped_(registry.counter("sightline_points_frames_dropped_total",
                                "Frames that came before stereo points were due again")),
      seconds_(registry.gauge("sightline_points_seconds", "Duration of the newest reconstruction")),
      against_(objects.size()),
      newest_(cameras),
      checks_(objects.size()) {
  for (const NamedObject& object : objects) {
    const Labels labels{{"object", object.name}};
    gauges_.push_back(
        {&registry.gauge("sightline_points", "Newest stereo points on the object", labels),
         &registry.gauge("sightline_points_rms_meters",
                         "Distance of these points from the mesh, rms", labels),
         &registry.gauge("sightline_points_contradict", "1 while stereo points contradict the pose",
                         labels)});
  }
}

void PointsWorker::push(const FramePtr& frame) {
  const size_t index = frame->info().camera.index();
  if (!wanted_ || frame->info().status == FrameStatus::kDamaged || index >= newest_.size()) return;
  FramePtr replaced = frame;  // released outside the lock
  {
    std::lock_guard lock(mutex_);
    newest_[index].swap(replaced);
  }
  if (replaced) dropped_.add();
}

void PointsWorker::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

ScenePointsPtr PointsWorker::points_at(Time time) const {
  const Duration fresh = std::max<Duration>(3 * period_.load(), 500ms);
  std::vector<PoseTrackPtr> tracks;
  board_->read(tracks);
  auto points = std::make_shared<ScenePoints>();
  points->time = time;
  const auto newest = found_.read();
  if (!newest) return nullptr;
  for (const ObjectPoints::Found& found : *newest) {
    const PoseTrackPtr& track = tracks[found.object.index()];
    if (time - found.time > fresh || !track) continue;
    const PoseAt at = track->at(time);
    if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) continue;
    const Rigid3 now_from_then = at.estimate.world_from_object * found.world_from_object.inverse();
    const Eigen::Matrix3d turn = now_from_then.rotation_matrix();
    points->cameras |= found.cameras;
    points->points.reserve(points->points.size() + found.points.size());
    for (const ScenePoint& point : found.points) {
      points->points.push_back({now_from_then * point.point_in_world,
                                turn * point.covariance * turn.transpose(), point.kind});
    }
  }
  return points->points.empty() ? nullptr : points;
}

std::vector<PointCheck> PointsWorker::checks() const {
  std::lock_guard lock(mutex_);
  return checks_;
}

void PointsWorker::run(std::stop_token stop, Heartbeat& heartbeat) {
  give_way(kPointsNice);
  const Duration period = from_seconds(1 / config_.rate_hz);
  Time next = MonotonicClock::now();
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const Time now = MonotonicClock::now();
    const bool tracked = anything_tracked();
    // Frames are only held for the moment before a reconstruction: drivers have few buffers.
    wanted_ = tracked && now + kBefore >= next;
    if (!tracked) forget();
    if (!tracked || now < next) {
      wait(stop, kTurn);
      continue;
    }
    reconstruct();
    wanted_ = false;
    const Time done = MonotonicClock::now();
    const double rest = rest_ * static_cast<double>((done - now).count());
    next = std::max(now + period, done + Duration(static_cast<int64_t>(rest)));
    period_ = next - now;
  }
}

bool PointsWorker::anything_tracked() {
  board_->read(tracks_);
  return std::any_of(tracks_.begin(), tracks_.end(), [](const PoseTrackPtr& track) {
    return track && !track->empty() && has_pose(track->newest().state);
  });
}

void PointsWorker::take_frames() {
  for (size_t i = 0; i < newest_.size(); ++i) {
    FramePtr frame;
    {
      std::lock_guard lock(mutex_);
      frame.swap(newest_[i]);
    }
    if (frame) finder_->add_frame(CameraId(static_cast<uint32_t>(i)), frame);
  }
}

// Nothing is tracked: no frame is held, and what was found says nothing any more.
void PointsWorker::forget() {
  let_go();
  if (!found_.read()) return;
  found_.publish(nullptr);
  for (const Gauges& gauges : gauges_) {
    for (Gauge* gauge : {gauges.points, gauges.rms, gauges.contradicts}) gauge->set(0);
  }
  std::ranges::fill(against_, 0);
  std::lock_guard lock(mutex_);
  std::ranges::fill(checks_, PointCheck());
}

void PointsWorker::let_go() {
  for (FramePtr& held : newest_) {
    FramePtr released;
    std::lock_guard lock(mutex_);
    released.swap(held);
  }
}

void PointsWorker::reconstruct() {
  const Time start = MonotonicClock::now();
  take_frames();
  std::vector<ObjectPoints::Found> found;
  finder_->find(tracks_, found);
  finder_->let_go();  // the cameras want their buffers back
  if (found.empty()) return;
  runs_.add();
  seconds_.set(to_seconds(MonotonicClock::now() - start));
  for (size_t i = 0; i < gauges_.size(); ++i) check(i, found);
  found_.publish(std::make_shared<const std::vector<ObjectPoints::Found>>(std::move(found)));
}

void PointsWorker::check(size_t object, const std::vector<ObjectPoints::Found>& found) {
  PointCheck check;
  std::vector<double> distances;
  for (const ObjectPoints::Found& each : found) {
    if (each.object.index() != object) continue;
    check.time = std::max(check.time, each.time);
    check.points += each.points.size();
    distances.insert(distances.end(), each.distances.begin(), each.distances.end());
  }
  if (check.time == Time{}) return;
  check.on_object = distances.size();
  check.rms_m = rms(distances);
  if (!distances.empty()) {
    const auto middle = distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    check.median_m = *middle;
  }
  const double sigma = tracks_[object]->newest().sigma_translation();
  const bool against = check.on_object >= kMinPoints && check.median_m > kFar + kSigmas * sigma;
  against_[object] = against ? against_[object] + 1 : 0;
  check.contradicts = against_[object] >= kContradictions;
  gauges_[object].points->set(static_cast<double>(check.on_object));
  gauges_[object].rms->set(check.rms_m);
  gauges_[object].contradicts->set(check.contradicts ? 1 : 0);
  std::lock_guard lock(mutex_);
  checks_[object] = check;
}

void PointsWorker::wait(std::stop_token stop, Duration duration) {
  std::unique_lock lock(mutex_);
  never_.wait_for(lock, stop, duration, [] { return false; });
}

}  // namespace sightline
