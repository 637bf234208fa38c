// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/render/raster/backend.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline {

/// OpenGL ES 3.1 through EGL without a window or a display server. Any thread. A build without EGL
/// has an open() that says so.
class EglDevice {
 public:
  /// A real GPU if there is one, else software GL. kUnavailable: neither.
  static Result<std::shared_ptr<EglDevice>> open();
  virtual ~EglDevice() = default;

  /// GL_RENDERER.
  virtual const std::string& renderer() const = 0;
  /// llvmpipe, softpipe and the like.
  virtual bool software() const = 0;

  /// A rasterizer with a context of its own, made when it first draws. Its draw() fails if the GPU
  /// does; a lost context is made anew, until the device has lost kMaxLosses of them.
  virtual std::unique_ptr<RasterBackend> make_rasterizer(std::shared_ptr<const RayTable> rays) = 0;
  static constexpr int kMaxLosses = 3;

  /// How many times the contexts were lost.
  virtual int losses() const = 0;
  /// Treats the contexts as lost at the next draw(), as after a GPU reset. For tests.
  virtual void lose_contexts() = 0;
};

/// Draws with `gpu`, with the CPU the frames that it fails, and only with the CPU after the third
/// of them or once the GPU is unavailable. draw() does not fail.
std::unique_ptr<RasterBackend> guard_rasterizer(std::unique_ptr<RasterBackend> gpu,
                                                std::shared_ptr<const RayTable> rays);

/// Whether a blank-separated list of extensions holds `name`, as a whole word.
bool has_extension(const char* list, std::string_view name);

/// Whether GL_RENDERER names a rasterizer in software.
bool is_software_renderer(std::string_view renderer);

}  // namespace sightline
