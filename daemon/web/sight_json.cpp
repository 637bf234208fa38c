// SPDX-License-Identifier: Apache-2.0
#include "web/sight_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

namespace sightline {

std::vector<SightCamera> sight_cameras(const System& system) {
  std::vector<SightCamera> cameras;
  for (size_t i = 0; i < system.cameras.size(); ++i) {
    const CameraWorker& worker = *system.cameras[i];
    if (!worker.present()) continue;
    SightCamera camera{CameraId(static_cast<uint32_t>(i)), system.rig->cameras[i]};
    if (system.installation.cameras[i].calibration.axes) {
      if (!worker.head()) continue;  // a recording's: nobody keeps where it is
      const AxisHistory& history = *worker.head()->history();
      const CameraPlace place =
          history.place(MonotonicClock::now() - from_seconds(history.axes().latency_s));
      if (!place.trusted()) continue;
      camera.world_from_camera = place.world_from_camera;
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

void add_sight(const System& system, const PoseTrack& track,
               const std::vector<SightCamera>& cameras, nlohmann::ordered_json& object) {
  const size_t index = track.object().index();
  const auto sights =
      forecast_sight(track, MonotonicClock::now(), *system.rig->objects.at(index).mesh, cameras);
  auto list = nlohmann::ordered_json::array();
  for (const Sight& sight : sights) {
    nlohmann::ordered_json entry{{"camera", system.cameras[sight.camera.index()]->name()},
                                 {"sees", sight.sees},
                                 {"share", std::round(sight.share * 100) / 100}};
    if (sight.changes_in) entry["changes_in_s"] = std::round(*sight.changes_in * 10) / 10;
    list.push_back(std::move(entry));
  }
  object["sight"] = std::move(list);
}

}  // namespace sightline
