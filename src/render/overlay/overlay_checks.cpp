// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/overlay_checks.hpp"

#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline::render {
namespace {

bool in_range(double value, double low, double high) { return value >= low && value <= high; }

}  // namespace

Status check_object(const OverlayObject& object, const std::string& camera) {
  const OverlayStyle& style = object.style;
  const auto refuse = [&](const char* what, const char* range) {
    return make_error(ErrorCode::kInvalidInput, camera, "overlay of {}: {} must be {}", object.name,
                      what, range);
  };
  if (object.mesh == nullptr) return refuse("its mesh", "given");
  if (!in_range(style.fill_opacity, 0, 1)) return refuse("fill opacity", "between 0 and 1");
  if (!in_range(style.halo_opacity, 0, 1)) return refuse("halo opacity", "between 0 and 1");
  if (!in_range(style.outline_px, 2, 4)) return refuse("outline width", "2 to 4 px");
  if (!in_range(style.line_px, 2, 8)) return refuse("line width", "2 to 8 px");
  if (!in_range(style.font_px, 8, 64)) return refuse("font size", "8 to 64 px");
  if (!in_range(style.ellipse_sigmas, 0.5, 10)) return refuse("ellipse", "0.5 to 10 sigmas");
  if (!in_range(style.trail_seconds, 0, 3600)) return refuse("trail", "0 to 3600 seconds");
  return {};
}

Status check_parts(const CalibratedCamera& camera, const RayTable* rays, const StaticDepth* scene,
                   const RenderOptions& options) {
  const int width = camera.model.width();
  const int height = camera.model.height();
  if (rays == nullptr || rays->width() != width || rays->height() != height) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "the ray table is not for this camera's {}x{} pixels", width, height);
  }
  if (scene != nullptr && (scene->width() < width || scene->height() < height)) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "the static depth is {}x{}, the camera {}x{} pixels", scene->width(),
                      scene->height(), width, height);
  }
  if (!in_range(options.detail_px, 0, 10)) {
    return make_error(ErrorCode::kInvalidInput, camera.name, "detail must be between 0 and 10 px");
  }
  if (!in_range(options.depth_tolerance, 0, 1) ||
      !in_range(options.depth_tolerance_sigmas, 0, 100)) {
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "depth tolerance must be between 0 and 1, and 0 to 100 sigmas");
  }
  return {};
}

}  // namespace sightline::render
