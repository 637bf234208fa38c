// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/egl_device.hpp"

#include <mutex>

#include "render/gpu/egl_context.hpp"
#include "render/gpu/egl_meshes.hpp"
#include "render/gpu/egl_rasterizer.hpp"
#include "render/raster/space_box.hpp"
#include "sightline/base/log.hpp"

namespace sightline {
namespace {

using egl::Context;
using egl::Current;
using egl::Display;
using egl::DrawFailure;
using egl::MeshStore;
using egl::TileDrawer;

/// A share group: the contexts that are lost together, and the meshes they share. The root context
/// draws nothing; it keeps the group alive while cameras come and go.
struct Group {
  std::unique_ptr<Context> root;
  std::shared_ptr<MeshStore> meshes = std::make_shared<MeshStore>();
  int generation = 0;

  ~Group() {
    if (root == nullptr) return;
    const Current current(*root);
    meshes.reset();
  }
};

class Device final : public EglDevice, public std::enable_shared_from_this<Device> {
 public:
  explicit Device(std::shared_ptr<const Display> display) : display_(std::move(display)) {}

  const std::string& renderer() const override { return display_->renderer(); }
  bool software() const override { return is_software_renderer(renderer()); }
  std::unique_ptr<RasterBackend> make_rasterizer(std::shared_ptr<const RayTable> rays) override;
  int losses() const override {
    const std::lock_guard lock(mutex_);
    return losses_;
  }
  void lose_contexts() override {
    const std::lock_guard lock(mutex_);
    forget(generation_);
  }

  std::shared_ptr<const Display> display() const { return display_; }
  /// The group in force, made anew after a loss.
  Result<std::shared_ptr<const Group>> group();
  bool in_force(const Group& group) const {
    const std::lock_guard lock(mutex_);
    return group.generation == generation_;
  }
  void report_loss(const Group& group) {
    const std::lock_guard lock(mutex_);
    forget(group.generation);
  }

 private:
  /// Several cameras report the same loss.
  void forget(int generation) {
    if (generation != generation_) return;
    ++generation_;
    ++losses_;
    group_.reset();
    log::warning("egl: the GPU's contexts were lost ({} of {} times)", losses_, kMaxLosses);
  }

  const std::shared_ptr<const Display> display_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Group> group_;
  int generation_ = 0;
  int losses_ = 0;
};

Result<std::shared_ptr<const Group>> Device::group() {
  const std::lock_guard lock(mutex_);
  if (group_ != nullptr) return group_;
  if (losses_ >= kMaxLosses) {
    return make_error(ErrorCode::kUnavailable, "egl", "the GPU's contexts were lost {} times",
                      losses_);
  }
  auto made = std::make_shared<Group>();
  SL_ASSIGN(made->root, Context::create(display_, nullptr));
  made->generation = generation_;
  group_ = made;
  return group_;
}

/// One camera's rasterizer: follows the device from one share group to the next.
class Rasterizer final : public RasterBackend {
 public:
  Rasterizer(std::shared_ptr<Device> device, std::shared_ptr<const RayTable> rays)
      : device_(std::move(device)), rays_(std::move(rays)) {}
  ~Rasterizer() override { drawer_.reset(); }

  std::string_view name() const override { return "egl"; }

  TileRect bounds(const RenderMesh& mesh, const Rigid3& camera_from_object,
                  int margin_px) const override {
    return project_box(*rays_, mesh.min_corner.cast<double>(), mesh.max_corner.cast<double>(),
                       camera_from_object, margin_px);
  }

  Status draw(const RenderMesh& mesh, const Rigid3& camera_from_object, RasterTile& tile) override {
    // The frame after a loss is drawn in a new context.
    for (int attempt = 0; attempt < 2; ++attempt) {
      SL_RETURN_IF_ERROR(follow());
      std::string what;
      const DrawFailure failure = drawer_->draw(mesh, camera_from_object, tile, what);
      if (failure == DrawFailure::kNone) return {};
      if (failure == DrawFailure::kError)
        return make_error(ErrorCode::kInternal, "egl", "drawing failed: {}", what);
      device_->report_loss(*group_);
    }
    return make_error(ErrorCode::kInternal, "egl", "the context was lost again at once");
  }

 private:
  Status follow() {
    if (drawer_ != nullptr && device_->in_force(*group_)) return {};
    drawer_.reset();
    group_.reset();
    SL_ASSIGN(auto group, device_->group());
    SL_ASSIGN(drawer_, TileDrawer::create(device_->display(), *group->root, group->meshes, rays_));
    group_ = std::move(group);
    return {};
  }

  const std::shared_ptr<Device> device_;
  const std::shared_ptr<const RayTable> rays_;
  std::shared_ptr<const Group> group_;
  std::unique_ptr<TileDrawer> drawer_;
};

std::unique_ptr<RasterBackend> Device::make_rasterizer(std::shared_ptr<const RayTable> rays) {
  return std::make_unique<Rasterizer>(shared_from_this(), std::move(rays));
}

}  // namespace

Result<std::shared_ptr<EglDevice>> EglDevice::open() {
  SL_ASSIGN(auto display, Display::open());
  return std::shared_ptr<EglDevice>(std::make_shared<Device>(std::move(display)));
}

}  // namespace sightline
