// SPDX-License-Identifier: Apache-2.0
#include "observe/track/print/texture_measurement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

bool TextureMeasurement::linearize() {
  const LineProjector projector(camera_.camera->model, camera_.camera_from_world * at_);
  residuals_.clear();
  for (const TexturePoints::Found& point : found_) {
    for (const Eigen::Vector2d& axis : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
      LineResidual& residual = residuals_.emplace_back();
      residual.sigma = camera_.options.texture_floor_px;
      if (!projector.distance(point.point_in_object, point.pixel, axis, residual.offset,
                              residual.by_pose)) {
        return false;
      }
      residual.offset = -residual.offset;
    }
  }
  return true;
}

void TextureMeasurement::correct_for_rolling(const PlacedOutline& moving) {
  for (size_t i = 0; i < found_.size(); ++i) {
    const double row = found_[i].pixel.y();
    for (size_t axis = 0; axis < 2; ++axis) {
      LineResidual& residual = residuals_[2 * i + axis];
      const double rolled = moving.rolled_px(residual.by_pose, row);
      residual.offset -= rolled;
      found_[i].pixel(static_cast<Eigen::Index>(axis)) -= rolled;
    }
  }
}

void TextureMeasurement::find(const PlaneView& gray, const PosePrior& prior,
                              std::span<const Rigid3> starts, const Occluders& occluders,
                              bool ambiguous, TexturePoints& points) {
  found_.clear();
  bool first = true;
  for (const Rigid3& start : starts) {
    Rigid3 at = start;
    bool enough = false;
    for (int round = 0; round < rules_.rounds; ++round) {
      // What is missed counts once.
      points.find(gray, camera_.camera_from_world * at, occluders, ambiguous || !first);
      first = false;
      const auto& found = points.found();
      if (found.size() < found_.size() || (found.size() == found_.size() && !enough)) break;
      found_.assign(found.begin(), found.end());
      at_ = at;
      // Where it took rounds to get there what is farthest off may have been found at places that
      // look alike: it is looked at once more from where all of them lead.
      const bool once_more = round > 0 && !enough;
      enough =
          found_.size() >= kTexturedPoints && 10 * found_.size() >= kMostPoints * points.tried();
      if (enough && !once_more) return;
      if (round + 1 == rules_.rounds || found_.size() < kLeadingPoints || !linearize()) break;
      at = at_ * Rigid3::exp(fit_lines(residuals_, prior.information, prior.offset_of(at_),
                                       camera_.options.huber));
    }
  }
}

PoseTermPtr TextureMeasurement::measure(const PlaneView& gray, const PosePrior& prior,
                                        std::span<const Rigid3> starts, const Occluders& occluders,
                                        bool ambiguous, TexturePoints& points, int& used,
                                        const PlacedOutline* moving) {
  const TrackerOptions& options = camera_.options;
  find(gray, prior, starts, occluders, ambiguous, points);
  if (found_.size() < kMinPoints || !linearize()) return nullptr;
  if (moving != nullptr) correct_for_rolling(*moving);
  const Vector6 step =
      fit_lines(residuals_, prior.information, prior.offset_of(at_), options.huber);
  pose_ = at_ * Rigid3::exp(step);
  const double scale = std::max(1.0, residual_scale(residuals_, step, scratch_));
  const double sigma = scale * options.texture_floor_px;
  if (sigma > options.max_texture_noise_px) return nullptr;
  std::vector<PointMatch> matches;
  matches.reserve(found_.size());
  for (size_t i = 0; i < found_.size(); ++i) {
    const auto off = [&](size_t k) {
      return std::abs(residuals_[k].by_pose.dot(step) - residuals_[k].offset);
    };
    if (std::max(off(2 * i), off(2 * i + 1)) > kOutlierSigmas * sigma) continue;
    matches.push_back({found_[i].point_in_object, found_[i].pixel, sigma});
  }
  used = static_cast<int>(matches.size());
  if (matches.size() < kMinPoints) return nullptr;
  const char* const kind = matches.size() < rules_.enough ? "sparse_texture" : "texture";
  return std::make_shared<ReprojectionTerm>(camera_.owner, std::move(matches), options.huber,
                                            rules_.error, kind);
}

}  // namespace sightline::observe
