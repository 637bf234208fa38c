// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/search_region.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline::observe {
namespace {

constexpr int kAlign = 8;         // so that a region has whole pixels at half and quarter size
constexpr int kMinMarginPx = 16;  // white surroundings that the detectors need

int align_down(double v) { return static_cast<int>(std::floor(v / kAlign)) * kAlign; }
int align_up(double v) { return static_cast<int>(std::ceil(v / kAlign)) * kAlign; }

/// Standard deviation of the object's place in the image [px].
double spread_px(const PoseEstimate& estimate, const CalibratedCamera& camera, double radius) {
  const double distance =
      translation_distance(camera.world_from_camera, estimate.world_from_object);
  const double sigma = estimate.sigma_translation() + radius * estimate.sigma_rotation();
  return camera.model.parameters().fx * sigma / std::max(distance, 1e-3);
}

}  // namespace

double shortest_side(const std::array<Eigen::Vector2d, 4>& corners) {
  double side = (corners[0] - corners[3]).norm();
  for (size_t k = 0; k < 3; ++k) side = std::min(side, (corners[k + 1] - corners[k]).norm());
  return side;
}

Region Region::united(const Region& other) const {
  return {std::min(left, other.left), std::min(top, other.top), std::max(right, other.right),
          std::max(bottom, other.bottom)};
}

Region whole_image(const CameraModel& camera) { return {0, 0, camera.width(), camera.height()}; }

std::optional<Expectation> expect(const PoseTrack* track, Time time, const CalibratedCamera& camera,
                                  const std::vector<SquareInObject>& squares,
                                  const FiducialOptions& options) {
  if (track == nullptr || track->empty()) return std::nullopt;
  const PoseAt at = track->at(time);
  if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) return std::nullopt;
  Expectation out;
  out.world_from_object = at.estimate.world_from_object;
  out.confident = at.estimate.state == TrackState::kTracking;

  const Rigid3 camera_from_object = camera.world_from_camera.inverse() * out.world_from_object;
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;
  double radius = 0;
  double smallest = std::numeric_limits<double>::infinity();
  for (const SquareInObject& square : squares) {
    std::array<Eigen::Vector2d, 4> pixels;
    for (size_t k = 0; k < 4; ++k) {
      radius = std::max(radius, square[k].norm());
      const auto pixel = camera.model.project(camera_from_object * square[k]);
      if (!pixel) return out;  // behind the camera or beyond the lens: an empty region
      pixels[k] = *pixel;
      low = low.min(pixel->array());
      high = high.max(pixel->array());
    }
    const Eigen::Vector2d u = pixels[1] - pixels[0];
    const Eigen::Vector2d v = pixels[3] - pixels[0];
    if (u.x() * v.y() - u.y() * v.x() <= 0) continue;  // seen from behind
    const double side = shortest_side(pixels);
    if (side >= options.min_side_px) smallest = std::min(smallest, side);
  }
  if (std::isfinite(smallest)) out.smallest_side_px = smallest;
  const double margin = kMinMarginPx + options.region_margin * (high - low).maxCoeff() +
                        options.region_sigmas * spread_px(at.estimate, camera, radius);
  const Region whole = whole_image(camera.model);
  low = (low - margin).max(-1e6);
  high = (high + margin).min(1e6);
  out.region = {std::max(whole.left, align_down(low.x())), std::max(whole.top, align_down(low.y())),
                std::min(whole.right, align_up(high.x())),
                std::min(whole.bottom, align_up(high.y()))};
  return out;
}

}  // namespace sightline::observe
