// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "observe/detect/contour_search.hpp"
#include "observe/detect/pose_fit.hpp"

// What the stages of a search come to, made up for those that judge it.
namespace sightline::observe {

// What a fit of all cameras comes to whose lines agree to this share.
inline PoseFit made_fit(const Rigid3& pose, const std::vector<double>& shares) {
  PoseFit out{{pose, Vector6::Zero()}, {}};
  for (const double share : shares) {
    CameraFit camera;
    camera.lines = 100;
    camera.agreeing = static_cast<int>(100 * share);
    camera.contrast = 1;
    camera.term.information = 100 * Matrix6::Identity();
    out.cameras.push_back(camera);
  }
  return out;
}

// A pose that so many cameras score by its outline.
inline ContourPose made_contour(const Rigid3& pose, std::vector<double> cameras) {
  ContourPose out{made_fit(pose, cameras), cameras, 0};
  out.rank = joint_rank(cameras, cameras.size());
  out.score = joint_score(std::move(cameras));
  return out;
}

}  // namespace sightline::observe
