// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "observe/terms/exposure.hpp"
#include "observe/terms/noise.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::observe {

/// Pixels [left, right) x [top, bottom) of an image.
struct PixelBox {
  int left = 0, top = 0, right = 0, bottom = 0;
};

/// Luma and both color differences at one size.
struct HalfSizeImage {
  int width = 0, height = 0;
  std::array<std::vector<uint8_t>, 3> planes;  ///< Y, U, V; tightly packed
  bool in_color = true;                        ///< else grays of one tint
  float sharpness = 1;  ///< of its luma: gradient of a step, as a share of that before smoothing

  const uint8_t* row(size_t plane, int y) const {
    return planes[plane].data() + static_cast<size_t>(y) * static_cast<size_t>(width);
  }
  PlaneView view(size_t plane) const { return {planes[plane].data(), width, height, width}; }
};

/// A camera's newest frame at half the size at which it is searched (SearchSize): a copy, so that
/// the frame's buffer can go back.
struct HalfSizeFrame {
  FrameInfo info;
  int width = 0, height = 0;       ///< at which it is searched
  HalfSizeImage image;             ///< half of that
  std::vector<uint8_t> full_luma;  ///< of that; empty: not wanted
  bool valid = false;
  ExposureGain exposure;
  std::array<Smoothing, 3> smoothing;  ///< of the half-size planes
  BinomialFilter filter;

  /// The frame is not damaged, and of this size.
  static bool can_store(const Frame& frame, int width, int height);
  /// `camera`: as it is searched, `shrink` pixels of the frame in each direction are one there.
  /// What is dark is exposed longer, what is noisy is smoothed.
  void store(const Frame& frame, const CameraModel& camera, int shrink = 1,
             bool keep_full_luma = false);
  /// Both images as if exposed so much longer (terms/exposure.hpp).
  void expose(double gain);
  /// Both images as a lens that is less sharp would have shown them, where they are noisy.
  void smooth();
  /// What a camera with twice as many pixels shows at half size, within a part of it; needs
  /// `full_luma`.
  void magnify(HalfSizeImage& to, const PixelBox& box) const;
};

/// The camera with `factor` times as many pixels in each direction, `width` x `height` in all.
/// Empty where a CameraModel cannot have so many.
std::optional<CalibratedCamera> scaled(CalibratedCamera camera, int width, int height,
                                       double factor);
/// The camera with twice as many pixels in each direction: what it sees at half size is the image
/// as it is. Empty where that is more than a CameraModel can have.
std::optional<CalibratedCamera> magnified(CalibratedCamera camera);
/// The camera with half as many: what it sees at half size is a quarter of the image's size. Empty
/// where that is less than a CameraModel can have.
std::optional<CalibratedCamera> reduced(CalibratedCamera camera);
/// An image with half as many pixels in each direction: the means of four.
void reduce(const HalfSizeImage& from, HalfSizeImage& to);

}  // namespace sightline::observe
