// SPDX-License-Identifier: Apache-2.0
#include "publish/cell/cell_wire_parts.hpp"

#include <cmath>

namespace sightline::publish {
namespace {

constexpr double kFarthest = 1e6;                              // [m] from the world's origin
constexpr int64_t kFirst_ns = 0, kLast_ns = int64_t{1} << 62;  // UTC

}  // namespace

Error refuse(std::string_view what) {
  return make_error(ErrorCode::kInvalidInput, "message of the cell", "{}", what);
}

bool is_utc(int64_t ns) { return ns > kFirst_ns && ns < kLast_ns; }

void put(const Rigid3& pose, cell::v1::Pose& out) {
  const auto& q = pose.rotation;
  const auto& t = pose.translation;
  for (const double number : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) {
    out.add_numbers(number);
  }
}

Result<Rigid3> pose_of(const cell::v1::Pose& in) {
  if (in.numbers_size() != 7) return refuse("has a pose that is not seven numbers");
  const auto n = [&in](int i) { return in.numbers(i); };
  const Eigen::Quaterniond rotation(n(0), n(1), n(2), n(3));
  const Eigen::Vector3d translation(n(4), n(5), n(6));
  const bool placed = translation.allFinite() && translation.cwiseAbs().maxCoeff() < kFarthest;
  if (!placed || !(std::abs(rotation.norm() - 1) < 1e-9)) return refuse("has a pose that is none");
  Rigid3 pose;
  pose.rotation = rotation;  // bit by bit as it was sent
  pose.translation = translation;
  return pose;
}

}  // namespace sightline::publish
