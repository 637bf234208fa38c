// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "observe/detect/detector_frames.hpp"
#include "observe/detect/plan/search_distances.hpp"
#include "observe/detect/pose_fit.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {

/// An object at rest, so far from its cameras that it is small or large in their images: for tests
/// of looks at another size than half.
struct SizedScene {
  explicit SizedScene(const test::SceneRigOptions& options)
      : rig(options),
        cameras(test::detector_cameras(rig)),
        views(test::views_of(options.shape->mesh())),
        fitter(*views),
        truth(rig.truth(rig.shots().front().true_capture)) {}

  /// `place` in the middle of `count` cameras (up to three), `distance` [m] from each.
  static test::SceneRigOptions options(const TriangleMesh& mesh, const Eigen::Vector3d& place,
                                       double distance, size_t count = 3) {
    test::SceneRigOptions out =
        test::search_scene(mesh, test::resting(test::turned(0.8, {1, 2, 3}, place)));
    out.distance = distance;
    out.azimuths_deg.resize(count);
    return out;
  }

  /// The first frame of each camera, with looks at its size where the object may be as near or far
  /// as `range` says; `foreground`: of every camera, or null.
  DetectorFrames frames(const DetectorOptions& range,
                        const ForegroundMap* foreground = nullptr) const {
    DetectorFrames out(cameras, range);
    out.show_at_its_size(search_distances(cameras, views->radius(), range), fitter.width());
    test::add_first_frames(
        rig, [&](CameraId id, const Frame& frame) { out.add(id, frame, foreground); });
    EXPECT_TRUE(out.select(foreground != nullptr ? DetectorFrames::Where::kForeground
                                                 : DetectorFrames::Where::kEverywhere));
    return out;
  }

  /// Straight before a camera, `distance` [m] from it.
  Rigid3 before(const FitCamera& camera, double distance) const {
    const Rigid3& eye = camera.camera->world_from_camera;
    return {Eigen::Quaterniond::Identity(),
            eye.translation - views->center() + distance * eye.rotation_matrix().col(2)};
  }

  test::SceneRig rig;
  std::vector<DetectorCamera> cameras;
  std::shared_ptr<const ViewpointModel> views;
  PoseFitter fitter;
  Rigid3 truth;
};

/// Background but for columns left to right and rows top to bottom (beyond the last).
inline ForegroundMap foreground_in(int width, int height, int left, int top, int right,
                                   int bottom) {
  ForegroundMap map;
  map.width = width;
  map.height = height;
  map.classes.assign(static_cast<size_t>(width) * static_cast<size_t>(height),
                     ForegroundMap::kBackground);
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      map.classes[static_cast<size_t>(y * width + x)] = ForegroundMap::kForeground;
    }
  }
  map.share = 0.02;
  return map;
}

}  // namespace sightline::observe
