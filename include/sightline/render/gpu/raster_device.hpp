// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/render/raster/backend.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline {

class EglDevice;

/// Which rasterizer draws the overlay. kAuto: EGL on a real GPU, otherwise the CPU's, which is
/// several times cheaper than GL in software.
enum class RasterChoice { kAuto, kCpu, kEgl };

/// What makes rasterizers: the CPU, or a GPU whose meshes all cameras share. Any thread. Those of
/// one choice are one device for as long as somebody holds it.
class RasterDevice {
 public:
  /// kAuto and kCpu do not fail. kEgl fails with kUnavailable where there is no EGL with OpenGL ES
  /// 3.1, in this build or on this machine; software GL is accepted when asked for by name.
  static Result<std::shared_ptr<const RasterDevice>> open(RasterChoice choice);
  ~RasterDevice();

  bool uses_egl() const { return egl_ != nullptr; }
  /// "cpu", or "egl: " and the name of the GPU.
  std::string description() const;

  /// A rasterizer for one camera and one thread at a time. One that draws on a GPU takes the CPU
  /// for frames that the GPU fails, and for good after the third of them: draw() never fails.
  std::unique_ptr<RasterBackend> make_backend(std::shared_ptr<const RayTable> rays) const;

 private:
  static Result<std::shared_ptr<const RasterDevice>> make(RasterChoice choice);
  bool given_up() const;
  explicit RasterDevice(std::shared_ptr<EglDevice> egl) : egl_(std::move(egl)) {}
  std::shared_ptr<EglDevice> egl_;
};

}  // namespace sightline
