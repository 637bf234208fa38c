// SPDX-License-Identifier: Apache-2.0
#include "observe/track/symmetry/symmetric_evidence.hpp"

#include <algorithm>
#include <array>

#include "observe/shape/color_correlation.hpp"
#include "observe/track/track_constants.hpp"

namespace sightline::observe {
namespace {

// True if the colors say anything.
bool add_color_costs(const Frame& frame, const std::vector<Rigid3>& poses,
                     const TrackerCamera& camera, const TrackedObject& object,
                     std::vector<double>& costs) {
  std::vector<double> correlation;
  for (const Rigid3& pose : poses) {
    correlation.push_back(print_agreement(frame, pose, camera, object));
  }
  if (*std::max_element(correlation.begin(), correlation.end()) < kMinCorrelation) return false;
  for (size_t k = 0; k < poses.size(); ++k) costs[k] += correlation_cost(correlation[k]);
  return true;
}

// True if the texture says anything.
bool add_texture_costs(const Frame& frame, const std::vector<Rigid3>& poses,
                       const TrackerCamera& camera, const Occluders& occluders,
                       TexturePoints& texture, std::vector<double>& costs) {
  std::vector<size_t> found;
  for (const Rigid3& pose : poses) {
    texture.find(frame.gray(), camera.camera_from_world * pose, occluders, true);
    found.push_back(texture.found().size());
  }
  if (*std::max_element(found.begin(), found.end()) < tuning::kTellingPoints) return false;
  for (size_t k = 0; k < poses.size(); ++k) {
    costs[k] -= tuning::kPointLogLikelihood * static_cast<double>(found[k]);
  }
  return true;
}

}  // namespace

double print_agreement(const Frame& frame, const Rigid3& world_from_object,
                       const TrackerCamera& camera, const TrackedObject& object) {
  const I420View image = frame.i420();
  return color_correlation(*object.samples, camera.camera->model,
                           camera.camera_from_world * world_from_object,
                           {frame.half_gray(), image.u, image.v});
}

std::vector<PoseHypothesis> compare_symmetric_poses(
    const Frame& frame, const Rigid3& fitted, const TrackerCamera& camera,
    const TrackedObject& object, const Occluders& occluders, TexturePoints* texture,
    SilhouetteComparison* silhouettes, ColorComparison* colors) {
  const ShapeSymmetry& symmetry = object.shape_symmetry;
  std::vector<Rigid3> poses = {fitted};
  for (const Rigid3& rotation : symmetry.near_rotations) poses.push_back(fitted * rotation);
  for (const Rigid3& rotation : symmetry.rotations) poses.push_back(fitted * rotation);
  std::vector<double> costs(poses.size(), 0.0);
  bool known = object.samples && add_color_costs(frame, poses, camera, object, costs);
  if (!known && colors != nullptr) {
    const auto& differences = colors->compare(frame.i420(), poses, occluders);
    for (size_t k = 0; k < differences.size(); ++k) costs[k] += differences[k];
    known |= !differences.empty();
  }
  known |= texture && add_texture_costs(frame, poses, camera, occluders, *texture, costs);
  if (silhouettes != nullptr) {
    const auto& outlines = silhouettes->compare(ColorReader(frame.i420()), fitted, occluders);
    // Exact symmetries have the silhouette of the pose itself.
    for (size_t k = 0; !outlines.empty() && k < poses.size(); ++k) {
      costs[k] += outlines[k < outlines.size() ? k : 0];
    }
    known |= !outlines.empty();
  }
  std::vector<PoseHypothesis> out;
  for (size_t k = 0; known && k < poses.size(); ++k) out.push_back({poses[k], costs[k]});
  return out;
}

}  // namespace sightline::observe
