// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/sample_edges.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

// Where edges cross a line through the image, and how strong they are there.
class LineAcross {
 public:
  static constexpr int kPlaces = 8;  // that are looked up at once

  LineAcross(const EdgeImage& edges, const ProjectedSample& sample)
      : edges_(edges),
        start_(sample.pixel + Eigen::Vector2d::Constant(0.5)),
        normal_(sample.normal),
        normal_x_(static_cast<float>(sample.normal.x())),
        normal_y_(static_cast<float>(sample.normal.y())) {}

  // Which of so many places from `first` on reach the threshold, a bit each, the first one lowest.
  // Few do: where they are is computed for all, side by side.
  uint32_t strong(int first, std::array<int, kPlaces>& at) const {
    const int width = edges_.width(), height = edges_.height();
    for (int k = 0; k < kPlaces; ++k) {
      // No floor(): what it would round otherwise is out of the image in any case.
      const int x = static_cast<int>(start_.x() + (first + k) * normal_.x());
      const int y = static_cast<int>(start_.y() + (first + k) * normal_.y());
      const bool inside = (x > 0) & (y > 0) & (x < width - 1) & (y < height - 1);
      at[static_cast<size_t>(k)] = inside ? y * width + x : 0;  // the corner has no edge
    }
    uint32_t out = 0;
    for (int k = 0; k < kPlaces; ++k) {
      const auto i = static_cast<size_t>(at[static_cast<size_t>(k)]);
      out |= static_cast<uint32_t>(edges_.strong()[i]) << k;
    }
    return out;
  }

  // Strength of the edge along the line at a pixel that reaches the threshold; 0: it does not
  // cross.
  float strength(int at) const {
    const auto i = static_cast<size_t>(at);
    const float along =
        std::abs(edges_.gradient_x()[i] * normal_x_ + edges_.gradient_y()[i] * normal_y_);
    return along > 0.8f * edges_.magnitude()[i] ? along : 0;
  }

 private:
  const EdgeImage& edges_;
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
  const int steps = static_cast<int>(reach);
  std::array<int, LineAcross::kPlaces> at;
  float best = 0;
  int place = 0;
  for (int first = -steps; first <= steps; first += LineAcross::kPlaces) {
    for (uint32_t left = line.strong(first, at); left != 0; left &= left - 1) {
      const int k = std::countr_zero(left), s = first + k;
      if (s > steps) break;
      const float off = static_cast<float>(s) * over_reach;
      const float strength = line.strength(at[static_cast<size_t>(k)]);
      const float value = std::min(strength, enough) * (1 - 0.7f * off * off);
      if (value > best) {
        best = value;
        place = s;
      }
    }
  }
  if (!(best > 0)) return std::nullopt;
  const uint32_t strong = line.strong(place - 1, at);
  const auto beside = [&](size_t k) {
    return (strong >> k & 1) != 0 ? static_cast<double>(line.strength(at[k])) : 0.0;
  };
  const double before = beside(0), middle = beside(1), after = beside(2);
  const double bend = before + after - 2 * middle;
  const double shift = bend < -1e-6 ? std::clamp(0.5 * (before - after) / bend, -0.7, 0.7) : 0.0;
  return place + shift;
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
