// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "render/overlay/subject.hpp"
#include "sightline/model/occlusion_depth.hpp"
#include "sightline/render/raster/backend.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline::render {

/// What may hide an object in one camera: the static scene, what was learned of it, and the other
/// objects. Keeps its memory between frames.
class Occluders {
 public:
  /// `scene` may be null; `rays` outlive it.
  Occluders(std::shared_ptr<const StaticDepth> scene, const RayTable& rays);

  /// A new frame. `learned` may be null, else it is kept until the frame is drawn. `lines`: whether
  /// lines() will be asked for.
  void begin(const OcclusionDepth* learned, bool lines);

  /// The static scene; null: none. It alone counts where over() says null.
  const StaticDepth* scene() const { return scene_.get(); }
  /// If other objects or what was learned may hide `subject` over `rect`: they and the scene in a
  /// tile of that place and size, valid until the next call. Null: the scene alone.
  const RasterTile* over(const TileRect& rect, const Subject& subject, std::span<const Subject> all,
                         RasterBackend& rasterizer);
  /// For lines that reach beyond the silhouette: the scene and what was learned; null: nothing.
  const RasterTile* lines() const { return lines_; }

 private:
  bool has_scene() const { return scene_ != nullptr && !scene_->empty(); }
  void start(const TileRect& rect, RasterTile& tile) const;

  const std::shared_ptr<const StaticDepth> scene_;
  const RayTable& rays_;
  const OcclusionDepth* learned_ = nullptr;
  const RasterTile* lines_ = nullptr;
  RasterTile over_, around_;
};

}  // namespace sightline::render
