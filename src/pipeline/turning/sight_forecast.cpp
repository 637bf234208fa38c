// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/sight_forecast.hpp"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr double kStep = 0.1;        // [s]
constexpr double kEnough = 0.3;      // of the object: what is less is seldom measured
constexpr double kTolerance = 0.02;  // of the depth
constexpr int kAcross = 3;           // points along each edge of the box

bool is_before_scene(const StaticDepth* scene, const Eigen::Vector2d& pixel, double depth) {
  if (scene == nullptr || scene->empty()) return true;
  const int x = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, scene->width() - 1);
  const int y = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, scene->height() - 1);
  return scene->row(y)[x] * depth < 1 + kTolerance;
}

}  // namespace

double visible_share(const SightCamera& camera, const RenderMesh& object,
                     const Rigid3& world_from_object) {
  const CalibratedCamera& lens = camera.geometry->camera();
  const auto scene = camera.world_from_camera ? nullptr : camera.geometry->static_depth();
  const Rigid3 camera_from_object =
      camera.world_from_camera.value_or(lens.world_from_camera).inverse() * world_from_object;
  const Eigen::Vector3d low = object.min_corner.cast<double>();
  const Eigen::Vector3d size = object.max_corner.cast<double>() - low;
  int seen = 0, all = 0;
  for (int x = 0; x < kAcross; ++x) {
    for (int y = 0; y < kAcross; ++y) {
      for (int z = 0; z < kAcross; ++z, ++all) {
        const Eigen::Vector3d part = Eigen::Vector3d(x, y, z) / (kAcross - 1);
        const Eigen::Vector3d point = camera_from_object * (low + size.cwiseProduct(part));
        const auto pixel = lens.model.project(point);
        seen +=
            pixel && lens.model.contains(*pixel) && is_before_scene(scene.get(), *pixel, point.z());
      }
    }
  }
  return static_cast<double>(seen) / all;
}

std::vector<Sight> forecast_sight(const PoseTrack& track, Time now, const RenderMesh& object,
                                  std::span<const SightCamera> cameras) {
  std::vector<Sight> out;
  const PoseAt at = track.at(now);
  if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) return out;
  const Rigid3& here = at.estimate.world_from_object;
  const auto later = [&](double seconds) {
    return here * Rigid3::exp(seconds * at.estimate.twist);
  };
  for (const SightCamera& camera : cameras) {
    Sight sight;
    sight.camera = camera.camera;
    sight.share = visible_share(camera, object, here);
    sight.sees = sight.share >= kEnough;
    for (int i = 1; i * kStep <= kSightHorizon + 1e-9 && !sight.changes_in; ++i) {
      const bool then = visible_share(camera, object, later(i * kStep)) >= kEnough;
      if (then != sight.sees) sight.changes_in = i * kStep;
    }
    if (sight.sees || sight.changes_in) out.push_back(sight);
  }
  return out;
}

}  // namespace sightline
