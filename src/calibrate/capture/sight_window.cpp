// SPDX-License-Identifier: Apache-2.0
#include "calibrate/capture/sight_window.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::calibrate {

using namespace std::chrono_literals;

namespace {

constexpr Duration kKept = 3s;
constexpr size_t kMost = 4096;    // kKept bounds it: 3 s of more than 1000 Hz
constexpr Duration kNow = 500ms;  // what is older is not what a camera sees now

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

using Sights = std::vector<const TargetSight*>;

/// Means of the corners that all of them show.
std::vector<TargetCorner> mean_corners(const Sights& sights) {
  std::vector<TargetCorner> out;
  for (const TargetCorner& first : sights.front()->corners) {
    TargetCorner mean{first.id, Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
    size_t count = 0;
    for (const TargetSight* sight : sights) {
      const TargetCorner* corner = find_corner(sight->corners, first.id);
      if (corner == nullptr) break;
      mean.pixel += corner->pixel;
      ++count;
    }
    if (count < sights.size()) continue;
    mean.pixel /= static_cast<double>(count);
    out.push_back(mean);
  }
  return out;
}

/// Farthest that an image's corners are from the means, by its median corner.
double largest_motion(const Sights& sights, const std::vector<TargetCorner>& means) {
  double most = 0;
  for (const TargetSight* sight : sights) {
    std::vector<double> ways;
    for (const TargetCorner& mean : means) {
      ways.push_back((find_corner(sight->corners, mean.id)->pixel - mean.pixel).norm());
    }
    most = std::max(most, median(std::move(ways)));
  }
  return most;
}

}  // namespace

const TargetCorner* find_corner(const std::vector<TargetCorner>& corners, int id) {
  const auto found = std::ranges::lower_bound(corners, id, {}, &TargetCorner::id);
  return found != corners.end() && found->id == id ? &*found : nullptr;
}

void SightWindow::add(const TargetSight& sight) {
  sights_.push_back(sight);
  while (sights_.size() > kMost ||
         (sights_.size() > 4 && sight.capture - sights_.front().capture > kKept)) {
    sights_.pop_front();
  }
}

Duration SightWindow::period() const {
  if (sights_.size() < 2) return {};
  std::vector<double> steps;
  for (size_t i = 1; i < sights_.size(); ++i) {
    steps.push_back(to_seconds(sights_[i].capture - sights_[i - 1].capture));
  }
  return from_seconds(median(std::move(steps)));
}

bool SightWindow::sees_it(Time now, size_t min_corners) const {
  if (sights_.empty() || sights_.back().corners.size() < min_corners) return false;
  return now - sights_.back().capture <= std::max<Duration>(kNow, 2 * period() + period() / 2);
}

SightWindow::State SightWindow::steady(const CaptureGuideOptions& options, Duration still,
                                       double width_px, SteadyView& out) const {
  Sights used;
  for (auto sight = sights_.rbegin(); sight != sights_.rend(); ++sight) {
    if (sight->corners.size() < options.min_corners) break;
    used.push_back(&*sight);
    const bool long_enough = used.front()->capture - sight->capture >= still;
    if (used.size() >= options.still_images && long_enough) break;
  }
  if (used.empty()) return State::kNotSeen;
  out.from = used.back()->capture;
  out.to = used.front()->capture;
  out.capture = out.from + (out.to - out.from) / 2;
  out.corners = mean_corners(used);
  if (out.corners.size() < options.min_corners) return State::kTooShort;
  if (largest_motion(used, out.corners) > options.still_share * width_px) return State::kMoving;
  if (used.size() < options.still_images || out.to - out.from < still) return State::kTooShort;
  std::vector<double> edges;
  for (const TargetSight* sight : used) edges.push_back(sight->edge_px);
  out.edge_px = median(std::move(edges));
  return State::kSteady;
}

std::optional<SteadyView> SightWindow::moment(Time at, size_t min_corners) const {
  size_t best = 0;
  for (size_t i = 1; i + 1 < sights_.size(); ++i) {
    const auto away = [&](size_t k) { return std::chrono::abs(sights_[k].capture - at); };
    if (best == 0 || away(i) < away(best)) best = i;
  }
  if (best == 0) return std::nullopt;
  const TargetSight &before = sights_[best - 1], &now = sights_[best], &after = sights_[best + 1];
  const Duration step = period();
  if (std::chrono::abs(now.capture - at) > step / 2 + step / 20) return std::nullopt;
  if (after.capture - before.capture > 5 * step) return std::nullopt;
  SteadyView out{before.capture, after.capture, now.capture, {}, now.edge_px};
  for (const TargetCorner& corner : now.corners) {
    const TargetCorner* a = find_corner(before.corners, corner.id);
    const TargetCorner* b = find_corner(after.corners, corner.id);
    if (a == nullptr || b == nullptr) continue;
    out.corners.push_back({corner.id, corner.pixel,
                           (b->pixel - a->pixel) / to_seconds(after.capture - before.capture)});
  }
  if (out.corners.size() < min_corners) return std::nullopt;
  return out;
}

}  // namespace sightline::calibrate
