// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/gpu/raster_device.hpp"

#include <array>
#include <filesystem>
#include <mutex>

#include "render/gpu/egl_device.hpp"
#include "sightline/base/check.hpp"
#include "sightline/base/log.hpp"
#include "sightline/render/raster/raster.hpp"

namespace sightline {
namespace {

/// Draws on the GPU, and on the CPU what the GPU fails.
class GuardedRasterizer final : public RasterBackend {
 public:
  GuardedRasterizer(std::unique_ptr<RasterBackend> gpu, std::shared_ptr<const RayTable> rays)
      : gpu_(std::move(gpu)), cpu_(std::move(rays)) {}

  std::string_view name() const override { return gpu_ != nullptr ? gpu_->name() : cpu_.name(); }

  TileRect bounds(const RenderMesh& mesh, const Rigid3& camera_from_object,
                  int margin_px) const override {
    return cpu_.bounds(mesh, camera_from_object, margin_px);
  }

  Status draw(const RenderMesh& mesh, const Rigid3& camera_from_object, RasterTile& tile) override {
    if (gpu_ != nullptr) {
      const Status drawn = gpu_->draw(mesh, camera_from_object, tile);
      if (drawn.has_value()) return drawn;
      note(drawn.error());
    }
    return cpu_.draw(mesh, camera_from_object, tile);
  }

 private:
  static constexpr int kMaxFailures = 3;

  void note(const Error& error) {
    log::warning("{}; this frame is drawn on the CPU", error.message());
    // What is unavailable will not come back.
    if (++failures_ < kMaxFailures && error.code != ErrorCode::kUnavailable) return;
    log::warning("egl: given up; the overlay is drawn on the CPU from now on");
    gpu_.reset();
  }

  std::unique_ptr<RasterBackend> gpu_;
  MeshRasterizer cpu_;
  int failures_ = 0;
};

/// Whether the kernel shows a GPU at all: starting Mesa only to find its software takes 0.1 s and
/// 85 MB.
bool gpu_node_exists() {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/dri", ignored)) {
    if (entry.path().filename().string().starts_with("renderD")) return true;
  }
  for (const char* node : {"/dev/nvidiactl", "/dev/mali0", "/dev/kgsl-3d0"}) {
    if (std::filesystem::exists(node, ignored)) return true;
  }
  return false;
}

}  // namespace

std::unique_ptr<RasterBackend> guard_rasterizer(std::unique_ptr<RasterBackend> gpu,
                                                std::shared_ptr<const RayTable> rays) {
  return std::make_unique<GuardedRasterizer>(std::move(gpu), std::move(rays));
}

RasterDevice::~RasterDevice() = default;

Result<std::shared_ptr<const RasterDevice>> RasterDevice::open(RasterChoice choice) {
  static std::mutex mutex;
  static std::array<std::weak_ptr<const RasterDevice>, 3> in_use;
  const std::lock_guard lock(mutex);
  auto& known = in_use[static_cast<size_t>(choice)];
  auto device = known.lock();
  // One that is given up is tried again by whoever asks anew.
  if (device != nullptr && !device->given_up()) return device;
  SL_ASSIGN(device, make(choice));
  known = device;
  return device;
}

bool RasterDevice::given_up() const {
  return egl_ != nullptr && egl_->losses() >= EglDevice::kMaxLosses;
}

Result<std::shared_ptr<const RasterDevice>> RasterDevice::make(RasterChoice choice) {
  const auto made = [](std::shared_ptr<EglDevice> egl) {
    return std::shared_ptr<const RasterDevice>(new RasterDevice(std::move(egl)));
  };
  if (choice == RasterChoice::kCpu || (choice == RasterChoice::kAuto && !gpu_node_exists()))
    return made(nullptr);
  auto egl = EglDevice::open();
  if (choice == RasterChoice::kEgl) {
    if (!egl) {
      return make_error(ErrorCode::kUnavailable, "overlay",
                        "backend \"egl\" cannot be used: {}; choose \"cpu\" or \"auto\"",
                        egl.error().message());
    }
    if ((*egl)->software())
      log::warning("overlay: {} is OpenGL in software; backend \"cpu\" costs less",
                   (*egl)->renderer());
    return made(*std::move(egl));
  }
  if (!egl) {
    log::info("overlay: drawn on the CPU ({})", egl.error().message());
    return made(nullptr);
  }
  return made((*egl)->software() ? nullptr : *std::move(egl));
}

std::string RasterDevice::description() const {
  return egl_ == nullptr ? "cpu" : "egl: " + egl_->renderer();
}

std::unique_ptr<RasterBackend> RasterDevice::make_backend(
    std::shared_ptr<const RayTable> rays) const {
  if (egl_ == nullptr) return std::make_unique<MeshRasterizer>(std::move(rays));
  return guard_rasterizer(egl_->make_rasterizer(rays), rays);
}

}  // namespace sightline
