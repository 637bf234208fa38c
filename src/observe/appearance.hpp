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

/// Colours of pixels as bins of (Y, U, V): the frame's own planes, nothing is converted.
struct ColorBins {
  static constexpr int kLumaShift = 4;    // 16 bins: light changes more than colour does
  static constexpr int kChromaShift = 3;  // 32 bins each
  static constexpr size_t kCount = size_t{1} << (4 + 5 + 5);

  static uint16_t of(uint8_t y, uint8_t u, uint8_t v) {
    return static_cast<uint16_t>((y >> kLumaShift) << 10 | (u >> kChromaShift) << 5 |
                                 v >> kChromaShift);
  }
};

/// Reads bins of a frame's pixels. The caller keeps inside the picture.
class ColorReader {
 public:
  explicit ColorReader(const I420View& frame) : frame_(frame) {}
  uint16_t bin(int x, int y) const {
    const ptrdiff_t chroma = (y >> 1) * frame_.u.stride + (x >> 1);
    return ColorBins::of(frame_.y.row(y)[x], frame_.u.data[chroma],
                         frame_.v.data[(y >> 1) * frame_.v.stride + (x >> 1)]);
  }
  uint8_t level(int x, int y) const { return frame_.y.row(y)[x]; }
  int width() const { return frame_.width(); }
  int height() const { return frame_.height(); }

 private:
  I420View frame_;
};

/// Colour statistics of object and background as one camera sees the object from one side.
/// (Foreground and background histograms along correspondence lines with exponential forgetting:
/// Tjaden et al., 2018; Stoiber et al., SRT3D, 2022, section 3.3.)
class SideAppearance {
 public:
  SideAppearance();
  bool learned() const { return learned_; }

  /// Mixes the colours in with weight `rate`; the first time they are taken as they are. Fewer
  /// pixels than a histogram needs are refused (false).
  bool learn(std::span<const uint16_t> foreground, std::span<const uint16_t> background,
             float rate);
  void copy_from(const SideAppearance& other);
  void forget();

  /// By bin: P(object) - P(background) with equal priors, -1 .. 1; 0 for a colour never seen.
  const float* evidence() const { return evidence_.data(); }
  /// Bhattacharyya distance between the histograms, 0 alike .. 1 no colour in common.
  double separation() const { return separation_; }

 private:
  void mix(std::span<const uint16_t> bins, float rate, std::vector<float>& histogram);
  void compare();

  std::vector<float> foreground_, background_, evidence_;
  std::vector<float> fresh_;
  double separation_ = 0;
  bool learned_ = false;
};

/// What is known of one object's colours in one camera, kept per viewing side.
class Appearance {
 public:
  static constexpr size_t kSides = 14;  ///< faces and corners of a cube

  Appearance();
  /// The side that looks into this direction (unit, object frame, from the object to the camera).
  static size_t side_of(const Eigen::Vector3d& direction);

  bool known() const { return newest_ < kSides; }
  /// Statistics to be used for a side: its own, or those of the side learned last; null: none.
  const SideAppearance* of_side(size_t side) const;
  /// Learns a side; one that was never seen starts with what was learned last.
  bool learn(size_t side, std::span<const uint16_t> foreground,
             std::span<const uint16_t> background, float rate);
  void forget();

 private:
  std::array<std::unique_ptr<SideAppearance>, kSides> sides_;
  size_t newest_ = kSides;
};

}  // namespace sightline::observe
