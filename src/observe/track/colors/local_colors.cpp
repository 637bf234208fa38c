// SPDX-License-Identifier: Apache-2.0
#include "observe/track/colors/local_colors.hpp"

#include <algorithm>
#include <cmath>

#include "observe/track/line_posterior.hpp"
#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

size_t SurfaceCell::of(const Eigen::Vector3d& from_center) {
  Eigen::Index axis = 0;
  const double largest = from_center.cwiseAbs().maxCoeff(&axis);
  if (!(largest > 0)) return 0;
  const auto third = [&](Eigen::Index other) {
    const double along = from_center[other] / largest;
    return static_cast<size_t>(std::clamp((along + 1) * 1.5, 0.0, 2.0));
  };
  const size_t face = 2 * static_cast<size_t>(axis) + (from_center[axis] > 0 ? 1 : 0);
  return 9 * face + 3 * third((axis + 1) % 3) + third((axis + 2) % 3);
}

void collect_local_colors(const ColorReader& frame, std::span<const ContourLine> lines,
                          const Eigen::Vector3d& center, double gap_px, double reach_px,
                          LocalCounts& counts) {
  counts = {};
  for (const ContourLine& line : lines) {
    LocalCounts::Cell& cell = counts.cells[SurfaceCell::of(line.point_in_object - center)];
    const auto read = [&](double r, LocalCounts::Side& side) {
      const int x = static_cast<int>(std::lround(line.center.x() + r * line.normal.x()));
      const int y = static_cast<int>(std::lround(line.center.y() + r * line.normal.y()));
      if (x < 0 || y < 0 || x >= frame.width() || y >= frame.height()) return;
      for (const uint8_t bin : ChannelBins::of(frame.levels(x, y))) ++side.bins[bin];
      ++side.pixels;
    };
    for (double r = gap_px; r < std::min(reach_px, line.inside_px - gap_px); ++r) {
      read(-r, cell.inside);
    }
    for (double r = gap_px; r < std::min(reach_px, line.outside_px - gap_px); ++r) {
      read(r, cell.outside);
    }
  }
}

// As in ColorHistograms, noise and shading move pixels to the next brightness first.
void LocalColors::Cell::mix(const LocalCounts::Side& counts, float rate, Shares& shares) {
  constexpr float kOwn = 0.6f, kNext = 0.2f;
  const float share = rate / static_cast<float>(counts.pixels);
  const auto count = [&](size_t bin) { return static_cast<float>(counts.bins[bin]); };
  for (size_t bin = 0; bin < ChannelBins::kLuma; ++bin) {
    const size_t below = bin > 0 ? bin - 1 : bin;
    const size_t above = bin + 1 < ChannelBins::kLuma ? bin + 1 : bin;
    const float smooth = kOwn * count(bin) + kNext * (count(below) + count(above));
    shares[bin] = (1 - rate) * shares[bin] + share * smooth;
  }
  for (size_t bin = ChannelBins::kLuma; bin < ChannelBins::kCount; ++bin) {
    shares[bin] = (1 - rate) * shares[bin] + share * count(bin);
  }
}

float LocalColors::Cell::evidence(const PixelLevels& pixel) const {
  const auto [y, u, v] = ChannelBins::of(pixel);
  return combined_evidence(evidence_[y], combined_evidence(evidence_[u], evidence_[v]));
}

void LocalColors::learn(const LocalCounts& counts, float inside_rate, float outside_rate) {
  for (size_t i = 0; i < cells_.size(); ++i) {
    const LocalCounts::Cell& seen = counts.cells[i];
    if (std::min(seen.inside.pixels, seen.outside.pixels) < kMinCellPixels) continue;
    Cell& cell = cells_[i];
    Cell::mix(seen.inside, cell.learned_ ? inside_rate : 1.0f, cell.inside_);
    Cell::mix(seen.outside, cell.learned_ ? outside_rate : 1.0f, cell.outside_);
    for (size_t bin = 0; bin < ChannelBins::kCount; ++bin) {
      const float f = cell.inside_[bin], b = cell.outside_[bin];
      cell.evidence_[bin] = (f - b) / (f + b + kRareLocalColor);
    }
    known_ = cell.learned_ = true;
  }
}

void LocalColors::forget() {
  cells_ = {};
  known_ = false;
}

void measure_lines(const ColorReader& frame, const LocalColors& colors,
                   const Eigen::Vector3d& center, int scale, std::span<ContourLine> lines) {
  for (ContourLine& line : lines) {
    line.measured = false;
    const LocalColors::Cell& cell = colors.cell(SurfaceCell::of(line.point_in_object - center));
    if (!cell.learned()) continue;
    measure_line(frame, scale, line,
                 [&](int x, int y) { return cell.evidence(frame.levels(x, y)); });
  }
}

}  // namespace sightline::observe
