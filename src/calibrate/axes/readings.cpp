// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/readings.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr double kGap = 0.3;         // [s]; readings farther apart say nothing of what is between
constexpr double kHalfSlope = 0.05;  // [s] to either side, for rates
constexpr double kNoise = 1e-7;      // [rad]; axes.csv has 1e-6 degrees

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Readings::Readings(const std::vector<AxisReading>& readings, Time origin) {
  for (const AxisReading& r : readings) {
    times_.push_back(to_seconds(r.stamp - origin));
    angles_.emplace_back(r.pan, r.tilt);
    zoom_.push_back(r.zoom);
  }
  std::vector<double> steps;
  for (size_t i = 1; i < angles_.size(); ++i) {
    for (int axis = 0; axis < 2; ++axis) {
      const double step = std::abs(angles_[i][axis] - angles_[i - 1][axis]);
      if (step > kNoise) steps.push_back(step);
    }
  }
  std::vector<double> bends;
  for (size_t i = 2; i < angles_.size(); ++i) {
    for (int axis = 0; axis < 2; ++axis) {
      bends.push_back(std::abs(angles_[i][axis] - 2 * angles_[i - 1][axis] + angles_[i - 2][axis]));
    }
  }
  if (!bends.empty()) noise_ = 1.4826 * median(bends) / std::sqrt(6.0);
  // Of an encoder that counts in steps the smallest difference is one of them.
  if (steps.size() > 1) step_ = *std::min_element(steps.begin(), steps.end());
}

size_t Readings::after(double time_s) const {
  return static_cast<size_t>(std::lower_bound(times_.begin(), times_.end(), time_s) -
                             times_.begin());
}

std::optional<ReadAngles> Readings::at(double time_s) const {
  const auto value = [&](double t) -> std::optional<Eigen::Vector3d> {
    const size_t b = after(t);
    if (b >= times_.size() || (b == 0 && times_[0] > t)) return std::nullopt;
    if (b == 0) return Eigen::Vector3d(angles_[0].x(), angles_[0].y(), zoom_[0]);
    const double step = times_[b] - times_[b - 1];
    if (step > kGap) return std::nullopt;
    const double share = (t - times_[b - 1]) / step;
    const Eigen::Vector2d angles = angles_[b - 1] + share * (angles_[b] - angles_[b - 1]);
    return Eigen::Vector3d(angles.x(), angles.y(),
                           zoom_[b - 1] + share * (zoom_[b] - zoom_[b - 1]));
  };
  const auto now = value(time_s);
  if (!now) return std::nullopt;
  const auto before = value(time_s - kHalfSlope), behind = value(time_s + kHalfSlope);
  ReadAngles out{now->head<2>(), Eigen::Vector2d::Zero(), now->z()};
  if (before && behind) {
    out.rates = (behind->head<2>() - before->head<2>()) / (2 * kHalfSlope);
  } else if (before || behind) {
    out.rates = (before ? *now - *before : *behind - *now).head<2>() / kHalfSlope;
  }
  return out;
}

bool Readings::constant(double from_s, double to_s, double tolerance) const {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  size_t i = after(from_s);
  const bool any = i < times_.size() && times_[i] <= to_s;
  for (; i < times_.size() && times_[i] <= to_s; ++i) {
    low = low.cwiseMin(angles_[i]);
    high = high.cwiseMax(angles_[i]);
  }
  return any && (high - low).maxCoeff() <= tolerance;
}

std::optional<Readings::Rest> Readings::rest(double from_s, double to_s, double tolerance) const {
  std::vector<double> pan, tilt;
  const size_t begin = after(from_s);
  size_t end = begin;
  for (; end < times_.size() && times_[end] <= to_s; ++end) {
    pan.push_back(angles_[end].x());
    tilt.push_back(angles_[end].y());
  }
  if (pan.empty()) return std::nullopt;
  const Eigen::Vector2d middle(median(pan), median(tilt));
  Rest out{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), 0};
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  double count = 0;
  for (size_t i = begin; i < end; ++i) {
    const Eigen::Vector2d off = angles_[i] - middle;
    if (off.cwiseAbs().maxCoeff() > tolerance) continue;
    out.angles += off;
    squares += off.cwiseProduct(off);
    out.zoom += zoom_[i];
    ++count;
  }
  if (2 * count < static_cast<double>(end - begin)) return std::nullopt;
  out.angles /= count;
  out.zoom /= count;
  out.scatter = (squares / count - out.angles.cwiseProduct(out.angles)).cwiseMax(0).cwiseSqrt();
  out.angles += middle;
  return out;
}

std::array<int, 2> Readings::sides(double time_s, double travel) const {
  std::array<int, 2> out{0, 0};
  const size_t last = std::min(after(time_s), times_.size() - 1);
  const double slack = std::max(2 * step_, 4 * noise_) + kNoise;
  for (int axis = 0; axis < 2; ++axis) {
    // Back to where it turned: the farthest it has been since, on either side.
    const double now = angles_[last][axis];
    double low = now, high = now;
    for (size_t i = last + 1; i-- > 0;) {
      const double value = angles_[i][axis];
      low = std::min(low, value);
      high = std::max(high, value);
      const bool below = now - low > travel, above = high - now > travel;
      if (!below && !above) continue;
      // It came from there, unless it went beyond where it is by more than noise.
      if (below && high - now <= slack) out[static_cast<size_t>(axis)] = 1;
      if (above && now - low <= slack) out[static_cast<size_t>(axis)] = -1;
      break;
    }
  }
  return out;
}

Eigen::Vector2d Readings::range() const {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const Eigen::Vector2d& a : angles_) {
    low = low.cwiseMin(a);
    high = high.cwiseMax(a);
  }
  return angles_.empty() ? Eigen::Vector2d(0, 0) : Eigen::Vector2d(high - low);
}

}  // namespace sightline::calibrate
