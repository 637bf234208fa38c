// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/occluders.hpp"

#include <algorithm>
#include <utility>

#include "render/overlay/tile/occlusion_tile.hpp"
#include "sightline/base/check.hpp"

namespace sightline::render {
namespace {

bool overlap(const TileRect& a, const TileRect& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

}  // namespace

Occluders::Occluders(std::shared_ptr<const StaticDepth> scene, const RayTable& rays)
    : scene_(std::move(scene)), rays_(rays) {}

/// Boxes and axes reach beyond the silhouette, so they have a tile of their own.
void Occluders::begin(const OcclusionDepth* learned, bool lines) {
  constexpr int kBeyond = 128;
  learned_ = learned;
  lines_ = has_scene() ? &scene_->tile() : nullptr;
  if (learned == nullptr || !lines) return;
  const TileRect rect = rect_around(*learned, kBeyond, rays_.even_width(), rays_.even_height());
  if (rect.empty()) return;
  start(rect, around_);
  lines_ = &around_;
}

const RasterTile* Occluders::over(const TileRect& rect, const Subject& subject,
                                  std::span<const Subject> all, RasterBackend& rasterizer) {
  bool any = learned_ != nullptr;
  if (any) start(rect, over_);
  for (const Subject& other : all) {
    if (other.index == subject.index) continue;
    const TileRect touched = rasterizer.bounds(*other.mesh, other.camera_from_object, 0);
    if (touched.empty() || !overlap(touched, rect)) continue;
    if (!any) start(rect, over_);
    any = true;
    const Status drawn = rasterizer.draw(*other.mesh, other.camera_from_object, over_);
    SL_CHECK(drawn.has_value(), "a device's rasterizer does not fail");
  }
  return any ? &over_ : nullptr;
}

void Occluders::start(const TileRect& rect, RasterTile& tile) const {
  tile.reset(rect);
  if (has_scene()) {
    const int width = std::min(rect.width, scene_->width() - rect.x);
    const int height = std::min(rect.height, scene_->height() - rect.y);
    for (int y = 0; y < height; ++y) {
      std::copy_n(scene_->row(rect.y + y) + rect.x, width, tile.inverse_depth(y));
    }
  }
  if (learned_ != nullptr) add_occlusion_depth(*learned_, tile);
}

}  // namespace sightline::render
