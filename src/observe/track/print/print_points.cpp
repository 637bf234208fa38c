// SPDX-License-Identifier: Apache-2.0
#include "observe/track/print/print_points.hpp"

#include <cmath>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

namespace {

// What a lens and a pixel do to a rendered image: 1 2 1 both ways. Where no surface is, it stays
// without meaning.
PlaneView smoothed(const PrintTile& tile, std::vector<uint8_t>& out) {
  const int width = tile.depth.width, height = tile.depth.height;
  out.assign(static_cast<size_t>(width) * static_cast<size_t>(height), 0);
  for (int y = 1; y + 1 < height; ++y) {
    const uint8_t* const row = tile.luma + y * tile.luma_stride;
    const uint8_t* const above = row - tile.luma_stride;
    const uint8_t* const below = row + tile.luma_stride;
    uint8_t* const to = out.data() + static_cast<ptrdiff_t>(y) * width;
    const auto column = [&](int x) { return above[x] + 2 * row[x] + below[x]; };
    for (int x = 1; x + 1 < width; ++x) {
      to[x] = static_cast<uint8_t>((column(x - 1) + 2 * column(x) + column(x + 1) + 8) / 16);
    }
  }
  return {out.data(), width, height, width};
}

}  // namespace

PrintPoints::PrintPoints(const CameraModel& camera, const PrintRendererFactory& factory)
    : renderer_(factory(camera)), points_(camera, {kMinPrintCorrelation, kMinPrintStrength}) {}

TexturePoints& PrintPoints::around(const Rigid3& camera_from_object) {
  ++since_;
  if (outdated(camera_from_object)) render(camera_from_object);
  return points_;
}

bool PrintPoints::outdated(const Rigid3& camera_from_object) const {
  if (!rendered_) return true;
  // Those that are covered for long are given up; they may be in sight again.
  if (points_.kept() < kMinPoints) return since_ > kLongestPause;
  const double ratio = camera_from_object.translation.norm() / rendered_at_.translation.norm();
  return rotation_angle(camera_from_object, rendered_at_) > kPrintTurn ||
         std::abs(std::log(ratio)) > kPrintZoom;
}

void PrintPoints::render(const Rigid3& camera_from_object) {
  points_.forget();
  rendered_ = true;
  rendered_at_ = camera_from_object;
  since_ = 0;
  made_ = 0;
  const PrintTile tile = renderer_->render(camera_from_object);
  if (tile.depth.width < 3 || tile.depth.height < 3) return;
  points_.take(smoothed(tile, smooth_), tile.depth, camera_from_object);
  made_ = points_.kept();
}

bool PrintPoints::given_up() const {
  return made_ >= size_t{kTexturedPoints} && points_.kept() < kMinPoints;
}

}  // namespace sightline::observe
