// SPDX-License-Identifier: Apache-2.0
#include "observe/turn/panorama_parts.hpp"

#include <algorithm>

namespace sightline::observe {
namespace {
constexpr double kStep = 1e-5;       // [rad], of the derivatives
constexpr double kDepthStep = 1e-3;  // [1/m]
}  // namespace

PanoramaGeometry::PanoramaGeometry(const CameraModel& model, const CameraAxes& axes,
                                   const KeyframeView& view, const Eigen::Vector2d& angles)
    : model_(model), depth_(view.inverse_depth) {
  const auto place = [&](const Eigen::Vector2d& at) {
    return axes.world_from_camera(at.x(), at.y());
  };
  const Eigen::Vector2d pan(kStep, 0), tilt(0, kStep);
  const Rigid3 keyframe = place(view.angles), from_world = place(angles).inverse();
  here_ = from_world * keyframe;
  pan_ = place(angles + pan).inverse() * keyframe;
  tilt_ = place(angles + tilt).inverse() * keyframe;
  keyframe_pan_ = from_world * place(view.angles + pan);
  keyframe_tilt_ = from_world * place(view.angles + tilt);
}

std::optional<Eigen::Vector2d> PanoramaGeometry::project(const Rigid3& here_from_keyframe,
                                                         const PanoramaPoint& point,
                                                         double nearer) const {
  const double depth = std::max(depth_ + point.depth, 0.0) + nearer;
  return model_.project(here_from_keyframe.rotation * point.ray +
                        depth * here_from_keyframe.translation);
}

std::optional<Eigen::Matrix2d> PanoramaGeometry::by_angles(const PanoramaPoint& point,
                                                           const Eigen::Vector2d& pixel) const {
  const auto a = project(pan_, point, 0), b = project(tilt_, point, 0);
  if (!a || !b) return std::nullopt;
  Eigen::Matrix2d out;
  out << (*a - pixel) / kStep, (*b - pixel) / kStep;
  return out;
}

std::optional<Eigen::Matrix2d> PanoramaGeometry::by_keyframe(const PanoramaPoint& point,
                                                             const Eigen::Vector2d& pixel) const {
  const auto a = project(keyframe_pan_, point, 0), b = project(keyframe_tilt_, point, 0);
  if (!a || !b) return std::nullopt;
  Eigen::Matrix2d out;
  out << (*a - pixel) / kStep, (*b - pixel) / kStep;
  return out;
}

std::optional<Eigen::Vector2d> PanoramaGeometry::by_depth(const PanoramaPoint& point,
                                                          const Eigen::Vector2d& pixel) const {
  const auto nearer = project(here_, point, kDepthStep);
  if (!nearer) return std::nullopt;
  return Eigen::Vector2d((*nearer - pixel) / kDepthStep);
}

}  // namespace sightline::observe
