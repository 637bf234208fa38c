// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "observe/detect/kernels/response_kernel.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"

namespace sightline::observe {

/// Directions of edges are told apart in steps of 22.5 degrees, whichever side is the lighter one.
constexpr int kEdgeBins = 8;
/// Bin of the normal (x, y) of an edge.
int edge_bin(float x, float y);
/// The same of its angle, within a few turns [rad].
inline int angle_bin(float angle) {
  const float steps = angle * (static_cast<float>(kEdgeBins) / 3.14159265f);
  return static_cast<int>(steps + 64.5f) & (kEdgeBins - 1);
}

/// Edges of a half-size image, thinned to ridges: where, which way they face, how strong.
/// Gradients of luma and of both colors compete.
class EdgeImage {
 public:
  void compute(const HalfSizeImage& image) { compute(image, {0, 0, image.width, image.height}); }
  /// Those within a part of it: elsewhere is none, and the image is not read.
  void compute(const HalfSizeImage& image, const PixelBox& box);
  /// Forgets the edges of all pixels where `near` is 0.
  void keep_where(const std::vector<uint8_t>& near);

  int width() const { return width_; }
  int height() const { return height_; }
  /// 0: no edge here; else 1 << bin.
  const std::vector<uint8_t>& bins() const { return bins_; }
  /// Unthinned gradient of the strongest channel, [levels / px]; 0 within a pixel of the border.
  const std::vector<float>& gradient_x() const { return gradient_x_; }
  const std::vector<float>& gradient_y() const { return gradient_y_; }
  const std::vector<float>& magnitude() const { return magnitude_; }
  float threshold() const { return threshold_; }
  /// Of the pixels that reach the threshold, thinned or not: 1, else 0.
  const std::vector<uint8_t>& strong() const { return strong_; }

 private:
  static PixelBox inner(const PixelBox& box);
  void clear(int width, int height);
  void find_gradients(const HalfSizeImage& image);
  void choose_threshold(float sharpness);
  void thin();

  int width_ = 0, height_ = 0;
  PixelBox box_;  ///< of what is known
  float threshold_ = 0;
  std::vector<float> gradient_x_, gradient_y_, magnitude_, sorted_;
  std::vector<uint8_t> bins_, strong_;
};

/// How well an edge of each direction is supported near a point, as bytes 0..kFullResponse: edges
/// are spread over a square (Hinterstoisser et al., LINE-2D, PAMI 2012), and where edges of all
/// directions abound one more says little. One sample for every 2 x 2 pixels of the half-size
/// image; a margin of zeros around, so that templates may reach over the border. Of a row the even
/// columns lie side by side, then the odd ones: templates are scanned at every other column, and
/// each feature's responses are to be read in one go ("linearizing the memory" in the same paper).
class ResponseMaps {
 public:
  static constexpr int kFullResponse = 8;
  static constexpr int kColumnStep = 2;

  /// `borders`: those edges that lie between regions; to the others the response is half.
  /// `spread`: half side of the square [half-size px]; `margin`: [quarter-size px].
  void compute(const EdgeImage& edges, const std::vector<uint8_t>& borders, int spread, int margin);

  int width() const { return width_; }  ///< without margins
  int height() const { return height_; }
  int margin() const { return margin_; }  ///< at least what was asked for; even
  ptrdiff_t stride() const { return stride_; }
  /// Of a pixel of a direction's map, margins included; those kColumnStep columns on follow.
  const uint8_t* place(int bin, int x, int y) const {
    return maps_.data() + bin * plane_ + (margin_ + y) * stride_ + column(x);
  }
  /// 0 outside.
  int at(int bin, int x, int y) const {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return 0;
    return *place(bin, x, y);
  }
  ResponsePlanes planes() const {
    const auto bytes = [](ptrdiff_t count) { return static_cast<int32_t>(count); };
    return {maps_.data(), bytes(plane_), bytes(stride_), bytes(half_), width_, height_, margin_};
  }

 private:
  void spread_out(const std::vector<uint8_t>& bins, int width, int height, int spread,
                  std::vector<uint8_t>& out);
  ptrdiff_t column(int x) const {
    const auto from_left = static_cast<unsigned>(x + margin_);
    return static_cast<ptrdiff_t>(from_left / kColumnStep) + (from_left % kColumnStep) * half_;
  }

  int width_ = 0, height_ = 0, margin_ = 0;
  ptrdiff_t plane_ = 0, stride_ = 0, half_ = 0;  ///< of a direction; a row; its even columns
  std::vector<uint8_t> spread_, spread_borders_, row_spread_;
  std::vector<uint8_t> maps_;
};

}  // namespace sightline::observe
