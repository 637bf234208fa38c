// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/edge_maps.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/kernels/gradient_kernel.hpp"

namespace sightline::observe {
namespace {

size_t pixel_index(int x, int y, int width) {
  return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
}

// Response of each direction to each set of directions.
using ResponseTable = std::array<std::array<uint8_t, 256>, kEdgeBins>;

ResponseTable make_response_table(float share) {
  ResponseTable table{};
  for (unsigned bin = 0; bin < kEdgeBins; ++bin) {
    for (unsigned set = 0; set < 256; ++set) {
      const bool exact = (set >> bin & 1) != 0;
      const bool near = (set >> ((bin + 1) % kEdgeBins) & 1) != 0 ||
                        (set >> ((bin + kEdgeBins - 1) % kEdgeBins) & 1) != 0;
      const int best = exact ? ResponseMaps::kFullResponse : near ? kNeighborBinResponse : 0;
      const int others = std::max(0, std::popcount(set) - 2);
      const int response = std::max(0, best - static_cast<int>(kResponseClutter * others));
      table[bin][set] = static_cast<uint8_t>(std::lround(share * static_cast<float>(response)));
    }
  }
  return table;
}

}  // namespace

int edge_bin(float x, float y) {
  const float turns = std::atan2(y, x) / std::numbers::pi_v<float> * kEdgeBins;
  return (static_cast<int>(std::lround(turns)) + 2 * kEdgeBins) % kEdgeBins;
}

void EdgeImage::compute(const HalfSizeImage& image, const PixelBox& box) {
  clear(image.width, image.height);
  box_ = {std::clamp(box.left, 0, width_), std::clamp(box.top, 0, height_),
          std::clamp(box.right, 0, width_), std::clamp(box.bottom, 0, height_)};
  find_gradients(image);
  choose_threshold(image.sharpness);
  thin();
}

// What was in the box before, or everything.
void EdgeImage::clear(int width, int height) {
  if (width != width_ || height != height_) {
    const size_t size = static_cast<size_t>(width) * static_cast<size_t>(height);
    for (auto* values : {&gradient_x_, &gradient_y_, &magnitude_}) values->assign(size, 0);
    bins_.assign(size, 0);
    strong_.assign(size, 0);
    width_ = width;
    height_ = height;
    return;
  }
  for (int y = box_.top; y < box_.bottom; ++y) {
    const size_t first = pixel_index(box_.left, y, width_),
                 end = pixel_index(box_.right, y, width_);
    const auto zero = [&](auto& values) {
      std::fill(values.begin() + static_cast<ptrdiff_t>(first),
                values.begin() + static_cast<ptrdiff_t>(end), 0);
    };
    zero(gradient_x_);
    zero(gradient_y_);
    zero(magnitude_);
    zero(bins_);
    zero(strong_);
  }
}

void EdgeImage::keep_where(const std::vector<uint8_t>& near) {
  for (size_t i = 0; i < bins_.size(); ++i) {
    bins_[i] = near[i] != 0 ? bins_[i] : uint8_t{0};
    magnitude_[i] = near[i] != 0 ? magnitude_[i] : 0.0f;
    strong_[i] = near[i] != 0 ? strong_[i] : uint8_t{0};
  }
}

// Of every pixel in it the neighbors are known.
PixelBox EdgeImage::inner(const PixelBox& box) {
  return {box.left + 1, box.top + 1, box.right - 1, box.bottom - 1};
}

// Sobel, divided so that a ramp of one level per pixel has gradient one.
void EdgeImage::find_gradients(const HalfSizeImage& image) {
  const auto [left, top, right, bottom] = inner(box_);
  for (int y = top; y < bottom; ++y) {
    std::array<GradientRows, 3> planes;
    for (size_t k = 0; k < planes.size(); ++k) {
      planes[k] = {image.row(k, y - 1), image.row(k, y), image.row(k, y + 1),
                   k == 0 ? 0.125f : 0.125f * kColorWeight};
    }
    const size_t row = pixel_index(0, y, width_);
    observe::find_gradients(
        planes, left, right,
        {gradient_x_.data() + row, gradient_y_.data() + row, magnitude_.data() + row});
  }
}

void EdgeImage::choose_threshold(float sharpness) {
  sorted_.clear();
  // Every seventh pixel of the box, row by row.
  size_t skip = 0;
  for (int y = box_.top; y < box_.bottom; ++y) {
    const size_t end = pixel_index(box_.right, y, width_);
    size_t i = pixel_index(box_.left, y, width_) + skip;
    for (; i < end; i += 7) sorted_.push_back(magnitude_[i]);
    skip = i - end;
  }
  const auto middle = sorted_.begin() + static_cast<ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  const float least = kMinGradient * sharpness;
  threshold_ = sorted_.empty() ? least : std::max(least, kEdgeOverMedian * *middle);
}

// Keeps what is a ridge across its own direction.
void EdgeImage::thin() {
  const auto [left, top, right, bottom] = inner(box_);
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const size_t i = pixel_index(x, y, width_);
      const float strength = magnitude_[i];
      if (strength < threshold_) continue;
      strong_[i] = 1;
      const float gx = gradient_x_[i], gy = gradient_y_[i];
      const float ax = std::abs(gx), ay = std::abs(gy);
      const int step_x = ax * 2.414f > ay ? (gx > 0 ? 1 : -1) : 0;
      const int step_y = ay * 2.414f > ax ? (gy > 0 ? 1 : -1) : 0;
      if (strength < magnitude_[pixel_index(x + step_x, y + step_y, width_)] ||
          strength < magnitude_[pixel_index(x - step_x, y - step_y, width_)])
        continue;
      bins_[i] = static_cast<uint8_t>(1 << edge_bin(gx, gy));
    }
  }
}

void ResponseMaps::spread_out(const std::vector<uint8_t>& bins, int width, int height, int spread,
                              std::vector<uint8_t>& out) {
  row_spread_.assign(bins.size(), 0);
  out.assign(bins.size(), 0);
  for (int y = 0; y < height; ++y) {
    const uint8_t* from = bins.data() + pixel_index(0, y, width);
    uint8_t* to = row_spread_.data() + pixel_index(0, y, width);
    for (int k = -spread; k <= spread; ++k) {
      const int begin = std::max(0, -k), end = std::min(width, width - k);
      for (int x = begin; x < end; ++x) to[x] = static_cast<uint8_t>(to[x] | from[x + k]);
    }
  }
  for (int y = 0; y < height; ++y) {
    uint8_t* to = out.data() + pixel_index(0, y, width);
    for (int k = std::max(0, y - spread); k <= std::min(height - 1, y + spread); ++k) {
      const uint8_t* from = row_spread_.data() + pixel_index(0, k, width);
      for (int x = 0; x < width; ++x) to[x] = static_cast<uint8_t>(to[x] | from[x]);
    }
  }
}

void ResponseMaps::compute(const EdgeImage& edges, const std::vector<uint8_t>& borders, int spread,
                           int margin) {
  static const ResponseTable full_responses = make_response_table(1);
  static const ResponseTable within_responses = make_response_table(kWithinResponse);
  const int full_width = edges.width(), full_height = edges.height();
  width_ = full_width / 2;
  height_ = full_height / 2;
  margin_ = margin + margin % kColumnStep;
  // Whole vectors of the scanning kernel may be read past the end of a row.
  half_ = ((width_ + 2 * margin_ + 1) / kColumnStep + 63) / 32 * 32;
  stride_ = kColumnStep * half_;
  plane_ = stride_ * (height_ + 2 * margin_);
  maps_.assign(static_cast<size_t>(kEdgeBins * plane_) + 64, 0);
  spread_out(edges.bins(), full_width, full_height, spread, spread_);
  const bool all = &borders == &edges.bins();
  if (!all) spread_out(borders, full_width, full_height, spread, spread_borders_);
  const std::vector<uint8_t>& spread_borders = all ? spread_ : spread_borders_;
  for (int bin = 0; bin < kEdgeBins; ++bin) {
    const auto& table = full_responses[static_cast<size_t>(bin)];
    const auto& within = within_responses[static_cast<size_t>(bin)];
    for (int y = 0; y < height_; ++y) {
      const uint8_t* any = spread_.data() + pixel_index(0, 2 * y, full_width);
      const uint8_t* border = spread_borders.data() + pixel_index(0, 2 * y, full_width);
      uint8_t* row = maps_.data() + bin * plane_ + (margin_ + y) * stride_;
      for (int first = 0; first < std::min(kColumnStep, width_); ++first) {
        uint8_t* to = row + column(first);
        for (int x = first; x < width_; x += kColumnStep) {
          *to++ = std::max(table[border[2 * x]], within[any[2 * x]]);
        }
      }
    }
  }
}

}  // namespace sightline::observe
