// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/template_bank.hpp"
#include "sightline/observe/shape/surface_sample.hpp"

namespace sightline::observe {

/// An image at the size of the response maps: Y'CbCr of each pixel, the fourth component 0.
class ColorMap {
 public:
  void compute(const HalfSizeImage& image);
  int width() const { return width_; }
  int height() const { return height_; }
  const Eigen::Array4f& at(int x, int y) const {
    return pixels_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  }

 private:
  int width_ = 0, height_ = 0;
  std::vector<Eigen::Array4f> pixels_;
};

/// Which color of the mesh each view shows where, flat like ViewFeatures: what color_correlation()
/// says of a pose, coarser and a hundred times as fast, for all that a scan finds.
class ColorTemplates {
 public:
  ColorTemplates(const TemplateBank& bank, std::span<const SurfaceSample> samples);

  /// Correlation of the view's colors and the image, all channels together, each about its own
  /// mean, -1 .. 1; nearer to 0 where it rests on few spots (a dark knob on a bright body is found
  /// everywhere), 0 where too little of it is in the image.
  float correlation(const WeakPerspectivePose& pose, const ColorMap& map) const;

 private:
  struct Spot {
    float x, y;            ///< relative to the center [m]
    Eigen::Array4f color;  ///< Y'CbCr about the mean of the view, and 0
  };
  static float weight_of(std::span<const Spot> spots);

  struct Colors {
    std::vector<Spot> spots;
    float weight = 0;  ///< 0 .. 1, by how many of the spots tell colors apart
  };
  std::vector<Colors> views_;
};

}  // namespace sightline::observe
