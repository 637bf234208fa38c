// SPDX-License-Identifier: Apache-2.0
#include "model/symmetry_sheet.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "model/sheet.hpp"

namespace sightline::cli {
namespace {

constexpr int kMapColumns = 36, kMapRows = 18;  // sides 10 degrees apart
constexpr double kBright = 0.1;                 // share that is drawn white
// By SymmetryComparison::Pixel: nothing, the same, only as it is, only turned, another surface,
// another color.
constexpr std::array<SheetColor, 6> kColors = {{{16, 128, 128},
                                                {60, 128, 128},
                                                {170, 50, 180},
                                                {120, 210, 80},
                                                {200, 40, 140},
                                                {120, 180, 210}}};

class RowPainter {
 public:
  RowPainter(Sheet& sheet, SymmetryComparer& comparer, int top)
      : sheet_(sheet), comparer_(comparer), side_(comparer.side()), top_(top) {}

  // The object as it is, turned, and what differs.
  void pictures(const Eigen::Vector3d& direction, std::span<const Rigid3> turns) {
    const SymmetryComparison hardest = comparer_.hardest(direction, turns);
    object(comparer_.as_it_is());
    object(comparer_.turned());
    cell([&](size_t at) { return kColors[static_cast<size_t>(hardest.pixels[at])]; });
  }

  void map(std::span<const Rigid3> turns, SymmetryComparer& coarse) {
    const int width = 2 * side_;
    for (int row = 0; row < kMapRows; ++row) {
      for (int column = 0; column < kMapColumns; ++column) {
        const double azimuth =
            (column + 0.5) / kMapColumns * 2 * std::numbers::pi - std::numbers::pi;
        const double elevation = (0.5 - (row + 0.5) / kMapRows) * std::numbers::pi;
        const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth),
                                        std::sin(elevation));
        const SymmetryComparison there = coarse.hardest(direction, turns);
        const double share = std::min(1.0, (there.surface + there.color) / kBright);
        const SheetColor color{static_cast<uint8_t>(20 + 215 * share), 128, 128};
        for (int y = row * side_ / kMapRows; y < (row + 1) * side_ / kMapRows; ++y) {
          for (int x = column * width / kMapColumns; x < (column + 1) * width / kMapColumns; ++x) {
            sheet_.dot(left_ + x, top_ + y, color);
          }
        }
      }
    }
  }

 private:
  void object(const SymmetryComparer::Picture& picture) {
    const auto [least, most] = depths(picture);
    cell([&picture, nearest = least, farthest = most](size_t at) {
      if (!(picture.depth[at] > 0)) return kColors[0];
      if (!picture.color[0].empty()) {
        return SheetColor{picture.color[0][at], picture.color[1][at], picture.color[2][at]};
      }
      const float nearness = (farthest - picture.depth[at]) / std::max(1e-9f, farthest - nearest);
      return SheetColor{static_cast<uint8_t>(60 + 150 * nearness), 128, 128};
    });
  }
  static std::pair<float, float> depths(const SymmetryComparer::Picture& picture) {
    float nearest = INFINITY, farthest = 0;
    for (const float depth : picture.depth) {
      if (!(depth > 0)) continue;
      nearest = std::min(nearest, depth);
      farthest = std::max(farthest, depth);
    }
    return {nearest, farthest};
  }
  template <typename Color>
  void cell(const Color& color) {
    for (int y = 0; y < side_; ++y) {
      for (int x = 0; x < side_; ++x) {
        sheet_.dot(left_ + x, top_ + y, color(static_cast<size_t>(y * side_ + x)));
      }
    }
    left_ += side_;
  }

  Sheet& sheet_;
  SymmetryComparer& comparer_;
  int side_, top_, left_ = 0;
};

}  // namespace

Result<std::shared_ptr<const Image>> draw_symmetry_sheet(std::span<const ListedSymmetry> symmetries,
                                                         SymmetryComparer& comparer,
                                                         SymmetryComparer& coarse) {
  const int side = comparer.side();
  Sheet sheet(8 * side, std::max(1, static_cast<int>(symmetries.size())) * side);
  for (size_t i = 0; i < symmetries.size(); ++i) {
    RowPainter row(sheet, comparer, static_cast<int>(i) * side);
    row.pictures(symmetries[i].broken_by.hidden_from, symmetries[i].turns);
    row.pictures(symmetries[i].broken_by.shown_from, symmetries[i].turns);
    row.map(symmetries[i].turns, coarse);
  }
  return std::shared_ptr<const Image>(sheet.image());
}

}  // namespace sightline::cli
