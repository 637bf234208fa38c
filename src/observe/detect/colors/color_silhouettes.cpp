// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/color_silhouettes.hpp"

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/color_foreground.hpp"
#include "observe/detect/pixels/outline_contrast.hpp"

namespace sightline::observe {

ColorSilhouettes::ColorSilhouettes(const DetectorFrames& frames, const ViewpointModel& model,
                                   const RigMotion& motion, std::span<const double> scores) {
  for (size_t i = 0; i < frames.size(); ++i) {
    if (scores[i] < kMinCameraContour) continue;
    const FitCamera& camera = frames.fit_cameras()[i];
    const CameraModel& lens = camera.camera->model;
    const Rigid3 camera_from_object = camera.camera_from_world * motion.at(camera.seconds);
    const Eigen::Vector3d center = camera_from_object * model.center();
    const auto pixel = lens.project(center);
    const View view = model.view(model.nearest(camera_from_object));
    if (!pixel || outline_contrast(view, lens, camera_from_object, *camera.image, nullptr) <
                      kMinColorContrast)
      continue;
    const Eigen::Vector2d half =
        (*pixel + Eigen::Vector2d::Constant(0.5)) / 2 - Eigen::Vector2d::Constant(0.5);
    maps_.push_back(color_foreground(view, lens, camera_from_object, *camera.image, half,
                                     lens.parameters().fx / 2 * model.radius() / center.norm()));
    seconds_.push_back(camera.seconds);
    cameras_.push_back({camera.camera, camera.camera_from_world, nullptr, 0, 0, {}, {}});
  }
  for (size_t i = 0; i < maps_.size(); ++i) cameras_[i].map = &maps_[i];
}

double ColorSilhouettes::overlap(const SilhouetteSearch& silhouettes,
                                 const RigMotion& motion) const {
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const double own = silhouettes.overlap(cameras_[i], motion.at(seconds_[i]), 1);
    if (own < 0) continue;
    sum += own;
    ++count;
  }
  return count > 0 ? sum / count : -1;
}

}  // namespace sightline::observe
