// SPDX-License-Identifier: Apache-2.0
#include "pose_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace sightline {
namespace {

constexpr double kTwistLinear = 1.0;   // [m/s] one sigma of the prior
constexpr double kTwistAngular = 3.5;  // [rad/s]
constexpr double kAgrees = 1.3;        // [half-size px]
constexpr double kWeakEdge = 0.4;      // of the threshold, where what is new ends
constexpr double kHuber = 2.0;         // [sigma]
constexpr double kLookReach = 3.0;     // [half-size px] of the last step, and of a mere look
constexpr int kEveryLine = 2;          // every second sample is enough
constexpr int kColourSteps = 8;        // samples on either side of the outline
constexpr int kColourBins = 8;         // of each channel

// A sample in the half-size picture.
struct Seen {
  Eigen::Vector2d pixel, normal;
  Eigen::Matrix<double, 2, 3> jacobian;  // half-size pixel by point in camera
};

std::optional<Seen> see(const CameraModel& camera, const Rigid3& camera_from_object,
                        const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double step) {
  Seen out;
  const auto pixel = camera.project(camera_from_object * point, &out.jacobian);
  const auto beside = camera.project(camera_from_object * (point + step * normal));
  if (!pixel || !beside) return std::nullopt;
  out.normal = *beside - *pixel;
  const double length = out.normal.norm();
  if (!(length > 1e-9)) return std::nullopt;
  out.normal /= length;
  out.pixel = (*pixel + Eigen::Vector2d::Constant(0.5)) / 2 - Eigen::Vector2d::Constant(0.5);
  out.jacobian /= 2;
  return out;
}

// Strength of the edge along `normal` at a place; 0 outside and where it is below the threshold.
double edge_along(const EdgePicture& edges, const Eigen::Vector2d& place,
                  const Eigen::Vector2d& normal) {
  const int x = static_cast<int>(std::floor(place.x() + 0.5));
  const int y = static_cast<int>(std::floor(place.y() + 0.5));
  if (x < 1 || y < 1 || x >= edges.width() - 1 || y >= edges.height() - 1) return 0;
  const size_t i =
      static_cast<size_t>(y) * static_cast<size_t>(edges.width()) + static_cast<size_t>(x);
  const auto strength = static_cast<double>(edges.magnitude()[i]);
  if (strength < static_cast<double>(edges.threshold())) return 0;
  const double along = std::abs(static_cast<double>(edges.gradient_x()[i]) * normal.x() +
                                static_cast<double>(edges.gradient_y()[i]) * normal.y());
  return along > 0.8 * strength ? along : 0;
}

// Distance to the best edge along the normal: strong ones and near ones are preferred.
std::optional<double> best_edge(const EdgePicture& edges, const Seen& seen, double reach) {
  const double enough = 4 * static_cast<double>(edges.threshold());
  double best = 0, place = 0;
  const int steps = static_cast<int>(reach);
  for (int s = -steps; s <= steps; ++s) {
    const double strength = edge_along(edges, seen.pixel + s * seen.normal, seen.normal);
    if (!(strength > 0)) continue;
    const double value = std::min(strength, enough) * (1 - 0.7 * std::pow(s / (reach + 1), 2));
    if (value > best) {
      best = value;
      place = s;
    }
  }
  if (!(best > 0)) return std::nullopt;
  const double middle = edge_along(edges, seen.pixel + place * seen.normal, seen.normal);
  const double before = edge_along(edges, seen.pixel + (place - 1) * seen.normal, seen.normal);
  const double after = edge_along(edges, seen.pixel + (place + 1) * seen.normal, seen.normal);
  const double bend = before + after - 2 * middle;
  if (bend < -1e-6) place += std::clamp(0.5 * (before - after) / bend, -0.7, 0.7);
  return place;
}

// A step of light across the normal, however weak, within a pixel of a place.
bool weak_edge(const EdgePicture& edges, const Eigen::Vector2d& place,
               const Eigen::Vector2d& normal) {
  for (const int s : {0, -1, 1}) {
    const int x = static_cast<int>(std::floor(place.x() + s * normal.x() + 0.5));
    const int y = static_cast<int>(std::floor(place.y() + s * normal.y() + 0.5));
    if (x < 1 || y < 1 || x >= edges.width() - 1 || y >= edges.height() - 1) continue;
    const size_t i =
        static_cast<size_t>(y) * static_cast<size_t>(edges.width()) + static_cast<size_t>(x);
    const auto gx = static_cast<double>(edges.gradient_x()[i]),
               gy = static_cast<double>(edges.gradient_y()[i]);
    const double along = std::abs(gx * normal.x() + gy * normal.y());
    if (along > kWeakEdge * static_cast<double>(edges.threshold()) &&
        along > 0.8 * std::hypot(gx, gy))
      return true;
  }
  return false;
}

// Distance to the nearest place along the normal where what is new ends.
std::optional<double> foreground_border(const ForegroundMap& map, const Seen& seen, double reach) {
  const auto at = [&](int s) {
    const Eigen::Vector2d place = seen.pixel + s * seen.normal;
    const int x = static_cast<int>(std::floor(place.x() + 0.5));
    const int y = static_cast<int>(std::floor(place.y() + 0.5));
    if (x < 0 || y < 0 || x >= map.width || y >= map.height)
      return uint8_t{ForegroundMap::kUnknown};
    return map.row(y)[x];
  };
  const int steps = static_cast<int>(reach);
  for (int k = 0; k <= 2 * steps; ++k) {
    const int s = k % 2 == 0 ? k / 2 : -(k + 1) / 2;
    const uint8_t inner = at(s), outer = at(s + 1);
    const bool is_new = inner == ForegroundMap::kForeground || inner == ForegroundMap::kShadow;
    if (is_new && outer == ForegroundMap::kBackground) return s + 0.5;
  }
  return std::nullopt;
}

// Share of what is new.
class Newness {
 public:
  void add(const ForegroundMap& map, const Eigen::Vector2d& place) {
    const int x = static_cast<int>(std::floor(place.x() + 0.5));
    const int y = static_cast<int>(std::floor(place.y() + 0.5));
    if (x < 0 || y < 0 || x >= map.width || y >= map.height) return;
    const uint8_t what = map.row(y)[x];
    if (what == ForegroundMap::kUnknown) return;
    sum_ += 0.5 * what;
    ++count_;
  }
  double share() const { return count_ > 0 ? sum_ / count_ : 0; }

 private:
  double sum_ = 0;
  int count_ = 0;
};

// Colours as a histogram; how unlike two are: 1 - Bhattacharyya coefficient.
class Colours {
 public:
  void add(const SmallPicture& picture, const Eigen::Vector2d& place) {
    const int x = static_cast<int>(std::floor(place.x() + 0.5));
    const int y = static_cast<int>(std::floor(place.y() + 0.5));
    if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) return;
    const auto chroma = [&](size_t plane) {  // most colours are dull
      return std::clamp((picture.row(plane, y)[x] - 128) / 12 + kColourBins / 2, 0,
                        kColourBins - 1);
    };
    const int luma = picture.row(0, y)[x] / (256 / kColourBins);
    counts_[static_cast<size_t>((luma * kColourBins + chroma(1)) * kColourBins + chroma(2))] += 1;
    total_ += 1;
  }
  double unlike(const Colours& other) const {
    if (!(total_ > 0) || !(other.total_ > 0)) return 0;
    double common = 0;
    for (size_t i = 0; i < counts_.size(); ++i) common += std::sqrt(counts_[i] * other.counts_[i]);
    return 1 - common / std::sqrt(total_ * other.total_);
  }

 private:
  std::array<double, kColourBins * kColourBins * kColourBins> counts_{};
  double total_ = 0;
};

Vector6 scaled_twist(const Vector6& twist, double seconds) { return twist * seconds; }

}  // namespace

Rigid3 PoseFit::at(double seconds) const {
  return world_from_object * Rigid3::exp(scaled_twist(twist, seconds));
}

void PoseFitter::add_lines(const FitCamera& camera, const Rigid3& world_from_object, double reach,
                           double sigma, CameraFit& out) const {
  const Rigid3 camera_from_object = camera.camera_from_world * world_from_object;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  const View view = model_.view(model_.nearest(camera_from_object));
  const double step = 0.01 * model_.radius();
  out = CameraFit();
  const auto add = [&](const Eigen::Vector3f& point, const Eigen::Vector3d& normal, bool outline) {
    const Eigen::Vector3d at = point.cast<double>();
    const auto seen = see(camera.camera->model, camera_from_object, at, normal, step);
    if (!seen || seen->pixel.x() < 1 || seen->pixel.y() < 1 ||
        seen->pixel.x() > camera.edges->width() - 2 || seen->pixel.y() > camera.edges->height() - 2)
      return;
    ++out.lines;
    auto distance = best_edge(*camera.edges, *seen, reach);
    bool is_edge = distance.has_value();
    if (!distance && outline && camera.foreground != nullptr) {
      distance = foreground_border(*camera.foreground, *seen, reach);
      // The place that something left is new too, but nothing in the picture ends there.
      is_edge = distance &&
                weak_edge(*camera.edges, seen->pixel + *distance * seen->normal, seen->normal);
    }
    if (!distance) return;
    if (is_edge && std::abs(*distance) <= kAgrees) ++out.agreeing;
    Eigen::Matrix<double, 3, 6> by_tangent;
    by_tangent << -rotation * skew(at), rotation;
    const Vector6 slope =
        -(seen->normal.transpose() * seen->jacobian * by_tangent).transpose() / sigma;
    const double residual = *distance / sigma;
    const double weight = std::abs(residual) <= kHuber ? 1 : kHuber / std::abs(residual);
    out.term.information += weight * slope * slope.transpose();
    out.term.gradient += weight * slope * residual;
    out.term.cost += std::abs(residual) <= kHuber ? 0.5 * residual * residual
                                                  : kHuber * (std::abs(residual) - 0.5 * kHuber);
    ++out.term.residuals;
  };
  for (size_t i = 0; i < view.contour.size(); i += kEveryLine) {
    add(view.contour[i].point, view.contour[i].normal.cast<double>(), true);
  }
  for (size_t i = 0; i < view.edges.size(); i += kEveryLine) {
    // Across the tangent, in the picture plane.
    const Eigen::Vector3d along = rotation * view.edges[i].tangent.cast<double>();
    const Eigen::Vector3d across(-along.y(), along.x(), 0);
    if (across.norm() < 0.2) continue;
    add(view.edges[i].point, rotation.transpose() * across.normalized(), false);
  }
  out.term.quality = out.share();
}

double PoseFitter::inside_outside(const FitCamera& camera, const Rigid3& world_from_object) const {
  const Rigid3 camera_from_object = camera.camera_from_world * world_from_object;
  const View view = model_.view(model_.nearest(camera_from_object));
  Colours inside, outside;
  Newness new_inside, new_outside;
  const auto add = [&](const Eigen::Vector2d& place, Colours& colours, Newness& newness) {
    colours.add(*camera.picture, place);
    if (camera.foreground != nullptr) newness.add(*camera.foreground, place);
  };
  for (size_t i = 0; i < view.contour.size(); i += kEveryLine) {
    const ContourSample& sample = view.contour[i];
    const double step = 0.01 * model_.radius();
    const Eigen::Vector3d point = sample.point.cast<double>();
    const auto seen =
        see(camera.camera->model, camera_from_object, point, sample.normal.cast<double>(), step);
    if (!seen) continue;
    const double metre =
        camera.camera->model.parameters().fx / 2 / (camera_from_object * point).z();
    for (int s = 2; s < 2 + kColourSteps; ++s) {
      if (s < metre * static_cast<double>(sample.foreground)) {
        add(seen->pixel - s * seen->normal, inside, new_inside);
      }
      if (s < metre * static_cast<double>(sample.background)) {
        add(seen->pixel + s * seen->normal, outside, new_outside);
      }
    }
  }
  return std::max(inside.unlike(outside), new_inside.share() - new_outside.share());
}

PoseFit PoseFitter::fit(const Rigid3& start, const Vector6& twist, double reach) const {
  PoseFit out;
  out.world_from_object = start;
  out.twist = twist;
  out.cameras.resize(cameras_.size());
  for (int iteration = 0; iteration < 8; ++iteration) {
    const bool last = iteration == 7;
    const double look = std::max(kLookReach, reach * std::pow(0.8, iteration));
    Matrix12 system = Matrix12::Zero();
    Vector12 right = Vector12::Zero();
    system.diagonal().head<6>().setConstant(1e-3);
    system.diagonal().segment<3>(6).setConstant(1 / (kTwistAngular * kTwistAngular));
    system.diagonal().tail<3>().setConstant(1 / (kTwistLinear * kTwistLinear));
    right.tail<6>() = system.diagonal().tail<6>().cwiseProduct(out.twist);
    for (size_t i = 0; i < cameras_.size(); ++i) {
      const FitCamera& camera = cameras_[i];
      CameraFit& fitted = out.cameras[i];
      add_lines(camera, out.at(camera.seconds), look, std::max(1.0, look / 3), fitted);
      Eigen::Matrix<double, 6, 12> by_state;
      by_state << Rigid3::exp(-out.twist * camera.seconds).adjoint(),
          Matrix6::Identity() * camera.seconds;
      system += by_state.transpose() * fitted.term.information * by_state;
      right += by_state.transpose() * fitted.term.gradient;
    }
    if (last) break;
    Vector12 step = -system.ldlt().solve(right);
    const double turn = step.head<3>().norm(), shift = step.segment<3>(3).norm();
    const double limit =
        std::min({1.0, 0.3 / std::max(turn, 1e-9), 0.5 * model_.radius() / std::max(shift, 1e-9)});
    step *= limit;
    out.world_from_object = out.world_from_object * Rigid3::exp(step.head<6>());
    out.twist += step.tail<6>();
  }
  for (size_t i = 0; i < cameras_.size(); ++i) {
    out.cameras[i].inside_outside = inside_outside(cameras_[i], out.at(cameras_[i].seconds));
  }
  return out;
}

PoseFit PoseFitter::look(const Rigid3& world_from_object, const Vector6& twist) const {
  PoseFit out;
  out.world_from_object = world_from_object;
  out.twist = twist;
  out.cameras.resize(cameras_.size());
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const Rigid3 here = out.at(cameras_[i].seconds);
    add_lines(cameras_[i], here, kLookReach, 1.0, out.cameras[i]);
    out.cameras[i].inside_outside = inside_outside(cameras_[i], here);
  }
  return out;
}

}  // namespace sightline
