// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>

#include "observe/features/feature_match.hpp"
#include "observe/features/orb_features.hpp"
#include "observe/terms/surface_patch.hpp"
#include "sightline/observe/features/feature_trainer.hpp"

namespace sightline {
namespace {

using observe::bits_apart;
using observe::OrbFeature;
using observe::SurfacePatch;

/// The surface point under a pixel, camera frame; empty near the outline or where depths jump.
std::optional<Eigen::Vector3d> surface_at(const CameraModel& camera, const DepthTile& tile,
                                          const Eigen::Vector2d& pixel) {
  const auto ray = camera.unproject(pixel);
  const int x = static_cast<int>(std::floor(pixel.x())),
            y = static_cast<int>(std::floor(pixel.y()));
  const double u = pixel.x() - x, v = pixel.y() - y;
  const double corners[] = {tile.at(x, y), tile.at(x + 1, y), tile.at(x, y + 1),
                            tile.at(x + 1, y + 1)};
  const auto [min, max] = std::minmax_element(std::begin(corners), std::end(corners));
  if (!ray || *min <= 0 || *max > 1.02 * *min) return std::nullopt;
  const double inverse = (1 - v) * ((1 - u) * corners[0] + u * corners[1]) +
                         v * ((1 - u) * corners[2] + u * corners[3]);
  return Eigen::Vector3d(*ray / ray->z() / inverse);
}

/// Unit, towards the camera, from the points beside it; empty where they are unknown.
std::optional<Eigen::Vector3d> normal_at(const CameraModel& camera, const DepthTile& tile,
                                         const Eigen::Vector2d& pixel,
                                         const Eigen::Vector3d& point) {
  const auto right = surface_at(camera, tile, pixel + Eigen::Vector2d(2, 0));
  const auto below = surface_at(camera, tile, pixel + Eigen::Vector2d(0, 2));
  if (!right || !below) return std::nullopt;
  const Eigen::Vector3d normal = (*right - point).cross(*below - point).normalized();
  return normal.dot(point) < 0 ? normal : -normal;
}

}  // namespace

FeatureTrainer::FeatureTrainer(uint64_t mesh, const TrainOptions& options) : options_(options) {
  model_.mesh = mesh;
  options_.max = std::min(options_.max, FeatureModel::kMax);
}

size_t FeatureTrainer::train(const Frame& frame, const CalibratedCamera& camera,
                             const Rigid3& world_from_object, DepthRenderer& depth,
                             const DepthTile& scene) {
  const Rigid3 camera_from_object = camera.world_from_camera.inverse() * world_from_object;
  const DepthTile tile = depth.render(camera_from_object);
  if (tile.width == 0 || frame.info().width != camera.model.width() ||
      frame.info().height != camera.model.height()) {
    return 0;
  }
  const int b = options_.border_px;
  const auto shown = [&](int x, int y) {
    const float object = tile.at(x, y);
    return object > 0 && scene.at(x, y) <= object;
  };
  const auto inside = [&](int x, int y) {
    return shown(x, y) && shown(x - b, y) && shown(x + b, y) && shown(x, y - b) && shown(x, y + b);
  };
  const auto seen = observe::orb_features(frame.gray(), tile.x, tile.y, tile.x + tile.width,
                                          tile.y + tile.height, options_.per_image, inside);
  const Rigid3 object_from_camera = camera_from_object.inverse();
  const size_t before = model_.features.size();
  for (const OrbFeature& feature : seen) {
    if (model_.features.size() >= options_.max) break;
    const auto point = surface_at(camera.model, tile, feature.pixel);
    const auto patch = observe::image_patch(camera.model, feature.pixel, feature.angle,
                                            observe::kOrbPatch * feature.scale);
    const auto normal = point ? normal_at(camera.model, tile, feature.pixel, *point) : std::nullopt;
    if (!normal || !patch) continue;
    if (!(-normal->dot(patch->ray) >= std::cos(options_.steepest))) continue;
    const SurfacePatch surface = observe::surface_patch(*patch, *normal, point->norm());
    const auto in_object = [&](const Eigen::Vector3d& axis) -> Eigen::Vector3f {
      return (object_from_camera.rotation * axis).cast<float>();
    };
    TrainedFeature trained;
    trained.point = (object_from_camera * *point).cast<float>();
    trained.view = in_object(surface.seen_from);
    trained.normal = in_object(surface.normal);
    trained.direction = in_object(surface.direction);
    trained.size = static_cast<float>(surface.size);
    trained.descriptor = feature.descriptor;
    const bool known = std::any_of(
        model_.features.begin(), model_.features.end(), [&](const TrainedFeature& other) {
          return (other.point - trained.point).norm() < static_cast<float>(options_.same_place) &&
                 bits_apart(other.descriptor, trained.descriptor) <= options_.same_bits;
        });
    if (!known) model_.features.push_back(trained);
  }
  return model_.features.size() - before;
}

}  // namespace sightline
