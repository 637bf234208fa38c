// SPDX-License-Identifier: Apache-2.0
#include "calibrate/watch/patch_match.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr int kMargin = kPatchSide / 2;
constexpr int kIterations = 12;
constexpr double kConverged = 0.003;  // [px]
constexpr double kFarthest = 4;       // from the start [px]
// Least eigenvalue of the sum of squared gradients over a patch: noise of 3 gray levels then moves
// a corner by less than 0.1 px.
constexpr double kTexture = 1500;
constexpr int kApart = 6;  // corners of one cell [px]

using Sample = std::array<float, kPatchPixels>;

// Zero mean, unit norm. False: flat.
bool normalize(Sample& sample) {
  float mean = 0;
  for (const float v : sample) mean += v;
  mean /= kPatchPixels;
  float squares = 0;
  for (float& v : sample) {
    v -= mean;
    squares += v * v;
  }
  if (squares < 1.0F * kPatchPixels) return false;
  const float factor = 1 / std::sqrt(squares);
  for (float& v : sample) v *= factor;
  return true;
}

float dot(const Sample& a, const Sample& b) {
  float sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

bool take_sample(const PlaneView& image, const Eigen::Vector2d& center, Sample& out) {
  const double left = center.x() - kPatchInner / 2, top = center.y() - kPatchInner / 2;
  if (!(left >= 0 && top >= 0 && left + kPatchInner < image.width &&
        top + kPatchInner < image.height)) {
    return false;
  }
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  const float fx = static_cast<float>(left - x0), fy = static_cast<float>(top - y0);
  const float w00 = (1 - fx) * (1 - fy), w10 = fx * (1 - fy), w01 = (1 - fx) * fy, w11 = fx * fy;
  size_t i = 0;
  for (int y = 0; y < kPatchInner; ++y) {
    const uint8_t* upper = image.row(y0 + y) + x0;
    const uint8_t* lower = image.row(y0 + y + 1) + x0;
    for (int x = 0; x < kPatchInner; ++x, ++i) {
      out[i] = w00 * upper[x] + w10 * upper[x + 1] + w01 * lower[x] + w11 * lower[x + 1];
    }
  }
  return normalize(out);
}

// What the mean and the contrast of a patch take away from its gradients.
void project_out(const Sample& value, Sample& gradient) {
  float mean = 0;
  for (const float g : gradient) mean += g;
  mean /= kPatchPixels;
  for (float& g : gradient) g -= mean;
  const float along = dot(gradient, value);
  for (size_t i = 0; i < gradient.size(); ++i) gradient[i] -= along * value[i];
}

// Sums of products of gradients over all rectangles: integral images. They wrap around, but what
// they say of a patch is far below 2^31.
class StructureSums {
 public:
  explicit StructureSums(const PlaneView& image)
      : width_(image.width + 1), sums_(size_t(width_) * (size_t(image.height) + 1), Sum{}) {
    for (int y = 1; y + 1 < image.height; ++y) {
      Sum row{};
      for (int x = 1; x + 1 < image.width; ++x) {
        const int gx = image.row(y)[x + 1] - image.row(y)[x - 1];
        const int gy = image.row(y + 1)[x] - image.row(y - 1)[x];
        row[0] += static_cast<uint32_t>(gx * gx);
        row[1] += static_cast<uint32_t>(gx * gy);
        row[2] += static_cast<uint32_t>(gy * gy);
        const Sum& above = at(x + 1, y);
        at(x + 1, y + 1) = {above[0] + row[0], above[1] + row[1], above[2] + row[2]};
      }
      at(image.width, y + 1) = at(image.width - 1, y + 1);
    }
  }
  /// Least eigenvalue over a patch around a pixel.
  double texture(int x, int y) const {
    const int r = kPatchInner / 2;
    std::array<double, 3> s;
    for (size_t i = 0; i < s.size(); ++i) {
      const uint32_t sum = at(x + r + 1, y + r + 1)[i] - at(x - r, y + r + 1)[i] -
                           at(x + r + 1, y - r)[i] + at(x - r, y - r)[i];
      s[i] = 0.25 * static_cast<int32_t>(sum);  // gradients are half of the differences
    }
    const double half = 0.5 * (s[0] + s[2]);
    return half - std::hypot(0.5 * (s[0] - s[2]), s[1]);
  }

 private:
  using Sum = std::array<uint32_t, 3>;
  Sum& at(int x, int y) { return sums_[size_t(y) * size_t(width_) + size_t(x)]; }
  const Sum& at(int x, int y) const { return sums_[size_t(y) * size_t(width_) + size_t(x)]; }
  int width_;
  std::vector<Sum> sums_;
};

}  // namespace

PatchTemplate::PatchTemplate(const ScenePatch& patch) : pixel(patch.pixel) {
  const auto at = [&](int x, int y) {
    return static_cast<float>(patch.gray[static_cast<size_t>(y * kPatchSide + x)]);
  };
  size_t i = 0;
  for (int y = 1; y <= kPatchInner; ++y) {
    for (int x = 1; x <= kPatchInner; ++x, ++i) {
      value[i] = at(x, y);
      along_x[i] = 0.5F * (at(x + 1, y) - at(x - 1, y));
      along_y[i] = 0.5F * (at(x, y + 1) - at(x, y - 1));
    }
  }
  const Sample raw = value;
  if (!normalize(value)) return;
  const float factor = dot(raw, value) > 0 ? 1 / dot(raw, value) : 0;
  for (Sample* gradient : {&along_x, &along_y}) {
    for (float& g : *gradient) g *= factor;
    project_out(value, *gradient);
  }
  Eigen::Matrix2d hessian;
  hessian << dot(along_x, along_x), dot(along_x, along_y), dot(along_x, along_y),
      dot(along_y, along_y);
  if (hessian.determinant() > 1e-12) inverse_hessian = hessian.inverse();
}

std::optional<ScenePatch> cut_patch(const PlaneView& image, int x, int y) {
  if (x < kMargin || y < kMargin || x + kMargin >= image.width || y + kMargin >= image.height) {
    return std::nullopt;
  }
  ScenePatch patch;
  patch.pixel = {x, y};
  for (int row = 0; row < kPatchSide; ++row) {
    const uint8_t* from = image.row(y - kMargin + row) + x - kMargin;
    std::copy_n(from, kPatchSide, patch.gray.begin() + row * kPatchSide);
  }
  return patch;
}

std::optional<PatchMatch> refine_patch(const PlaneView& image, const PatchTemplate& patch,
                                       const Eigen::Vector2d& start) {
  PatchMatch match{start, 0};
  Sample sample;
  for (int i = 0; i < kIterations; ++i) {
    if (!take_sample(image, match.pixel, sample)) return std::nullopt;
    for (size_t k = 0; k < sample.size(); ++k) sample[k] -= patch.value[k];
    const Eigen::Vector2d slope(dot(sample, patch.along_x), dot(sample, patch.along_y));
    const Eigen::Vector2d step = patch.inverse_hessian * slope;
    match.pixel -= step;
    if (!match.pixel.allFinite() || (match.pixel - start).norm() > kFarthest) return std::nullopt;
    if (step.norm() > kConverged) continue;
    if (!take_sample(image, match.pixel, sample)) return std::nullopt;
    match.score = dot(sample, patch.value);
    return match;
  }
  return std::nullopt;
}

std::optional<PatchMatch> search_patch(const PlaneView& image, const PatchTemplate& patch,
                                       const Eigen::Vector2d& center, int range) {
  constexpr int kStep = 2, kRadius = kPatchInner / 2;
  std::optional<PatchMatch> best;
  const int cx = static_cast<int>(std::lround(center.x()));
  const int cy = static_cast<int>(std::lround(center.y()));
  for (int y = cy - range; y <= cy + range; y += kStep) {
    if (y < kRadius || y + kRadius >= image.height) continue;
    for (int x = cx - range; x <= cx + range; x += kStep) {
      if (x < kRadius || x + kRadius >= image.width) continue;
      float sum = 0, squares = 0, product = 0, own = 0, own_squares = 0;
      int count = 0;
      for (int v = 0; v < kPatchInner; v += kStep) {
        const uint8_t* row = image.row(y - kRadius + v) + x - kRadius;
        const float* value = patch.value.data() + ptrdiff_t{v} * kPatchInner;
        for (int u = 0; u < kPatchInner; u += kStep, ++count) {
          const float gray = row[u];
          sum += gray;
          squares += gray * gray;
          product += gray * value[u];
          own += value[u];
          own_squares += value[u] * value[u];
        }
      }
      const float n = static_cast<float>(count);
      const float spread = (squares - sum * sum / n) * (own_squares - own * own / n);
      if (spread <= 1e-6F) continue;
      const double score = (product - sum * own / n) / std::sqrt(spread);
      if (!best || score > best->score) best = PatchMatch{{x, y}, score};
    }
  }
  return best;
}

int scene_cell(const Eigen::Vector2d& pixel, int width, int height) {
  const int column = static_cast<int>(pixel.x() * kSceneColumns / width);
  const int row = static_cast<int>(pixel.y() * kSceneRows / height);
  return std::clamp(row, 0, kSceneRows - 1) * kSceneColumns +
         std::clamp(column, 0, kSceneColumns - 1);
}

std::vector<Corner> find_corners(const PlaneView& image, int each, std::span<const char> taken) {
  std::vector<Corner> corners;
  const int border = kMargin + 3;
  if (image.width < 4 * border || image.height < 4 * border) return corners;
  constexpr size_t kCells = size_t{kSceneColumns} * kSceneRows;
  if (taken.size() >= kCells && std::ranges::all_of(taken, [](char c) { return c != 0; })) {
    return corners;
  }
  const StructureSums sums(image);
  struct Candidate {
    double texture;
    int x, y;
  };
  std::array<std::vector<Candidate>, kCells> cells;
  for (int y = border; y < image.height - border; y += 2) {
    for (int x = border; x < image.width - border; x += 2) {
      const auto cell =
          static_cast<size_t>(scene_cell(Eigen::Vector2d(x, y), image.width, image.height));
      if (cell < taken.size() && taken[cell] != 0) continue;
      const double texture = sums.texture(x, y);
      if (texture > kTexture) cells[cell].push_back({texture, x, y});
    }
  }
  for (size_t cell = 0; cell < cells.size(); ++cell) {
    auto& candidates = cells[cell];
    std::ranges::sort(candidates, std::ranges::greater(), &Candidate::texture);
    const size_t first = corners.size();
    for (const Candidate& c : candidates) {
      if (corners.size() - first >= static_cast<size_t>(each)) break;
      const bool near = std::any_of(
          corners.begin() + static_cast<ptrdiff_t>(first), corners.end(), [&](const Corner& k) {
            return std::abs(k.x - c.x) < kApart && std::abs(k.y - c.y) < kApart;
          });
      if (!near) corners.push_back({c.x, c.y, static_cast<int>(cell)});
    }
  }
  return corners;
}

}  // namespace sightline::calibrate
