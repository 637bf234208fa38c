// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/object_views.hpp"

#include <cstdlib>
#include <string>

#include "sightline/pipeline/mesh_depth_renderer.hpp"

namespace sightline {
namespace {

// Relative paths are to be ignored, says the XDG base directory specification.
std::filesystem::path absolute_or_none(const std::filesystem::path& path) {
  return path.is_absolute() ? path : std::filesystem::path();
}

std::filesystem::path from_environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::filesystem::path() : absolute_or_none(value);
}

struct Stopped {};

// A model of a large mesh takes long to make: observe renders view after view, and leaves through
// here when nobody waits for it any more.
class StoppableRenderer final : public DepthRenderer {
 public:
  StoppableRenderer(std::unique_ptr<DepthRenderer> renderer, std::stop_token stop)
      : renderer_(std::move(renderer)), stop_(std::move(stop)) {}

  const CameraModel& camera() const override { return renderer_->camera(); }
  DepthTile render(const Rigid3& camera_from_object) override {
    if (stop_.stop_requested()) throw Stopped();
    return renderer_->render(camera_from_object);
  }

 private:
  std::unique_ptr<DepthRenderer> renderer_;
  std::stop_token stop_;
};

}  // namespace

std::filesystem::path cache_folder() {
  const std::string service = from_environment("CACHE_DIRECTORY").string();
  if (!service.empty()) return service.substr(0, service.find(':'));
  if (const auto user = from_environment("XDG_CACHE_HOME"); !user.empty()) {
    return user / "sightline";
  }
  const auto home = from_environment("HOME");
  return home.empty() ? home : home / ".cache" / "sightline";
}

Result<std::shared_ptr<const ViewpointModel>> load_views(const TriangleMesh& mesh,
                                                         std::shared_ptr<const RenderMesh> shown,
                                                         const std::filesystem::path& file,
                                                         const std::filesystem::path& cache,
                                                         std::stop_token stop) {
  const DepthRendererFactory plain = mesh_depth_renderer_factory(std::move(shown));
  const DepthRendererFactory factory = [&](const CameraModel& camera) {
    return std::make_unique<StoppableRenderer>(plain(camera), stop);
  };
  try {
    auto views = ViewpointModel::load_or_build(mesh, factory, {}, cache);
    if (views) return views;
    return make_error(views.error().code, file.string(), "{}", views.error().text);
  } catch (const Stopped&) {
    return make_error(ErrorCode::kUnavailable, file.string(),
                      "its viewpoint model was being made when the program was told to stop");
  }
}

}  // namespace sightline
