// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/sample_edges.hpp"

#include <algorithm>
#include <cmath>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

// Where edges cross a line through the image, and how strong they are there.
class LineAcross {
 public:
  LineAcross(const EdgeImage& edges, const ProjectedSample& sample)
      : magnitude_(edges.magnitude().data()),
        gradient_x_(edges.gradient_x().data()),
        gradient_y_(edges.gradient_y().data()),
        width_(edges.width()),
        height_(edges.height()),
        threshold_(edges.threshold()),
        start_(sample.pixel + Eigen::Vector2d::Constant(0.5)),
        normal_(sample.normal),
        normal_x_(static_cast<float>(sample.normal.x())),
        normal_y_(static_cast<float>(sample.normal.y())) {}

  // Strength of the edge along the line so far from its middle; 0 outside of the image and where it
  // is below the threshold.
  float strength(double s) const {
    // No floor(): what it would round otherwise is out of the image in any case.
    const int x = static_cast<int>(start_.x() + s * normal_.x());
    const int y = static_cast<int>(start_.y() + s * normal_.y());
    if (x < 1 || y < 1 || x >= width_ - 1 || y >= height_ - 1) return 0;
    const ptrdiff_t i = static_cast<ptrdiff_t>(y) * width_ + x;
    const float magnitude = magnitude_[i];
    if (magnitude < threshold_) return 0;
    const float along = std::abs(gradient_x_[i] * normal_x_ + gradient_y_[i] * normal_y_);
    return along > 0.8f * magnitude ? along : 0;
  }

 private:
  const float *magnitude_, *gradient_x_, *gradient_y_;
  const int width_, height_;
  const float threshold_;
  const Eigen::Vector2d start_, normal_;
  const float normal_x_, normal_y_;
};

}  // namespace

std::optional<ProjectedSample> project_sample(const CameraModel& camera,
                                              const Eigen::Isometry3d& camera_from_object,
                                              const Eigen::Vector3d& point,
                                              const Eigen::Vector3d& normal) {
  ProjectedSample out;
  const auto pixel = camera.project(camera_from_object * point, &out.jacobian);
  if (!pixel) return std::nullopt;
  out.normal = out.jacobian * (camera_from_object.linear() * normal);
  const double length = out.normal.norm();
  if (!(length > 1e-9)) return std::nullopt;
  out.normal /= length;
  out.pixel = (*pixel + Eigen::Vector2d::Constant(0.5)) / 2 - Eigen::Vector2d::Constant(0.5);
  out.jacobian /= 2;
  return out;
}

std::optional<double> best_edge(const EdgeImage& edges, const ProjectedSample& sample,
                                double reach) {
  const LineAcross line(edges, sample);
  const float enough = 4 * edges.threshold();
  const auto over_reach = static_cast<float>(1 / (reach + 1));
  float best = 0;
  int place = 0;
  const int steps = static_cast<int>(reach);
  for (int s = -steps; s <= steps; ++s) {
    const float strength = line.strength(s);
    if (!(strength > 0)) continue;
    const float off = static_cast<float>(s) * over_reach;
    const float value = std::min(strength, enough) * (1 - 0.7f * off * off);
    if (value > best) {
      best = value;
      place = s;
    }
  }
  if (!(best > 0)) return std::nullopt;
  const auto middle = static_cast<double>(line.strength(place));
  const auto before = static_cast<double>(line.strength(place - 1));
  const auto after = static_cast<double>(line.strength(place + 1));
  const double bend = before + after - 2 * middle;
  const double beside = bend < -1e-6 ? std::clamp(0.5 * (before - after) / bend, -0.7, 0.7) : 0.0;
  return place + beside;
}

bool weak_edge(const EdgeImage& edges, const Eigen::Vector2d& place,
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
    if (along > kWeakEdgeShare * static_cast<double>(edges.threshold()) &&
        along > 0.8 * std::hypot(gx, gy))
      return true;
  }
  return false;
}

std::optional<double> foreground_border(const ForegroundMap& map, const ProjectedSample& sample,
                                        double reach) {
  const auto at = [&](int s) {
    const Eigen::Vector2d place = sample.pixel + s * sample.normal;
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

}  // namespace sightline::observe
