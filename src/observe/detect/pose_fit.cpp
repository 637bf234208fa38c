// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pose_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/looks/magnified_look.hpp"
#include "observe/detect/looks/reduced_look.hpp"
#include "observe/detect/pixels/outline_contrast.hpp"
#include "observe/detect/pixels/sample_edges.hpp"
#include "observe/detect/principal_rotations.hpp"
#include "observe/terms/robust_loss.hpp"

namespace sightline::observe {
namespace {

double mean_width(const ViewpointModel& model) {
  double sum = 0;
  for (size_t i = 0; i < model.size(); ++i) sum += static_cast<double>(model.view(i).area);
  return std::sqrt(sum / static_cast<double>(model.size()));
}

}  // namespace

PoseFitter::PoseFitter(const ViewpointModel& model, Executor executor)
    : model_(model),
      executor_(std::move(executor)),
      width_(mean_width(model)),
      rotations_(principal_rotations(model)),
      turns_(principal_turns(model)) {}

const FitCamera& PoseFitter::look(const FitCamera& camera, const Rigid3& world_from_object,
                                  bool rough) const {
  if (camera.magnified == nullptr && (!rough || camera.reduced == nullptr)) return camera;
  const Rigid3 camera_from_object = camera.camera_from_world * world_from_object;
  const double size_px =
      camera.camera->model.parameters().fx * width_ / (camera_from_object * model_.center()).norm();
  if (rough && camera.reduced != nullptr && size_px >= kLargeObjectPx) {
    return camera.reduced->camera();
  }
  if (camera.magnified == nullptr || size_px >= kSmallObjectPx) return camera;
  const FitCamera* magnified = camera.magnified->camera();
  return magnified != nullptr ? *magnified : camera;
}

/// Where the object is before one camera, and how its lines are looked for.
struct PoseFitter::Placement {
  const FitCamera& camera;
  Eigen::Isometry3d camera_from_object;
  double reach, sigma;  ///< [half-size px]
};

void PoseFitter::add_line(const Placement& at, const Eigen::Vector3d& point,
                          const Eigen::Vector3d& normal, bool outline, CameraFit& out) const {
  const FitCamera& camera = at.camera;
  const auto sample = project_sample(camera.camera->model, at.camera_from_object, point, normal);
  if (!sample || sample->pixel.x() < 1 || sample->pixel.y() < 1 ||
      sample->pixel.x() > camera.edges->width() - 2 ||
      sample->pixel.y() > camera.edges->height() - 2)
    return;
  ++out.lines;
  auto distance = best_edge(*camera.edges, *sample, at.reach);
  bool is_edge = distance.has_value();
  if (!distance && outline && camera.foreground != nullptr) {
    distance = foreground_border(*camera.foreground, *sample, at.reach);
    // The place that something left is foreground too, but nothing in the image ends there.
    is_edge = distance &&
              weak_edge(*camera.edges, sample->pixel + *distance * sample->normal, sample->normal);
  }
  if (!distance) return;
  const double near = camera.pixel_size < 2 ? kMagnifiedAgreementPx : kAgreementPx;
  if (is_edge && std::abs(*distance) <= near) ++out.agreeing;
  // By the tangent of Rigid3: n^T J (-R [p]x, R) = ((p x g)^T, g^T) with g = R^T J^T n.
  const Eigen::Vector3d by_point =
      at.camera_from_object.linear().transpose() * (sample->jacobian.transpose() * sample->normal);
  Vector6 slope;
  slope << point.cross(by_point), by_point;
  slope /= -at.sigma;
  const HuberLoss loss(kFitHuber);
  const double residual = *distance / at.sigma;
  const double weight = loss.weight(std::abs(residual));
  out.term.information += weight * slope * slope.transpose();
  out.term.gradient += weight * slope * residual;
  out.term.cost += loss.cost(std::abs(residual));
  ++out.term.residuals;
}

CameraFit PoseFitter::fit_lines(const FitCamera& camera, const Rigid3& world_from_object,
                                double reach, double sigma, size_t sample_step) const {
  const Rigid3 camera_from_object = camera.camera_from_world * world_from_object;
  const Placement at{camera, Eigen::Isometry3d(camera_from_object.matrix()), reach, sigma};
  const Eigen::Matrix3d rotation = at.camera_from_object.linear();
  const View view = model_.view(model_.nearest(camera_from_object));
  CameraFit out;
  for (size_t i = 0; i < view.contour.size(); i += sample_step) {
    add_line(at, view.contour[i].point.cast<double>(), view.contour[i].normal.cast<double>(), true,
             out);
  }
  for (size_t i = 0; i < view.edges.size(); i += sample_step) {
    // Across the tangent, in the image plane.
    const Eigen::Vector3d along = rotation * view.edges[i].tangent.cast<double>();
    const Eigen::Vector3d across(-along.y(), along.x(), 0);
    if (across.norm() < 0.2) continue;
    add_line(at, view.edges[i].point.cast<double>(), rotation.transpose() * across.normalized(),
             false, out);
  }
  out.term.quality = out.share();
  out.pixel_size = camera.pixel_size;
  return out;
}

double PoseFitter::contrast(const FitCamera& camera, const Rigid3& world_from_object) const {
  const Rigid3 camera_from_object = camera.camera_from_world * world_from_object;
  return outline_contrast(model_.view(model_.nearest(camera_from_object)), camera.camera->model,
                          camera_from_object, *camera.image, camera.foreground);
}

PoseFit PoseFitter::fit(std::span<const FitCamera> cameras, const RigMotion& start, double reach,
                        const FitEffort& effort) const {
  if (effort.sample_step == kSampleStep) {
    work_.fits += cameras.size();
  } else {  // each step with few lines costs what a look along the outline does
    work_.looked_at += cameras.size() * static_cast<size_t>(effort.iterations);
  }
  PoseFit out{start, std::vector<CameraFit>(cameras.size())};
  RigMotion& motion = out.motion;
  std::vector<const FitCamera*> looks;
  for (const FitCamera& camera : cameras) {
    looks.push_back(&look(camera, start.at(camera.seconds), effort.rough));
  }
  for (int iteration = 0; iteration < effort.iterations; ++iteration) {
    const double reach_now = std::max(kFinalReach, reach * std::pow(0.8, iteration));
    const bool from_afar = effort.moved && iteration + kCloseIterations < effort.iterations;
    MotionSystem system(motion.twist, effort.rest);
    system.information.diagonal().head<6>().setConstant(kPosePrior);
    for (size_t i = 0; i < cameras.size(); ++i) {
      const double seconds = cameras[i].seconds;
      const FitCamera& camera = from_afar ? cameras[i] : *looks[i];
      out.cameras[i] = fit_lines(camera, motion.at(seconds), reach_now,
                                 std::max(1.0, reach_now / 3), effort.sample_step);
      system.add(out.cameras[i].term, motion_jacobian_first_order(motion.twist, seconds));
    }
    if (iteration + 1 == effort.iterations) break;
    Vector12 step = -system.information.ldlt().solve(system.gradient);
    const double turn = step.head<3>().norm(), shift = step.segment<3>(3).norm();
    const double limit =
        std::min({1.0, 0.3 / std::max(turn, 1e-9), 0.5 * model_.radius() / std::max(shift, 1e-9)});
    step *= limit;
    motion.world_from_object = motion.world_from_object * Rigid3::exp(step.head<6>());
    motion.twist += step.tail<6>();
  }
  return effort.contrast ? with_contrast(cameras, std::move(out)) : out;
}

PoseFit PoseFitter::with_contrast(std::span<const FitCamera> cameras, PoseFit fit) const {
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Rigid3 here = fit.motion.at(cameras[i].seconds);
    fit.cameras[i].contrast = contrast(look(cameras[i], here), here);
  }
  return fit;
}

std::vector<RigMotion> PoseFitter::rotated(const RigMotion& motion) const {
  return after(rotations_, motion);
}

std::vector<RigMotion> PoseFitter::turned(const RigMotion& motion) const {
  return after(turns_, motion);
}

std::vector<RigMotion> PoseFitter::after(std::span<const Eigen::Quaterniond> rotations,
                                         const RigMotion& motion) const {
  const Eigen::Vector3d& center = model_.center();
  std::vector<RigMotion> out;
  for (const Eigen::Quaterniond& rotation : rotations) {
    const Rigid3 turn(rotation, center - rotation * center);
    out.push_back({motion.world_from_object * turn, turn.inverse().adjoint() * motion.twist});
  }
  return out;
}

std::vector<PoseFit> PoseFitter::fit_rotated(std::span<const FitCamera> cameras,
                                             const RigMotion& fitted) const {
  return fit(cameras, rotated(fitted), kRotatedReach);
}

std::vector<PoseFit> PoseFitter::fit(std::span<const FitCamera> cameras,
                                     std::span<const RigMotion> starts, double reach,
                                     const FitEffort& effort) const {
  std::vector<PoseFit> out(starts.size());
  executor_(starts.size(), [&](size_t i) { out[i] = fit(cameras, starts[i], reach, effort); });
  return out;
}

PoseFit PoseFitter::lines(std::span<const FitCamera> cameras, const RigMotion& motion,
                          size_t sample_step) const {
  PoseFit out{motion, {}};
  work_.looked_at += cameras.size();
  for (const FitCamera& camera : cameras) {
    const Rigid3 here = motion.at(camera.seconds);
    out.cameras.push_back(fit_lines(look(camera, here, true), here, kFinalReach, 1.0, sample_step));
  }
  return out;
}

PoseFit PoseFitter::evaluate(std::span<const FitCamera> cameras, const RigMotion& motion) const {
  PoseFit out{motion, {}};
  work_.looked_at += cameras.size();
  for (const FitCamera& camera : cameras) {
    const Rigid3 here = motion.at(camera.seconds);
    const FitCamera& close = look(camera, here);
    out.cameras.push_back(fit_lines(close, here, kFinalReach, 1.0));
    out.cameras.back().contrast = contrast(close, here);
  }
  return out;
}

}  // namespace sightline::observe
