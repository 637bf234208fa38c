// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/feature_model.hpp"

namespace sightline {

struct TeachOptions {
  int per_picture = 600;      ///< ORB features on the object, strongest first, 10..2000
  int border_px = 4;          ///< from the object's outline inwards: no feature there
  double same_place = 0.003;  ///< [m] features nearer than this ...
  int same_bits = 40;         ///< ... that differ in at most so many bits are one feature
  double steepest = 1.2;      ///< [rad] between the view and the surface's normal
  size_t most = 8000;         ///< features of the model, at most FeatureModel::kMost
};

/// Teaches an object's features from pictures with its pose, places from the mesh. One thread at a
/// time; the same pictures in the same order give the same model.
class FeatureTeacher {
 public:
  /// `mesh`: mesh_content().
  explicit FeatureTeacher(uint64_t mesh, const TeachOptions& options = {});

  /// Takes what the picture shows of the object that is not known yet; the number of new features.
  /// `depth` renders the object's mesh for this camera; `scene` is what stands still before this
  /// camera and may hide the object (1/z as in DepthTile; width 0: nothing). What hides it beside
  /// that must not be in the picture. A picture of another size than the camera's teaches nothing.
  size_t teach(const Frame& frame, const CalibratedCamera& camera, const Rigid3& world_from_object,
               DepthRenderer& depth, const DepthTile& scene = {});

  const FeatureModel& model() const { return model_; }

 private:
  TeachOptions options_;
  FeatureModel model_;
};

}  // namespace sightline
