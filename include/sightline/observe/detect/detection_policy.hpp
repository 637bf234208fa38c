// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/shape_symmetry.hpp"
#include "sightline/observe/detect/color_verifier.hpp"
#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/observe/terms/pose_proposals.hpp"

namespace sightline {

/// What colors and texture make of a detection: less of outline and edges is enough where the
/// colors of the mesh agree with the images, more is needed where they do not, and both tell poses
/// apart that are the same by shape. A print (textures of the mesh) is more than colors: a pose at
/// which the images do not show it is none. Plain value; any thread.
class DetectionPolicy {
 public:
  /// `accept`: evidence that is asked for (DetectorOptions::accept). `printed`: the colors that are
  /// given below are those of a print.
  DetectionPolicy(ShapeSymmetry shape_symmetry, double accept, bool printed)
      : shape_symmetry_(std::move(shape_symmetry)), accept_(accept), printed_(printed) {}

  /// Options of the detector whose detections go through by_outline().
  static DetectorOptions detector_options(DetectorOptions options, bool has_colors);

  /// What is left of a detection by outline and edges after the colors (null: none) have been
  /// asked; nothing if it is too weak then.
  Detection by_outline(Detection detection, const ColorVerifier* colors) const;
  /// Marks the proposals at which the images show the print; before ObjectDetector::judge().
  PoseProposals confirm(PoseProposals proposals, const ColorVerifier* colors) const;
  /// The same as by_outline() of one by trained features, which is believed as it is. Fills
  /// Observation::symmetric_hypotheses: what supports the pose is elsewhere in those that its shape
  /// cannot tell from it.
  Detection by_features(Detection detection, const ColorVerifier* colors) const;

 private:
  ShapeSymmetry shape_symmetry_;
  double accept_;
  bool printed_;
};

}  // namespace sightline
