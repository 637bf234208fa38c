// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/scan_places.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kShare = 2.0 / 3;    // of a picture, from one place to the next
constexpr double kNarrow = 0.02;      // [rad], of a view: places are not nearer than its share
constexpr double kLeastCosine = 0.2;  // near the zenith one picture sees all around
constexpr double kTurn = 2 * std::numbers::pi;  // then it has looked all around

// Steps on one axis about `from`, ending at the limits at the latest. Growing.
std::vector<double> steps(double from, double step, double low, double high) {
  std::vector<double> out{from};
  for (const double sign : {-1.0, 1.0}) {
    const double end = sign < 0 ? low : high;
    double at = from;
    while (sign * (end - at) > 0.25 * step) {
      at = sign > 0 ? std::min(at + step, end) : std::max(at - step, end);
      out.push_back(at);
    }
  }
  std::ranges::sort(out);
  return out;
}

struct Place {
  HeadAngles angles;
  long ring;
  double around;  ///< in its ring [rad]
};

}  // namespace

HeadAngles view_angles(const CameraModel& model) {
  const double x = (model.width() - 1) / 2.0, y = (model.height() - 1) / 2.0;
  const auto angle = [&](const Eigen::Vector2d& one, const Eigen::Vector2d& other) {
    const auto a = model.unproject(one), b = model.unproject(other);
    if (!a || !b) return 2.0;
    const double cosine = a->normalized().dot(b->normalized());
    return std::min(std::acos(std::clamp(cosine, -1.0, 1.0)), 2.0);
  };
  return {angle({0, y}, {2 * x, y}), angle({x, 0}, {x, 2 * y})};
}

std::vector<HeadAngles> scan_places(const HeadAngles& from, const HeadAngles& view,
                                    const HeadLimits& limits) {
  const HeadAngles middle = from.cwiseMax(limits.low).cwiseMin(limits.high);
  const HeadAngles step = kShare * view.cwiseMax(kNarrow);
  double low = limits.low.x(), high = limits.high.x();
  if (high - low > kTurn) {
    low = std::clamp(middle.x() - kTurn / 2, low, high - kTurn);
    high = low + kTurn;
  }
  std::vector<Place> places;
  for (const double tilt : steps(middle.y(), step.y(), limits.low.y(), limits.high.y())) {
    const double wide = step.x() / std::max(std::cos(tilt), kLeastCosine);
    for (const double pan : steps(middle.x(), wide, low, high)) {
      const HeadAngles off((pan - middle.x()) / wide, (tilt - middle.y()) / step.y());
      places.push_back({{pan, tilt},
                        std::lround(std::ceil(off.cwiseAbs().maxCoeff() - 1e-9)),
                        off.isZero() ? 0 : std::atan2(off.y(), off.x())});
    }
  }
  std::ranges::sort(places, {}, [](const Place& one) { return std::pair(one.ring, one.around); });
  std::vector<HeadAngles> out;
  for (const Place& place : places) {
    if (out.size() < kMostScanPlaces) out.push_back(place.angles);
  }
  return out;
}

}  // namespace sightline
