// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/head_problem.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

Rigid3 turn(double angle, const Eigen::Vector3d& axis) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), Eigen::Vector3d::Zero()};
}

Rigid3 link_pose(const std::array<double, 2>& link) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(link[0], Eigen::Vector3d::UnitY())),
          Eigen::Vector3d(0, link[1], 0)};
}

}  // namespace

Rigid3 HeadModel::pan_from_tilt() const { return link_pose(link); }

Rigid3 HeadModel::world_from_camera(const Eigen::Vector2d& angles) const {
  return chain_of(world_from_base, link, tilt_from_camera, angles).world_from_camera;
}

bool angles_of(const HeadView& view, const EncoderVector& encoder, Eigen::Vector2d& angles,
               Eigen::Matrix<double, 2, 5>* by_encoder) {
  Eigen::Vector2d read = view.rest, rates = Eigen::Vector2d::Zero();
  if (view.moving()) {
    const auto at = view.times->readings.at(view.setting->from_s + encoder[kEncoderLatency]);
    if (!at) return false;
    read = at->angles;
    rates = at->rates;
  }
  if (by_encoder != nullptr) by_encoder->setZero();
  for (int axis = 0; axis < 2; ++axis) {
    const auto a = static_cast<size_t>(axis);
    const double side = view.sides[a], scale = encoder[a];
    // What drives the axis is ahead of it by half of the gap, in the direction that it came.
    const double reading = read[axis] - side * encoder[2 + a] / 2;
    angles[axis] = scale * reading;
    if (by_encoder == nullptr) continue;
    (*by_encoder)(axis, axis) = reading;
    (*by_encoder)(axis, 2 + axis) = -scale * side / 2;
    (*by_encoder)(axis, kEncoderLatency) = scale * rates[axis];
  }
  return true;
}

// A factor F of the chain A F B that becomes F exp(d) makes it A F B exp(Ad(B^-1) d).
HeadChain chain_of(const Rigid3& world_from_base, const std::array<double, 2>& link,
                   const Rigid3& tilt_from_camera, const Eigen::Vector2d& angles) {
  HeadChain out;
  const Rigid3 link_from_camera = turn(angles[1], Eigen::Vector3d::UnitX()) * tilt_from_camera;
  const Rigid3 pan_from_camera = link_pose(link) * link_from_camera;
  const Rigid3 base_from_camera = turn(angles[0], Eigen::Vector3d::UnitZ()) * pan_from_camera;
  out.world_from_camera = world_from_base * base_from_camera;
  out.by_base = base_from_camera.inverse().adjoint();
  const Matrix6 by_link = link_from_camera.inverse().adjoint();
  out.by_link << by_link.col(1), by_link.col(4);
  out.by_angles << pan_from_camera.inverse().adjoint().col(2),
      tilt_from_camera.inverse().adjoint().col(0);
  return out;
}

bool linearize(const SightedBody& body, const BodySight& sight, const std::vector<double>& weights,
               LensModel lens, const double* values, const Rigid3& world_from_camera,
               const Rigid3& world_from_body, bool derivatives, SightLinearization& out) {
  const Rigid3 camera_from_body = world_from_camera.inverse() * world_from_body;
  const Eigen::Matrix3d rotation = camera_from_body.rotation_matrix();
  const auto rows = 2 * (static_cast<Eigen::Index>(weights.size()) -
                         std::count(weights.begin(), weights.end(), 0));
  out.error.resize(rows);
  const Eigen::Index full = derivatives ? rows : 0;
  out.place.resize(full, 6);
  out.body.resize(full, 6);
  out.lens.resize(full, 12);
  Eigen::Index row = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0) continue;
    const Eigen::Vector3d in_body = body.point(sight.corners[i].id);
    const Eigen::Vector3d in_camera = camera_from_body * in_body;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, 12> by_lens;
    if (!project_lens(lens, values, in_camera, pixel, derivatives ? &by_point : nullptr,
                      derivatives ? &by_lens : nullptr)) {
      return false;
    }
    const double root = std::sqrt(weights[i]);
    out.error.segment<2>(row) = root * (pixel - sight.corners[i].pixel);
    if (derivatives) {
      out.lens.middleRows<2>(row) = root * by_lens;
      out.place.middleRows<2>(row) << root * by_point * skew(in_camera), -root * by_point;
      const Eigen::Matrix<double, 2, 3> by_body = root * by_point * rotation;
      out.body.middleRows<2>(row) << -by_body * skew(in_body), by_body;
    }
    row += 2;
  }
  return true;
}

double coefficient_sigma(int parameter) {
  constexpr std::array<double, 8> kSigma = {0.3, 1, 0.01, 0.01, 3, 0.3, 1, 3};
  return parameter < 4 ? 0 : kSigma[static_cast<size_t>(parameter - 4)];
}

void set_sigmas(HeadProblem& problem) {
  for (HeadView& view : problem.views) {
    Eigen::Vector2d rates = Eigen::Vector2d::Zero();
    const double noise = view.moving() ? view.times->readings.noise() : 0;  // no mean over a rest
    if (view.moving()) {
      const double time = view.setting->from_s + problem.model.encoder[kEncoderLatency];
      if (const auto at = view.times->readings.at(time)) rates = at->rates;
    }
    for (int axis = 0; axis < 2; ++axis) {
      const auto a = static_cast<size_t>(axis);
      const double scale = std::abs(problem.model.encoder[a]);
      const double play = view.sides[a] == 0 ? scale * problem.model.encoder[2 + a] : 0;
      const double late = scale * rates[axis] * problem.jitter_s;
      const double single = scale * noise;
      view.sigma[axis] = std::sqrt(problem.reading_sigma * problem.reading_sigma + single * single +
                                   play * play / 12 + late * late);
    }
  }
}

}  // namespace sightline::calibrate
