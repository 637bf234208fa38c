// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/template_bank.hpp"
#include "sightline/observe/shape/surface_sample.hpp"

namespace sightline::observe {

/// An image at the size of the response maps: Y'CbCr of each pixel, the fourth component 0. Kept as
/// sums of four pixels, which takes half the memory of what they are read as: what is compared with
/// it lies anywhere.
class ColorMap {
 public:
  void compute(const HalfSizeImage& image);
  int width() const { return width_; }
  int height() const { return height_; }
  /// `pixel`: row by row.
  Eigen::Array4f at(size_t pixel) const {
    const Sums& sums = pixels_[pixel];
    const auto wide = __builtin_convertvector(sums, FourInts);
    const FourFloats mean = 0.25f * __builtin_convertvector(wide, FourFloats);
    return Eigen::Array4f(mean[0], mean[1], mean[2], mean[3]);
  }

 private:
  using Sums [[gnu::vector_size(8)]] = uint16_t;
  using FourInts [[gnu::vector_size(16)]] = int32_t;
  using FourFloats [[gnu::vector_size(16)]] = float;
  int width_ = 0, height_ = 0;
  std::vector<Sums> pixels_;
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
  static constexpr size_t kMaxSpots = 64;  // of a view
  static float weight_of(std::span<const Eigen::Array4f> colors);

  struct Sums {
    void add(const Eigen::Array4f& spot) {
      color += spot;
      square += spot.square();
    }
    Eigen::Array4f color = Eigen::Array4f::Zero(), square = Eigen::Array4f::Zero();
  };
  struct Colors {
    std::array<float, kMaxSpots> x{}, y{};  ///< of the spots, relative to the center [m]
    std::vector<Eigen::Array4f> colors;     ///< Y'CbCr about the mean of the view, and 0
    float weight = 0;                       ///< 0 .. 1, by how many of the spots tell colors apart
    Sums sums;                              ///< of all spots: few poses have any out of the image
  };
  std::vector<Colors> views_;
};

}  // namespace sightline::observe
