// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/symmetry_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "observe/shape/side_view.hpp"
#include "observe/shape/view_sphere.hpp"

namespace sightline {
namespace {

constexpr int kSameColor = 30;  // of luma; chroma counts twice
using Pixel = SymmetryComparison::Pixel;

}  // namespace

SymmetryComparer::SymmetryComparer(const Eigen::Vector3d& center, double radius,
                                   const CameraModel& camera)
    : center_(center), radius_(radius), camera_(camera) {}

Result<SymmetryComparer> SymmetryComparer::create(const Eigen::Vector3d& center, double radius,
                                                  int side, const DepthRendererFactory& depth,
                                                  const ColorRendererFactory& colors) {
  if (!(radius > 0)) {
    return make_error(ErrorCode::kInvalidInput, "near symmetry", "the mesh has no surface");
  }
  SL_ASSIGN(const CameraModel camera, observe::side_camera(side));
  SymmetryComparer comparer(center, radius, camera);
  if (colors) {
    comparer.colors_ = colors(comparer.camera_);
  } else {
    comparer.depth_ = depth(comparer.camera_);
  }
  return comparer;
}

void SymmetryComparer::draw(const Rigid3& camera_from_object, Picture& picture) {
  const auto size = static_cast<size_t>(side()) * static_cast<size_t>(side());
  picture.depth.assign(size, 0);
  ColorTile tile;
  if (colors_) {
    tile = colors_->render(camera_from_object);
    for (auto& plane : picture.color) plane.assign(size, 128);
  } else {
    tile.depth = depth_->render(camera_from_object);
  }
  for (int y = 0; y < tile.depth.height; ++y) {
    for (int x = 0; x < tile.depth.width; ++x) {
      const float inverse = tile.depth.row(y)[x];
      if (!(inverse > 0)) continue;
      const auto at = static_cast<size_t>((tile.depth.y + y) * side() + tile.depth.x + x);
      picture.depth[at] = 1 / inverse;
      if (!colors_) continue;
      for (size_t c = 0; c < 3; ++c) picture.color[c][at] = tile.color[c][y * tile.stride + x];
    }
  }
}

SymmetryComparison::Pixel SymmetryComparer::pixel(size_t at) const {
  const bool here = as_is_.depth[at] > 0, there = turned_.depth[at] > 0;
  if (!here && !there) return Pixel::kNothing;
  if (here != there) return here ? Pixel::kOnlyAsIs : Pixel::kOnlyTurned;
  if (std::abs(as_is_.depth[at] - turned_.depth[at]) > observe::kSameSurface * radius_) {
    return Pixel::kSurface;
  }
  for (size_t c = 0; colors_ && c < 3; ++c) {
    const int apart = std::abs(as_is_.color[c][at] - turned_.color[c][at]);
    if ((c == 0 ? 1 : 2) * apart > kSameColor) return Pixel::kColor;
  }
  return Pixel::kSame;
}

SymmetryComparison SymmetryComparer::compare(const Eigen::Vector3d& direction, const Rigid3& turn) {
  const Rigid3 camera_from_object = observe::side_pose(direction, center_, radius_);
  if (direction != direction_) draw(camera_from_object, as_is_);
  direction_ = direction;
  draw(camera_from_object * turn, turned_);
  SymmetryComparison out;
  out.pixels.reserve(as_is_.depth.size());
  std::array<double, 6> count{};
  Eigen::Vector3d differs = Eigen::Vector3d::Zero();
  double differing = 0;
  for (size_t at = 0; at < as_is_.depth.size(); ++at) {
    out.pixels.push_back(pixel(at));
    ++count[static_cast<size_t>(out.pixels.back())];
    if (out.pixels.back() == Pixel::kSame || !(as_is_.depth[at] > 0)) continue;
    const auto row = static_cast<int>(at) / side();
    const double x = static_cast<int>(at) - row * side(), y = row;
    const CameraModel::Parameters& lens = camera_.parameters();
    differs += double{as_is_.depth[at]} *
               Eigen::Vector3d((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1);
    ++differing;
  }
  const auto of = [&](Pixel kind) { return count[static_cast<size_t>(kind)]; };
  const double all = std::max(1.0, static_cast<double>(out.pixels.size()) - of(Pixel::kNothing));
  out.silhouette = (of(Pixel::kOnlyAsIs) + of(Pixel::kOnlyTurned)) / all;
  out.surface = out.silhouette + of(Pixel::kSurface) / all;
  out.color = of(Pixel::kColor) / all;
  if (differing > 0) out.centroid = camera_from_object.inverse() * (differs / differing);
  return out;
}

SymmetryComparison SymmetryComparer::hardest(const Eigen::Vector3d& direction,
                                             std::span<const Rigid3> turns) {
  if (turns.size() == 1) return compare(direction, turns.front());
  const Rigid3* hardest = &turns.front();
  double least = 2;
  for (const Rigid3& turn : turns) {
    const SymmetryComparison there = compare(direction, turn);
    if (there.surface + there.color >= least) continue;
    least = there.surface + there.color;
    hardest = &turn;
  }
  return compare(direction, *hardest);
}

SymmetryBreaking SymmetryComparer::from_all_sides(std::span<const Rigid3> turns) {
  SymmetryBreaking out;
  const auto sides = observe::make_view_sphere(1).directions;
  for (const Eigen::Vector3d& direction : sides) {
    const SymmetryComparison there = hardest(direction, turns);
    const double told = there.surface + there.color;
    out.mean += told / static_cast<double>(sides.size());
    if (told < out.least) {
      out.least = told;
      out.hidden_from = direction;
    }
    if (told > out.most) {
      out.most = told;
      out.color = there.color;
      out.shown_from = direction;
      out.centroid = there.centroid;
    }
  }
  return out;
}

}  // namespace sightline
