// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>

#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Upright camera at `distance` from `center`, looking at it from `direction` (unit).
Rigid3 look_at_center(const Eigen::Vector3d& direction, const Eigen::Vector3d& center,
                      double distance);

/// The only hand that fills a ViewpointModel: from images, or from a file.
class ViewpointModelBuilder {
 public:
  static Result<std::shared_ptr<const ViewpointModel>> from_mesh(
      const TriangleMesh& mesh, const DepthRendererFactory& factory,
      const ViewpointModelOptions& options);
  static std::string write(const ViewpointModel& model);
  static Result<std::shared_ptr<const ViewpointModel>> read(std::string_view content, uint64_t key,
                                                            const std::string& where);
};

}  // namespace sightline::observe
