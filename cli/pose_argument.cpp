// SPDX-License-Identifier: Apache-2.0
#include "pose_argument.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <charconv>
#include <cmath>

namespace sightline::cli {

std::optional<std::vector<double>> parse_numbers(std::string_view text) {
  std::vector<double> out;
  for (;;) {
    const size_t comma = text.find(',');
    const std::string_view part = text.substr(0, comma);
    double value = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    if (error != std::errc() || end != part.data() + part.size() || !std::isfinite(value)) {
      return std::nullopt;
    }
    out.push_back(value);
    if (comma == std::string_view::npos) return out;
    text.remove_prefix(comma + 1);
  }
}

Result<Rigid3> parse_pose(const std::vector<double>& n, const std::string& option) {
  const auto refuse = [&](std::string text) {
    return Error{ErrorCode::kInvalidInput, std::move(text), option};
  };
  if (n.size() == 6) {
    Vector6 tangent = Vector6::Zero();
    tangent.head<3>() = Eigen::Vector3d(n[0], n[1], n[2]);
    return Rigid3(Rigid3::exp(tangent).rotation, {n[3], n[4], n[5]});
  }
  if (n.size() != 7) {
    return refuse(fmt::format(
        "the pose has {} numbers; give 7 (tx ty tz qw qx qy qz) or 6 (rvec and tvec)", n.size()));
  }
  const Eigen::Quaterniond q(n[3], n[4], n[5], n[6]);
  if (!(std::abs(q.norm() - 1) < 1e-2)) {
    return refuse(fmt::format(
        "the quaternion qw qx qy qz has length {:.3f}, not 1: are the numbers in order?",
        q.norm()));
  }
  return Rigid3(q.normalized(), {n[0], n[1], n[2]});
}

}  // namespace sightline::cli
