// SPDX-License-Identifier: Apache-2.0
#include "observe/track/texture_measurement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

PoseTermPtr TextureMeasurement::measure(const PlaneView& gray, const PosePrior& prior,
                                        const Rigid3& fitted, const Occluders& occluders,
                                        bool ambiguous, const ViewError& error,
                                        TexturePoints& points, int& used) {
  const TrackerOptions& options = camera_.options;
  const Rigid3 camera_from_object = camera_.camera_from_world * fitted;
  points.find(gray, camera_from_object, occluders, ambiguous);
  const auto& found = points.found();
  if (found.size() < kMinPoints) return nullptr;
  const LineProjector projector(camera_.camera->model, camera_from_object);
  residuals_.clear();
  for (const TexturePoints::Found& point : found) {
    for (const Eigen::Vector2d& axis : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
      LineResidual& residual = residuals_.emplace_back();
      residual.sigma = options.texture_floor_px;
      if (!projector.distance(point.point_in_object, point.pixel, axis, residual.offset,
                              residual.by_pose)) {
        return nullptr;
      }
      residual.offset = -residual.offset;
    }
  }
  const Vector6 step =
      fit_lines(residuals_, prior.information, prior.offset_of(fitted), options.huber);
  pose_ = fitted * Rigid3::exp(step);
  const double scale = std::max(1.0, residual_scale(residuals_, step, scratch_));
  const double sigma = scale * options.texture_floor_px;
  if (sigma > options.max_texture_noise_px) return nullptr;
  std::vector<PointMatch> matches;
  matches.reserve(found.size());
  for (size_t i = 0; i < found.size(); ++i) {
    const auto off = [&](size_t k) {
      return std::abs(residuals_[k].by_pose.dot(step) - residuals_[k].offset);
    };
    if (std::max(off(2 * i), off(2 * i + 1)) > kOutlierSigmas * sigma) continue;
    matches.push_back({found[i].point_in_object, found[i].pixel, sigma});
  }
  used = static_cast<int>(matches.size());
  if (matches.size() < kMinPoints) return nullptr;
  return std::make_shared<ReprojectionTerm>(camera_.owner, std::move(matches), options.huber, error,
                                            "texture");
}

}  // namespace sightline::observe
