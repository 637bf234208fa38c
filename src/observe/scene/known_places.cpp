// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/known_places.hpp"

#include <algorithm>
#include <cmath>

#include "observe/shape/placed_mask.hpp"

namespace sightline::observe {
namespace {

constexpr int kSide = ViewpointModel::kMaskSize;
constexpr double kGrow = 0.125;  // of the radius; two cells of the mask
constexpr double kGrowPx = 2;    // [half-size px]

using Mask = ViewpointModel::Mask;

// By two cells in every direction. Half of what a pose may be off by before it is not tracking.
Mask grown(const Mask& mask) {
  Mask wide{}, out{};
  for (size_t y = 0; y < mask.size(); ++y) {
    const uint32_t m = mask[y];
    wide[y] = m | m << 1 | m << 2 | m >> 1 | m >> 2;
  }
  for (int y = 0; y < kSide; ++y) {
    for (int k = std::max(0, y - 2); k <= std::min(kSide - 1, y + 2); ++k) {
      out[static_cast<size_t>(y)] |= wide[static_cast<size_t>(k)];
    }
  }
  return out;
}

void mark(const CalibratedCamera& camera, const KnownObject& object, int width, int height,
          std::vector<uint8_t>& out) {
  const ViewpointModel& model = *object.views;
  const auto at = place_mask(model, camera.model,
                             camera.world_from_camera.inverse() * object.world_from_object);
  if (!at) return;
  const Mask mask = grown(model.mask(at->view));
  const double radius = at->radius / 2;
  const double x0 = (at->x + 0.5) / 2 - 0.5, y0 = (at->y + 0.5) / 2 - 0.5;
  const double reach = (1 + kGrow) * radius + kGrowPx;
  // Mask cells per pixel; small objects are drawn a little larger.
  const double cells = kSide / (2 * radius) * radius / (radius + kGrowPx);
  const double c = at->cos * cells, s = at->sin * cells;
  const int top = std::max(0, static_cast<int>(y0 - reach));
  const int bottom = std::min(height - 1, static_cast<int>(y0 + reach) + 1);
  const int left = std::max(0, static_cast<int>(x0 - reach));
  const int right = std::min(width - 1, static_cast<int>(x0 + reach) + 1);
  for (int y = top; y <= bottom; ++y) {
    uint8_t* row = out.data() + static_cast<size_t>(y) * static_cast<size_t>(width);
    for (int x = left; x <= right; ++x) {
      const double dx = x - x0, dy = y - y0;
      const int i = static_cast<int>(std::floor(c * dx + s * dy + 0.5 * kSide));
      const int j = static_cast<int>(std::floor(c * dy - s * dx + 0.5 * kSide));
      if (i < 0 || j < 0 || i >= kSide || j >= kSide) continue;
      row[x] = static_cast<uint8_t>(row[x] | (mask[static_cast<size_t>(j)] >> i & 1u));
    }
  }
}

}  // namespace

void mark_known_places(const CalibratedCamera& camera, std::span<const KnownObject> known,
                       int width, int height, std::vector<uint8_t>& out) {
  out.assign(static_cast<size_t>(width) * static_cast<size_t>(height), 0);
  for (const KnownObject& object : known) {
    if (object.views != nullptr) mark(camera, object, width, height, out);
  }
}

}  // namespace sightline::observe
