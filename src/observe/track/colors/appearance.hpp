// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// Colors of pixels as bins of (Y, U, V): the frame's own planes, nothing is converted.
struct ColorBins {
  static constexpr int kLumaShift = 4;    // 16 bins: light changes more than color does
  static constexpr int kChromaShift = 3;  // 32 bins each
  static constexpr size_t kCount = size_t{1} << (4 + 5 + 5);

  static uint16_t of(uint8_t y, uint8_t u, uint8_t v) {
    return static_cast<uint16_t>((y >> kLumaShift) << 10 | (u >> kChromaShift) << 5 |
                                 v >> kChromaShift);
  }
};

/// One pixel of a frame's planes.
struct PixelLevels {
  uint8_t y = 0, u = 0, v = 0;
};

/// Reads bins of a frame's pixels. The caller keeps inside the image.
class ColorReader {
 public:
  explicit ColorReader(const I420View& frame) : frame_(frame) {}
  uint16_t bin(int x, int y) const {
    const ptrdiff_t chroma = (y >> 1) * frame_.u.stride + (x >> 1);
    return ColorBins::of(frame_.y.row(y)[x], frame_.u.data[chroma],
                         frame_.v.data[(y >> 1) * frame_.v.stride + (x >> 1)]);
  }
  PixelLevels levels(int x, int y) const {
    const ptrdiff_t chroma = (y >> 1) * frame_.u.stride + (x >> 1);
    return {frame_.y.row(y)[x], frame_.u.data[chroma],
            frame_.v.data[(y >> 1) * frame_.v.stride + (x >> 1)]};
  }
  uint8_t level(int x, int y) const { return frame_.y.row(y)[x]; }
  int width() const { return frame_.width(); }
  int height() const { return frame_.height(); }

 private:
  I420View frame_;
};

/// Color statistics of object and background as one camera sees the object from one aspect
/// (range of viewing directions).
/// (Foreground and background histograms along correspondence lines with exponential forgetting:
/// Tjaden et al., 2018; Stoiber et al., SRT3D, 2022, section 3.3.)
class ColorHistograms {
 public:
  ColorHistograms();
  bool learned() const { return learned_; }

  /// Mixes the colors in with weight `rate`; the first time they are taken as they are. Fewer
  /// pixels than a histogram needs are refused (false).
  bool learn(std::span<const uint16_t> foreground, std::span<const uint16_t> background,
             float rate);
  void copy_from(const ColorHistograms& other);
  void forget();

  /// By bin: P(object) - P(background) with equal priors, -1 .. 1; 0 for a color never seen.
  const float* evidence() const { return evidence_.data(); }
  /// Bhattacharyya distance between the histograms, 0 the same .. 1 no color in common.
  double separation() const { return separation_; }

 private:
  void mix(std::span<const uint16_t> bins, float rate, std::vector<float>& histogram);
  void compare();

  std::vector<float> foreground_, background_, evidence_;
  std::vector<float> fresh_;
  double separation_ = 0;
  bool learned_ = false;
};

/// What is known of one object's colors in one camera, kept per viewing aspect.
class Appearance {
 public:
  static constexpr size_t kAspects = 14;  ///< faces and corners of a cube

  Appearance();
  /// The aspect of a viewing direction (unit, object frame, from the object to the camera).
  static size_t aspect_of(const Eigen::Vector3d& direction);

  bool known() const { return newest_ < kAspects; }
  /// Statistics to be used for an aspect: its own, or those of the aspect learned last; null: none.
  const ColorHistograms* of_aspect(size_t aspect) const;
  /// Learns an aspect; one that was never seen starts with what was learned last.
  bool learn(size_t aspect, std::span<const uint16_t> foreground,
             std::span<const uint16_t> background, float rate);
  void forget();

 private:
  std::array<std::unique_ptr<ColorHistograms>, kAspects> aspects_;
  size_t newest_ = kAspects;
};

}  // namespace sightline::observe
