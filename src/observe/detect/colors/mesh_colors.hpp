// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/detect/colors/color_templates.hpp"
#include "observe/detect/search_camera.hpp"
#include "sightline/base/executor.hpp"

namespace sightline::observe {

/// How well the colors of the mesh agree with the images of one search.
class MeshColors {
 public:
  /// `images`, `cameras`: one for each camera that takes part; they must outlive this.
  MeshColors(const TemplateBank& bank, const ColorTemplates& templates,
             std::span<const SearchCamera> cameras, std::span<const HalfSizeImage* const> images,
             const Executor& executor);

  /// ColorTemplates::correlation(), the mean over the cameras that have the pose in their image, of
  /// three and more without the worst.
  double agreement(const Rigid3& world_from_object) const;
  /// In one camera, of a pose in its maps.
  float agreement(size_t camera, const WeakPerspectivePose& pose) const {
    return templates_.correlation(pose, maps_[camera]);
  }

 private:
  const TemplateBank& bank_;
  const ColorTemplates& templates_;
  std::span<const SearchCamera> cameras_;
  std::vector<ColorMap> maps_;
};

}  // namespace sightline::observe
