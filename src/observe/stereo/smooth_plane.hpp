// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// A rectangle of an image, smoothed, as floats; coordinates are those of the image.
class SmoothPlane {
 public:
  /// The rectangle [x0, x1) x [y0, y1) is cut to the image. `sigma` 0: as it is.
  SmoothPlane(const PlaneView& from, int x0, int y0, int x1, int y1, double sigma);

  int x0() const { return x0_; }
  int y0() const { return y0_; }
  int x1() const { return x0_ + width_; }
  int y1() const { return y0_ + height_; }
  float at(int x, int y) const {
    return data_[static_cast<size_t>(y - y0_) * static_cast<size_t>(width_) +
                 static_cast<size_t>(x - x0_)];
  }
  /// Whether sample() may be asked within `margin` pixels of the place.
  bool holds(const Eigen::Vector2d& pixel, double margin) const {
    return pixel.x() - margin >= x0_ && pixel.y() - margin >= y0_ &&
           pixel.x() + margin < x1() - 1 && pixel.y() + margin < y1() - 1;
  }
  /// Bilinear.
  float sample(float x, float y) const {
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const float u = x - static_cast<float>(column), v = y - static_cast<float>(row);
    const float* p = &data_[static_cast<size_t>(row - y0_) * static_cast<size_t>(width_) +
                            static_cast<size_t>(column - x0_)];
    const float upper = p[0] + u * (p[1] - p[0]);
    const float lower = p[width_] + u * (p[width_ + 1] - p[width_]);
    return upper + v * (lower - upper);
  }
  /// Central differences [levels/px]; one pixel inside the rectangle.
  Eigen::Vector2f gradient(int x, int y) const {
    return {0.5f * (at(x + 1, y) - at(x - 1, y)), 0.5f * (at(x, y + 1) - at(x, y - 1))};
  }

 private:
  int x0_, y0_, width_, height_;
  std::vector<float> data_;
};

}  // namespace sightline::observe
