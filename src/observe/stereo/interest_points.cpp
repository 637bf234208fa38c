// SPDX-License-Identifier: Apache-2.0
#include "observe/stereo/interest_points.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr int kTensorRadius = 2;

/// Values over the plane's rectangle; 0 in its border.
class Field {
 public:
  explicit Field(const SmoothPlane& plane)
      : x0_(plane.x0()),
        y0_(plane.y0()),
        width_(plane.x1() - plane.x0()),
        values_(static_cast<size_t>(width_) * static_cast<size_t>(plane.y1() - plane.y0())) {}
  float& at(int x, int y) { return values_[index(x, y)]; }
  float at(int x, int y) const { return values_[index(x, y)]; }

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y - y0_) * static_cast<size_t>(width_) +
           static_cast<size_t>(x - x0_);
  }
  int x0_, y0_, width_;
  std::vector<float> values_;
};

// Place of the maximum of the parabola through three values, from the middle one, in -0.5..0.5.
double peak(float before, float middle, float after) {
  const double bend =
      static_cast<double>(before) - 2.0 * static_cast<double>(middle) + static_cast<double>(after);
  if (bend >= 0) return 0;
  return std::clamp(0.5 * static_cast<double>(before - after) / bend, -0.5, 0.5);
}

float smaller_eigenvalue(const SmoothPlane& plane, int x, int y) {
  float xx = 0, xy = 0, yy = 0;
  for (int dy = -kTensorRadius; dy <= kTensorRadius; ++dy) {
    for (int dx = -kTensorRadius; dx <= kTensorRadius; ++dx) {
      const Eigen::Vector2f g = plane.gradient(x + dx, y + dy);
      xx += g.x() * g.x(), xy += g.x() * g.y(), yy += g.y() * g.y();
    }
  }
  constexpr float kCount = (2 * kTensorRadius + 1) * (2 * kTensorRadius + 1);
  const float half = 0.5f * (xx - yy);
  return (0.5f * (xx + yy) - std::sqrt(half * half + xy * xy)) / kCount;
}

bool is_highest(const Field& field, int x, int y) {
  const float value = field.at(x, y);
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (dx == 0 && dy == 0) continue;
      const float other = field.at(x + dx, y + dy);
      if (other > value || (other == value && (dy < 0 || (dy == 0 && dx < 0)))) return false;
    }
  }
  return true;
}

/// Takes candidates strongest first as long as nothing is closer than the spacing.
class Picker {
 public:
  explicit Picker(int spacing) : spacing_(spacing) {}

  void pick(std::vector<InterestPoint> candidates, int max, std::vector<InterestPoint>& out) {
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const InterestPoint& a, const InterestPoint& b) { return a.strength > b.strength; });
    int taken = 0;
    for (const InterestPoint& candidate : candidates) {
      if (taken == max) return;
      const bool crowded = std::any_of(out.begin(), out.end(), [&](const InterestPoint& other) {
        return (other.pixel - candidate.pixel).squaredNorm() < spacing_ * spacing_;
      });
      if (crowded) continue;
      out.push_back(candidate);
      ++taken;
    }
  }

 private:
  double spacing_;
};

std::vector<InterestPoint> corners_of(const SmoothPlane& plane, const InterestOptions& options) {
  const int border = std::max(options.border_px, kTensorRadius + 2);
  Field response(plane);
  for (int y = plane.y0() + border - 1; y < plane.y1() - border + 1; ++y) {
    for (int x = plane.x0() + border - 1; x < plane.x1() - border + 1; ++x) {
      response.at(x, y) = smaller_eigenvalue(plane, x, y);
    }
  }
  const auto min = static_cast<float>(0.5 * options.min_gradient * options.min_gradient);
  std::vector<InterestPoint> corners;
  for (int y = plane.y0() + border; y < plane.y1() - border; ++y) {
    for (int x = plane.x0() + border; x < plane.x1() - border; ++x) {
      const float value = response.at(x, y);
      if (value < min || !is_highest(response, x, y)) continue;
      InterestPoint corner;
      corner.pixel = {x + peak(response.at(x - 1, y), value, response.at(x + 1, y)),
                      y + peak(response.at(x, y - 1), value, response.at(x, y + 1))};
      corner.strength = value;
      corners.push_back(corner);
    }
  }
  return corners;
}

std::vector<InterestPoint> edges_of(const SmoothPlane& plane, const InterestOptions& options) {
  const int border = std::max(options.border_px, 3);
  Field strength(plane);
  for (int y = plane.y0() + border - 1; y < plane.y1() - border + 1; ++y) {
    for (int x = plane.x0() + border - 1; x < plane.x1() - border + 1; ++x) {
      strength.at(x, y) = plane.gradient(x, y).norm();
    }
  }
  std::vector<InterestPoint> edges;
  for (int y = plane.y0() + border; y < plane.y1() - border; ++y) {
    for (int x = plane.x0() + border; x < plane.x1() - border; ++x) {
      const float value = strength.at(x, y);
      if (static_cast<double>(value) < options.min_gradient) continue;
      const Eigen::Vector2f normal = plane.gradient(x, y) / value;
      // To the neighbor across the edge: along the axis nearest to the gradient.
      const bool steep = std::abs(normal.y()) > std::abs(normal.x());
      const int dx = steep ? 0 : 1, dy = steep ? 1 : 0;
      const float before = strength.at(x - dx, y - dy), after = strength.at(x + dx, y + dy);
      if (before > value || after >= value) continue;
      const double shift = peak(before, value, after);
      InterestPoint edge;
      edge.pixel = {x + shift * dx, y + shift * dy};
      edge.normal = normal.cast<double>();
      edge.kind = PointKind::kEdge;
      edge.strength = value;
      edges.push_back(edge);
    }
  }
  return edges;
}

}  // namespace

std::vector<InterestPoint> interest_points(const SmoothPlane& plane,
                                           const InterestOptions& options) {
  std::vector<InterestPoint> points;
  const int smallest = 2 * std::max(options.border_px, kTensorRadius + 2) + 3;
  if (plane.x1() - plane.x0() < smallest || plane.y1() - plane.y0() < smallest) return points;
  Picker picker(options.spacing_px);
  picker.pick(corners_of(plane, options), options.max_corners, points);
  picker.pick(edges_of(plane, options), options.max_edges, points);
  return points;
}

}  // namespace sightline::observe
