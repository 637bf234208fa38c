// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/occlusion_cells.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr float kThreshold = 0.6f;  // of belief, either way
constexpr float kMax = 1.5f;        // belief never goes beyond, so that it can come back
constexpr float kKept = 0.9f;       // of belief, from frame to frame
// An object that is nearer than one that was hidden by this share may be in front of the occluder.
constexpr float kSameDepth = 1.08f;
// Published bounds lie nearer than the object, beyond the renderer's own tolerance.
constexpr float kNearer = 1.10f;
constexpr int kReach = 2;          // cells around one that hides
constexpr float kNothing = 0.05f;  // belief that says nothing

}  // namespace

OcclusionCells::OcclusionCells(int width, int height)
    : width_(width),
      height_(height),
      cells_(static_cast<size_t>(width) * static_cast<size_t>(height)) {}

bool OcclusionCells::hides(int x, int y, float w) const {
  return w <= kSameDepth * cells_[at(x, y)].bound;
}

bool OcclusionCells::scene_hides(int x, int y, float w) const {
  return hides(x, y, w) && !cells_[at(x, y)].passing;
}

OcclusionCells::Change OcclusionCells::judge(int x, int y, float w, const CellEvidence& evidence) {
  Cell& cell = cells_[at(x, y)];
  const bool hidden = hides(x, y, w);
  // That it was hidden farther away says nothing about here.
  if (!hidden && cell.bound > 0) cell.belief = std::max(cell.belief, 0.0f);
  cell.belief = std::clamp(kKept * cell.belief + evidence.seen, -kMax, kMax);
  if (!hidden && cell.belief <= -kThreshold) {
    cell.bound = w;
    cell.passing = !evidence.background;
    return Change::kLearned;
  }
  if (hidden && cell.belief >= kThreshold) {
    cell.bound = 0;
    cell.passing = false;
    return Change::kForgotten;
  }
  if (hidden && evidence.background && evidence.seen < -kThreshold) cell.passing = false;
  return Change::kNone;
}

void OcclusionCells::left(int x, int y) {
  Cell& cell = cells_[at(x, y)];
  if (cell.passing) cell = {};
}

void OcclusionCells::forget_passing() {
  for (Cell& cell : cells_) {
    if (cell.passing) cell = {};
  }
}

float OcclusionCells::neighbors(int x, int y) const {
  float max = 0;
  for (int ny = std::max(0, y - kReach); ny <= std::min(height_ - 1, y + kReach); ++ny) {
    for (int nx = std::max(0, x - kReach); nx <= std::min(width_ - 1, x + kReach); ++nx) {
      max = std::max(max, cells_[at(nx, ny)].bound);
    }
  }
  return max;
}

bool OcclusionCells::publish(const CellRect& rect, OcclusionDepth& out) const {
  bool any = false;
  for (int y = rect.top; y < rect.bottom && !any; ++y) {
    for (int x = rect.left; x < rect.right && !any; ++x) any = cells_[at(x, y)].bound > 0;
  }
  if (!any) return false;
  out.x = rect.left;
  out.y = rect.top;
  out.width = rect.right - rect.left;
  out.height = rect.bottom - rect.top;
  out.inverse_depth.resize(static_cast<size_t>(out.width) * static_cast<size_t>(out.height));
  size_t i = 0;
  for (int y = rect.top; y < rect.bottom; ++y) {
    for (int x = rect.left; x < rect.right; ++x) {
      const Cell& cell = cells_[at(x, y)];
      const bool unknown = cell.bound == 0 && std::abs(cell.belief) < kNothing;
      out.inverse_depth[i++] = kNearer * (unknown ? neighbors(x, y) : cell.bound);
    }
  }
  return true;
}

}  // namespace sightline::observe
