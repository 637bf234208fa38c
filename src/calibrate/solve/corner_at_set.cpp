// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/corner_at_set.hpp"

#include <algorithm>

namespace sightline::calibrate {
namespace {

/// How much later than the time of its set a corner was exposed [s], as if its speed were
/// px_per_s, with the derivatives.
struct Delay {
  double seconds = 0;
  double by_offset = 1, by_readout = 0;
};

Delay delay_of(const TargetView& view, const TargetCorner& corner, const double* values,
               int height) {
  constexpr double kLeastFactor = 0.2;  // what no camera has, but a solver may try
  if (height <= 0) return {view.delay_s + values[kTimeOffset], 1, 0};
  const double rows = height;
  const double after_middle = (corner.pixel.y() - 0.5 * (rows - 1)) / rows;  // of the read-out
  const double heights_per_s = corner.px_per_s.y() / rows;
  const double delay = view.delay_s + values[kTimeOffset] + values[kReadout] * after_middle;
  const double factor = std::max(kLeastFactor, 1 + values[kReadout] * heights_per_s);
  const double seconds = delay / factor;
  return {seconds, 1 / factor, (after_middle - seconds * heights_per_s) / factor};
}

}  // namespace

CornerAtSet corner_at_set(const TargetView& view, const TargetCorner& corner, const double* values,
                          int height) {
  const Delay delay = delay_of(view, corner, values, height);
  const double t = delay.seconds;
  const Eigen::Vector2d speed_then = corner.px_per_s - t * corner.px_per_s2;
  return {corner.pixel - t * corner.px_per_s + 0.5 * t * t * corner.px_per_s2,
          -delay.by_offset * speed_then, -delay.by_readout * speed_then};
}

Eigen::Vector2d pixel_at_set(const TargetView& view, const TargetCorner& corner,
                             const CalibratedCamera& camera) {
  LensVector values{};
  values[kTimeOffset] = camera.time_offset_s;
  values[kReadout] = camera.readout_s;
  return corner_at_set(view, corner, values.data(), camera.model.height()).pixel;
}

}  // namespace sightline::calibrate
