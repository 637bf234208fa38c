// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/point_cloud.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <iterator>

#include "record/out_file.hpp"

namespace sightline {

using namespace record;

namespace {

constexpr size_t kChunk = size_t{1} << 20;

double largest_sigma(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()(2)));
}

}  // namespace

Status write_point_cloud(const std::filesystem::path& path, std::span<const CloudPoint> points) {
  SL_ASSIGN(OutFile file, OutFile::create(path, OutFile::Existing::kReplace));
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\ncomment world frame, meters; kind 0 point, 1 edge, 2 corner; t in "
      "seconds of the recording's clock\nelement vertex {}\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property uchar kind\nproperty float sigma\nproperty double t\nend_header\n",
      points.size());
  for (const CloudPoint& each : points) {
    const Eigen::Vector3d& p = each.point.point_in_world;
    fmt::format_to(std::back_inserter(text), "{:.6f} {:.6f} {:.6f} {} {} {} {} {:.6f} {:.6f}\n",
                   p.x(), p.y(), p.z(), each.rgb[0], each.rgb[1], each.rgb[2],
                   static_cast<int>(each.point.kind), largest_sigma(each.point.covariance),
                   to_seconds(each.time.time_since_epoch()));
    if (text.size() < kChunk) continue;
    SL_RETURN_IF_ERROR(file.write(text));
    text.clear();
  }
  SL_RETURN_IF_ERROR(file.write(text));
  return file.close();
}

}  // namespace sightline
