// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>

#include "observe/track/contour_lines.hpp"

namespace sightline::observe {

/// Evidence of several pixels, or several kinds of evidence, as one: probabilities multiply.
inline float combined_evidence(float a, float b) { return (a + b) / (1 + a * b); }

/// What one line reads of the image.
struct LineSamples {
  static constexpr int kSegments = 24;    ///< per line: -12 .. 12
  std::array<float, kSegments> position;  ///< signed distance from the outline, segments
  std::array<float, kSegments> evidence;
  std::array<float, kSegments> level;  ///< luma
  int count = 0;
};

/// The posterior of a line's offset, and the evidence and levels on either side.
void finish_line(const LineSamples& samples, int scale, ContourLine& line);

/// The pixel that covers a place; false outside of the image. A conversion to int rounds towards
/// zero, so that the sign has to be asked first.
inline bool pixel_at(const ColorReader& frame, float at_x, float at_y, int& x, int& y) {
  at_x += 0.5f;
  at_y += 0.5f;
  if (at_x < 0 || at_y < 0) return false;
  x = static_cast<int>(at_x);
  y = static_cast<int>(at_y);
  return x < frame.width() && y < frame.height();
}

template <class Evidence>
void sample_fine(const ColorReader& frame, const Evidence& evidence, const ContourLine& line,
                 int from, int to, LineSamples& out) {
  const auto nx = static_cast<float>(line.normal.x()), ny = static_cast<float>(line.normal.y());
  const auto cx = static_cast<float>(line.center.x()), cy = static_cast<float>(line.center.y());
  for (int k = from; k < to; ++k) {
    const float r = static_cast<float>(k) + 0.5f;
    int x = 0, y = 0;
    if (!pixel_at(frame, cx + nx * r, cy + ny * r, x, y)) continue;
    const auto i = static_cast<size_t>(out.count++);
    // Where the pixel is, not where it was asked for.
    out.position[i] = nx * (static_cast<float>(x) - cx) + ny * (static_cast<float>(y) - cy);
    out.evidence[i] = evidence(x, y);
    out.level[i] = static_cast<float>(frame.level(x, y));
  }
}

template <class Evidence>
void sample_coarse(const ColorReader& frame, const Evidence& evidence, const ContourLine& line,
                   int scale, int from, int to, LineSamples& out) {
  constexpr float kSure = 0.98f;
  const auto nx = static_cast<float>(line.normal.x()), ny = static_cast<float>(line.normal.y());
  const auto cx = static_cast<float>(line.center.x()), cy = static_cast<float>(line.center.y());
  for (int k = from; k < to; ++k) {
    float sum = 0;
    bool any = false;
    for (int j = 0; j < scale; ++j) {
      const float r = static_cast<float>(k * scale + j) + 0.5f;
      int x = 0, y = 0;
      if (!pixel_at(frame, cx + nx * r, cy + ny * r, x, y)) continue;
      const float w = std::clamp(evidence(x, y), -kSure, kSure);
      sum = std::clamp(combined_evidence(sum, w), -kSure, kSure);
      any = true;
    }
    if (!any) continue;
    const auto i = static_cast<size_t>(out.count++);
    out.position[i] = static_cast<float>(k) + 0.5f;
    out.evidence[i] = sum;
    out.level[i] = 0;
  }
}

/// Measures one line (see measure_lines()). `evidence(x, y)`: of a pixel of the image.
template <class Evidence>
void measure_line(const ColorReader& frame, int scale, ContourLine& line,
                  const Evidence& evidence) {
  constexpr double kFewestSegments = 2;
  line.measured = false;
  const double inside = line.inside_px / scale, outside = line.outside_px / scale;
  if (std::min(inside, outside) < kFewestSegments) return;
  LineSamples samples;
  const int from = -static_cast<int>(std::min(inside, 0.5 * LineSamples::kSegments));
  const int to = static_cast<int>(std::min(outside, 0.5 * LineSamples::kSegments));
  if (scale == 1) {
    sample_fine(frame, evidence, line, from, to, samples);
  } else {
    sample_coarse(frame, evidence, line, scale, from, to, samples);
  }
  finish_line(samples, scale, line);
}

}  // namespace sightline::observe
