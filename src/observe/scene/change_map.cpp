// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/change_map.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr float kUnit = 1.0f / 64;
// Squared differences of three channels: noise gives 3, the mean of nine 3 +- 0.8.
constexpr float kMax = 30;          // of one pixel
constexpr float kAround = 7.5f;     // of the mean of nine
constexpr float kFarAround = 5.2f;  // of the mean of 25
constexpr float kOwn = 2.5f;        // of the pixel itself
constexpr float kSpare = 0.01f;     // of the level: light is not the same factor everywhere
constexpr float kBright = 234;      // at and above, the level says no more
constexpr float kDarkest = 0.35f, kBrightest = 0.97f;  // of a shadow
constexpr float kSameColor = 9;                        // squared sigmas of both colors

size_t index(int x, int y, int width) {
  return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
}

}  // namespace

void ChangeMap::compare_row(const std::array<PlaneView, 3>& image, const BackgroundCells& usual,
                            float light, int y, float* squares) const {
  const uint8_t *luma = image[0].row(y), *u = image[1].row(y), *v = image[2].row(y);
  const int16_t *mean = usual.mean_row(0, y), *mean_u = usual.mean_row(1, y),
                *mean_v = usual.mean_row(2, y);
  const int16_t *spread = usual.spread_row(0, y), *spread_c = usual.spread_row(1, y);
  const auto min = static_cast<float>(usual.min_spread(0));
  const auto min_c = static_cast<float>(usual.min_spread(1));
  const int width = usual.width();
  const float gain = light * kUnit;
  const float black = kBlack * (1 - light), neutral = kNeutral * (1 - light);
  const float scale = std::max(1.0f, light) * kUnit;
  for (int x = 0; x < width; ++x) {
    const float expected = black + gain * static_cast<float>(mean[x]);
    const float level = static_cast<float>(luma[x]);
    const float dy = std::min(level, kBright) - std::min(expected, kBright);
    const float du = static_cast<float>(u[x]) - (neutral + gain * static_cast<float>(mean_u[x]));
    const float dv = static_cast<float>(v[x]) - (neutral + gain * static_cast<float>(mean_v[x]));
    const float sy = scale * std::max(static_cast<float>(spread[x]), min);
    const float sc = scale * std::max(static_cast<float>(spread_c[x]), min_c);
    const float spare = kSpare * expected;
    const float square = dy * dy / (sy * sy + spare * spare) + (du * du + dv * dv) / (sc * sc);
    squares[x] = std::min(square, kMax);
  }
}

// Of a pixel that differs: darker by a factor that luma and chroma share, or something else.
uint8_t ChangeMap::classify(const std::array<PlaneView, 3>& image, const BackgroundCells& usual,
                            float light, int x, int y) const {
  const float expected =
      kBlack + light * (static_cast<float>(usual.mean_row(0, y)[x]) * kUnit - kBlack);
  const float ratio =
      (static_cast<float>(image[0].row(y)[x]) - kBlack) / std::max(1.0f, expected - kBlack);
  if (!(ratio > kDarkest && ratio < kBrightest)) return ForegroundMap::kForeground;
  const float part = light * ratio;
  const float du = static_cast<float>(image[1].row(y)[x]) - kNeutral -
                   part * (static_cast<float>(usual.mean_row(1, y)[x]) * kUnit - kNeutral);
  const float dv = static_cast<float>(image[2].row(y)[x]) - kNeutral -
                   part * (static_cast<float>(usual.mean_row(2, y)[x]) * kUnit - kNeutral);
  const float sc = kUnit * std::max(static_cast<float>(usual.spread_row(1, y)[x]),
                                    static_cast<float>(usual.min_spread(1)));
  return du * du + dv * dv < kSameColor * sc * sc ? ForegroundMap::kShadow
                                                  : ForegroundMap::kForeground;
}

void ChangeMap::compute(const std::array<PlaneView, 3>& image, const BackgroundCells& usual,
                        const std::vector<uint8_t>& unknown, float light, ForegroundMap& out) {
  const int width = usual.width(), height = usual.height();
  const size_t size = static_cast<size_t>(width) * static_cast<size_t>(height);
  out.width = width;
  out.height = height;
  out.classes.resize(size);
  squares_.resize(size);
  columns_.resize(static_cast<size_t>(width));
  far_columns_.resize(static_cast<size_t>(width));
  raw_.assign(size, ForegroundMap::kBackground);
  for (int y = 0; y < height; ++y) {
    compare_row(image, usual, light, y, squares_.data() + index(0, y, width));
  }
  for (int y = 2; y + 2 < height; ++y) {
    const float* here = squares_.data() + index(0, y, width);
    for (int x = 0; x < width; ++x) {
      const float near = here[x - width] + here[x] + here[x + width];
      columns_[static_cast<size_t>(x)] = near;
      far_columns_[static_cast<size_t>(x)] = near + here[x - 2 * width] + here[x + 2 * width];
    }
    for (int x = 2; x + 2 < width; ++x) {
      if (here[x] < kOwn) continue;
      const float *near = columns_.data() + x, *far = far_columns_.data() + x;
      if (near[-1] + near[0] + near[1] < 9 * kAround &&
          far[-2] + far[-1] + far[0] + far[1] + far[2] < 25 * kFarAround)
        continue;
      raw_[index(x, y, width)] = classify(image, usual, light, x, y);
    }
  }
  clean(out);
  size_t known = 0, fresh = 0;
  for (size_t i = 0; i < size; ++i) {
    if (unknown[i] != 0) {
      out.classes[i] = ForegroundMap::kUnknown;
      continue;
    }
    ++known;
    fresh += out.classes[i] != ForegroundMap::kBackground;
  }
  out.share = known == 0 ? 0 : static_cast<double>(fresh) / static_cast<double>(known);
}

// Fills holes and drops specks: of a pixel and its neighbors the majority decides, five of nine.
void ChangeMap::clean(ForegroundMap& out) {
  const int width = out.width, height = out.height;
  std::fill(out.classes.begin(), out.classes.end(), uint8_t{ForegroundMap::kBackground});
  // Of the three rows: how many are new, and 16 for each that is foreground.
  columns_in_three_.assign(static_cast<size_t>(width), 0);
  const auto counted = [](uint8_t what) {
    return static_cast<uint8_t>((what != 0) + 16 * (what == ForegroundMap::kForeground));
  };
  for (int y = 1; y + 1 < height; ++y) {
    const uint8_t* middle = raw_.data() + index(0, y, width);
    uint8_t* columns = columns_in_three_.data();
    for (int x = 0; x < width; ++x) {
      columns[x] = static_cast<uint8_t>(counted(middle[x - width]) + counted(middle[x]) +
                                        counted(middle[x + width]));
    }
    uint8_t* to = out.classes.data() + index(0, y, width);
    for (int x = 1; x + 1 < width; ++x) {
      const int sum = columns[x - 1] + columns[x] + columns[x + 1];
      const int any = sum & 15, front = sum >> 4;
      const uint8_t what = 2 * front >= any ? ForegroundMap::kForeground : ForegroundMap::kShadow;
      to[x] = any >= 5 ? what : uint8_t{ForegroundMap::kBackground};
    }
  }
}

}  // namespace sightline::observe
