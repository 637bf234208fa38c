// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/features/feature_model.hpp"

namespace sightline {

struct TrainOptions {
  int per_image = 600;        ///< ORB features on the object, strongest first, 10..2000
  int border_px = 4;          ///< from the object's outline inwards: no feature there
  double same_place = 0.003;  ///< [m] features nearer than this ...
  int same_bits = 40;         ///< ... that differ in at most so many bits are one feature
  double steepest = 1.2;      ///< [rad] between the view and the surface's normal
  size_t max = 8000;          ///< features of the model, at most FeatureModel::kMax
};

/// Learns an object's features from images with its pose; their places come from the mesh. One
/// thread at a time; the same images in the same order give the same model.
class FeatureTrainer {
 public:
  /// `mesh`: mesh_content().
  explicit FeatureTrainer(uint64_t mesh, const TrainOptions& options = {});

  /// Takes what the image shows of the object that is not known yet; the number of new features.
  /// `depth` renders the object's mesh for this camera; `scene` is the static scene before this
  /// camera, which may hide the object (1/z as in DepthTile; width 0: nothing). Nothing else may
  /// hide it in the image. An image of another size than the camera's trains nothing.
  size_t train(const Frame& frame, const CalibratedCamera& camera, const Rigid3& world_from_object,
               DepthRenderer& depth, const DepthTile& scene = {});

  const FeatureModel& model() const { return model_; }

 private:
  TrainOptions options_;
  FeatureModel model_;
};

}  // namespace sightline
