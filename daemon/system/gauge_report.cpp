// SPDX-License-Identifier: Apache-2.0
#include "system/gauge_report.hpp"

namespace sightline {
namespace {

void show(Registry& registry, const std::string& queue, size_t depth) {
  registry
      .gauge("sightline_queue_depth", "The most that waited at once in the last half second",
             {{"queue", queue}})
      .set(static_cast<double>(depth));
}

void show_bytes(Registry& registry, const std::string& queue, size_t bytes) {
  registry.gauge("sightline_queue_bytes", "What waits now", {{"queue", queue}})
      .set(static_cast<double>(bytes));
}

void report_queues(const System& system, const RecordingManager& recordings, Registry& registry) {
  if (system.fusion) show(registry, "fuse", system.fusion->queue_peak());
  if (system.recorder) {
    show(registry, "record", system.recorder->queue_peak());
    show_bytes(registry, "record", system.recorder->queued_bytes());
  } else {
    registry.remove("queue", "record");
  }
  for (const auto& [name, worker] : {std::pair("rec:viewing", recordings.viewing()),
                                     std::pair("rec:poses", recordings.poses())}) {
    show(registry, name, worker->queue_peak());
    show_bytes(registry, name, worker->queued_bytes());
  }
  const auto encoding = [&](const auto& worker) {
    if (!worker->output()) return;
    registry
        .gauge("sightline_encoding_images", "Images that are in the encoder",
               {{"camera", worker->name()}})
        .set(static_cast<double>(worker->output()->encoding()));
  };
  for (const auto& camera : system.cameras) encoding(camera);
  for (const auto& view : system.views) encoding(view);
}

// Of the last half second: at one capture time one camera alone may have been heard.
void report_object(const System& system, size_t index, const PoseTrackPtr& track,
                   Registry& registry) {
  const std::string& object = system.rig->objects[index].named.name;
  const Time now = MonotonicClock::now();
  CameraSet cameras = 0;
  const PoseEstimate* newest = nullptr;
  if (track && !track->empty() && has_pose(track->newest().state)) newest = &track->newest();
  for (size_t i = track ? track->history().size() : 0; i-- > 0;) {
    const PoseEstimate& estimate = track->history()[i];
    if (estimate.time < now - std::chrono::milliseconds(500)) break;
    cameras |= estimate.cameras;
  }
  registry
      .gauge("sightline_object_sigma_meters", "Largest standard deviation of the position, 0: lost",
             {{"object", object}})
      .set(newest != nullptr ? newest->sigma_translation() : 0);
  registry
      .gauge("sightline_object_sigma_radians",
             "Largest standard deviation of the rotation, 0: lost", {{"object", object}})
      .set(newest != nullptr ? newest->sigma_rotation() : 0);
  for (size_t i = 0; i < system.cameras.size(); ++i) {
    if (!system.cameras[i]->observes()) continue;
    const bool took_part = (cameras & camera_bit(CameraId(static_cast<uint32_t>(i)))) != 0;
    registry
        .gauge("sightline_object_measured_by", "1 while the camera takes part in the estimate",
               {{"object", object}, {"camera", system.cameras[i]->name()}})
        .set(took_part ? 1 : 0);
  }
}

}  // namespace

void report_gauges(const System& system, const RecordingManager& recordings, Registry& registry) {
  report_queues(system, recordings, registry);
  if (!system.board || !system.rig) return;
  std::vector<PoseTrackPtr> tracks;
  system.board->read(tracks);
  const size_t count = std::min(tracks.size(), system.rig->objects.size());
  for (size_t i = 0; i < count; ++i) report_object(system, i, tracks[i], registry);
}

}  // namespace sightline
