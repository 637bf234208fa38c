// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/color_correlation.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace sightline::observe {
namespace {

constexpr size_t kMinSeen = 40;      // spots of one camera that can be compared
constexpr float kMinFacing = 0.3f;   // cosine between normal and line of sight
constexpr double kIndependent = 24;  // of the spots
constexpr double kNoColor = 0.5;     // [levels^2] variance of a channel that is not there
constexpr double kMaxAlike = 0.95;

// Mean of 3 x 3 pixels; empty at the border and outside.
std::optional<Eigen::Vector3f> color_at(const std::array<PlaneView, 3>& image,
                                        const Eigen::Vector2d& at) {
  const int x = static_cast<int>(std::floor(at.x() + 0.5));
  const int y = static_cast<int>(std::floor(at.y() + 0.5));
  if (x < 1 || y < 1 || x >= image[0].width - 1 || y >= image[0].height - 1) {
    return std::nullopt;
  }
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      for (size_t plane = 0; plane < 3; ++plane) {
        sum[static_cast<Eigen::Index>(plane)] += static_cast<float>(image[plane].row(v)[u]);
      }
    }
  }
  return sum / 9;
}

// Correlation of two sets of colors, all channels together, each about its own mean. A channel that
// the image does not have (a gray camera) says nothing. Sums only: it runs in every frame.
class Correlation {
 public:
  void add(const Eigen::Vector3f& painted, const Eigen::Vector3f& shown) {
    const Eigen::Array3d a = painted.cast<double>(), b = shown.cast<double>();
    a_ += a;
    b_ += b;
    ab_ += a * b;
    aa_ += a * a;
    bb_ += b * b;
    ++count_;
  }
  size_t count() const { return count_; }
  double value() const {
    const auto n = static_cast<double>(count_);
    const Eigen::Array3d shown = bb_ - b_ * b_ / n;
    const Eigen::Array3d has = (shown > kNoColor * n).cast<double>();
    const double painted = ((aa_ - a_ * a_ / n) * has).sum();
    const double scale = std::sqrt(std::max(0.0, painted * (shown * has).sum()));
    return scale > 1e-6 ? ((ab_ - a_ * b_ / n) * has).sum() / scale : 0;
  }

 private:
  Eigen::Array3d a_ = Eigen::Array3d::Zero(), b_ = a_, ab_ = a_, aa_ = a_, bb_ = a_;
  size_t count_ = 0;
};

}  // namespace

double color_correlation(std::span<const SurfaceSample> samples, const CameraModel& camera,
                         const Rigid3& camera_from_object,
                         const std::array<PlaneView, 3>& half_size) {
  const Eigen::Vector3f eye = camera_from_object.inverse().translation.cast<float>();
  Correlation correlation;
  for (const SurfaceSample& spot : samples) {
    const Eigen::Vector3f sight = eye - spot.point;
    if (sight.dot(spot.normal) < kMinFacing * sight.norm()) continue;
    const auto pixel = camera.project(camera_from_object * spot.point.cast<double>());
    if (!pixel) continue;
    const Eigen::Vector2d half = (*pixel + Eigen::Vector2d::Constant(0.5)) / 2;
    const auto color = color_at(half_size, half - Eigen::Vector2d::Constant(0.5));
    if (color) correlation.add(spot.color, *color);
  }
  return correlation.count() >= kMinSeen ? correlation.value() : 0;
}

double correlation_cost(double correlation) {
  const double r = std::clamp(correlation, 0.0, kMaxAlike);
  return 0.5 * kIndependent * std::log1p(-r * r);
}

}  // namespace sightline::observe
