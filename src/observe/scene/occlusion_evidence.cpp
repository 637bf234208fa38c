// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/occlusion_evidence.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

// Chosen on recordings/bench (camera `side`) and the rendered scenes of occlusion_learner_test.
// Densities of a color, relative to one that is exactly what was expected.
constexpr float kSurface = 0.6f;      // on the object's surface: known less exactly
constexpr float kWrongColor = 3e-4f;  // of a place of it that was seen, in quite another color
constexpr float kOther = 0.003f;      // of something else that happens to be there
constexpr float kMaxEvidence = 3;     // of one cell, as a logarithm
constexpr float kLikeBackground = 9;  // squared sigmas from the background
constexpr int kMeanReach = 2;         // cells to either side whose evidence is averaged
constexpr int kMinCells = 6;          // of these
constexpr float kCannotTell = 0.9f;   // logarithms below say nothing
// The same for a place of the surface that was never seen ...
constexpr float kUnchanged = -2.5f;    // where a textured background looks as ever
constexpr float kPlain = -0.36f;       // where a plain one does, as the object might by chance
constexpr float kCovered = 1.9f;       // where the background does not show
constexpr float kNotItsColor = -2.0f;  // in an image that changed, of a color the object has not

// Student's t with three degrees of freedom, up to a factor: outliers cost little.
float density(float squared_sigmas) {
  const float heavy = 1 / (1 + 0.25f * squared_sigmas);
  return heavy * heavy;
}

}  // namespace

OcclusionEvidence::Cell OcclusionEvidence::compare(const Knowledge& known,
                                                   const SurfaceColors& surface, size_t place,
                                                   int x, int y, const CellColor& color) {
  const bool background_known = known.background.known(x, y);
  const float off = background_known ? known.background.distance(x, y, color) : 0;
  Cell out;
  out.background = background_known && off < kLikeBackground;
  if (surface.known(place)) {
    const float scene = background_known ? std::max(kOther, density(off)) : kOther;
    const float object = kSurface * density(surface.distance(place, color)) + kWrongColor;
    const float ratio = std::log(object / scene);
    if (std::abs(ratio) >= kCannotTell) {
      out.log_ratio = std::clamp(ratio, -kMaxEvidence, kMaxEvidence);
    }
    return out;
  }
  out.guessed = out.background;
  if (out.background) {
    // Whether the object could look like that here is not known.
    if (!surface.has(color)) {
      out.log_ratio = known.background.textured(x, y) ? kUnchanged : kPlain;
    }
  } else if (known.image_changed) {
    if (surface.well_known() && !surface.has(color)) out.log_ratio = kNotItsColor;
  } else if (background_known) {
    out.log_ratio = kCovered;
  }
  return out;
}

void OcclusionEvidence::measure(const Knowledge& known, const ObjectProjection& projection,
                                const SurfaceColors& surface, const CellReader& frame,
                                std::span<const ObjectProjection* const> others) {
  evidence_.assign(projection.size(), 0.0f);
  for (auto* flags : {&valid_, &background_, &guessed_, &spread_}) {
    flags->assign(projection.size(), 0);
  }
  const auto behind_another = [&](int x, int y, float w) {
    return std::any_of(others.begin(), others.end(),
                       [&](const ObjectProjection* other) { return other->depth_at(x, y) > w; });
  };
  const CellRect& rect = projection.rect();
  for (int y = rect.top; y < rect.bottom; ++y) {
    for (int x = rect.left; x < rect.right; ++x) {
      const size_t i = projection.at(x, y);
      const float w = projection.depth(i);
      if (!projection.inside(i) || behind_another(x, y, w)) continue;
      const Eigen::Vector3d point =
          projection.object_from_camera() * known.grid.point_in_camera(x, y, w);
      const Cell cell =
          compare(known, surface, surface.at(point.cast<float>()), x, y, frame.at(x, y));
      background_[i] = cell.background ? 1 : 0;
      guessed_[i] = cell.guessed ? 1 : 0;
      if (!cell.log_ratio) continue;
      evidence_[i] = *cell.log_ratio;
      valid_[i] = 1;
    }
  }
  spread(known, projection);
  if (known.image_changed) reject_if_covered(projection);
}

// What hides the object at a cell hides it as well at those beside it that look the same, as far as
// they look like the background and nothing is known of the object's surface there.
void OcclusionEvidence::spread(const Knowledge& known, const ObjectProjection& projection) {
  const CellRect& rect = projection.rect();
  const auto take = [&](int x, int y, int from_x, int from_y) {
    const size_t i = projection.at(x, y);
    if (!guessed_[i] || !rect.contains(from_x, from_y)) return;
    const size_t from = projection.at(from_x, from_y);
    const bool hidden =
        projection.depth(from) > 0 &&
        (spread_[from] || known.cells.scene_hides(from_x, from_y, projection.depth(i)));
    if (hidden && known.background.similar(x, y, from_x, from_y)) spread_[i] = 1;
  };
  for (int y = rect.top; y < rect.bottom; ++y) {
    for (int x = rect.left; x < rect.right; ++x) {
      take(x, y, x - 1, y);
      take(x, y, x, y - 1);
    }
  }
  for (int y = rect.bottom - 1; y >= rect.top; --y) {
    for (int x = rect.right - 1; x >= rect.left; --x) {
      take(x, y, x + 1, y);
      take(x, y, x, y + 1);
      const size_t i = projection.at(x, y);
      if (!spread_[i]) continue;
      evidence_[i] = kUnchanged;
      valid_[i] = 1;
    }
  }
}

// Where most of what is known of the object does not show in an image that has changed as a whole,
// something covers the camera: what looks right then does so by chance.
void OcclusionEvidence::reject_if_covered(const ObjectProjection& projection) {
  size_t with = 0, against = 0;
  for (const float evidence : evidence_) {
    with += evidence > 0 ? 1 : 0;
    against += evidence < 0 ? 1 : 0;
  }
  if (against <= with) return;
  for (size_t i = 0; i < projection.size(); ++i) {
    if (!projection.inside(i)) continue;
    evidence_[i] = kNotItsColor;
    background_[i] = 0;
    valid_[i] = 1;
  }
}

CellEvidence OcclusionEvidence::mean_at(const ObjectProjection& projection, int x, int y) const {
  const CellRect& rect = projection.rect();
  float sum = 0;
  int count = 0, background = 0;
  for (int ny = std::max(rect.top, y - kMeanReach); ny <= std::min(rect.bottom - 1, y + kMeanReach);
       ++ny) {
    for (int nx = std::max(rect.left, x - kMeanReach);
         nx <= std::min(rect.right - 1, x + kMeanReach); ++nx) {
      const size_t i = projection.at(nx, ny);
      sum += evidence_[i];
      count += valid_[i];
      background += background_[i];
    }
  }
  if (count < kMinCells) return {};
  return {sum / (kMaxEvidence * static_cast<float>(count)), 2 * background > count};
}

}  // namespace sightline::observe
