// SPDX-License-Identifier: Apache-2.0
#include "observe/track/edge_lines.hpp"

#include <algorithm>
#include <cmath>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

namespace {

constexpr int kMaxReach = 16;  // [px]

// Bilinear; the caller keeps a pixel away from the border.
float light_at(const PlaneView& gray, const LightTable& light, double x, double y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const auto fx = static_cast<float>(x - ix), fy = static_cast<float>(y - iy);
  const uint8_t* const top = gray.row(iy) + ix;
  const uint8_t* const low = top + gray.stride;
  const float above = light[top[0]] + fx * (light[top[1]] - light[top[0]]);
  const float below = light[low[0]] + fx * (light[low[1]] - light[low[0]]);
  return above + fy * (below - above);
}

struct Step {
  float offset = 0;
  float strength = 0;
};

// Top of the parabola through three neighbors.
float vertex(float before, float here, float after) {
  const float bend = before - 2 * here + after;
  return bend < 0 ? 0.5f * (before - after) / bend : 0.0f;
}

void keep_strongest(const Step& found, std::array<Step, 3>& best, int& count) {
  int at = std::min(count, 2);
  if (count == 3 && found.strength <= best[2].strength) return;
  while (at > 0 && best[static_cast<size_t>(at - 1)].strength < found.strength) {
    best[static_cast<size_t>(at)] = best[static_cast<size_t>(at - 1)];
    --at;
  }
  best[static_cast<size_t>(at)] = found;
  count = std::min(3, count + 1);
}

bool room_for(const PlaneView& gray, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 1 && pixel.y() >= 1 && pixel.x() < gray.width - 2 &&
         pixel.y() < gray.height - 2;
}

void find_in_line(const PlaneView& gray, const LightTable& light, float threshold, EdgeLine& line) {
  constexpr size_t kSize = 2 * kMaxReach + 5;
  line.offsets = 0;
  line.strength = 0;
  line.searched = false;
  const int reach = std::min(kMaxReach, static_cast<int>(line.reach_px));
  const int half = reach + 2;
  if (!room_for(gray, line.center - half * line.normal) ||
      !room_for(gray, line.center + half * line.normal)) {
    return;
  }
  line.searched = true;
  std::array<float, kSize> level{};
  for (int k = -half; k <= half; ++k) {
    level[static_cast<size_t>(k + half)] = light_at(
        gray, light, line.center.x() + k * line.normal.x(), line.center.y() + k * line.normal.y());
  }
  // Entry k + reach + 1: slope at offset k, for k of -reach - 1 .. reach + 1.
  std::array<float, kSize> slope{};
  for (int k = -reach - 1; k <= reach + 1; ++k) {
    const auto at = static_cast<size_t>(k + half);
    slope[static_cast<size_t>(k + reach + 1)] = 0.5f * std::abs(level[at + 1] - level[at - 1]);
  }
  std::array<Step, 3> best;
  int count = 0;
  for (int k = -reach; k <= reach; ++k) {
    const auto at = static_cast<size_t>(k + reach + 1);
    const float here = slope[at];
    if (here < threshold || here < slope[at - 1] || here <= slope[at + 1]) continue;
    keep_strongest({static_cast<float>(k) + vertex(slope[at - 1], here, slope[at + 1]), here}, best,
                   count);
  }
  if (count == 0) return;
  line.strength = best[0].strength;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    if (best[i].strength < kRivalStepShare * line.strength) break;
    line.offset[i] = best[i].offset;
    ++line.offsets;
  }
}

}  // namespace

void edges_of_outline(std::span<const ContourLine> lines, bool at_creases, double reach_px,
                      std::vector<EdgeLine>& out) {
  for (size_t i = 0; i < lines.size(); ++i) {
    const ContourLine& line = lines[i];
    if (line.crease != at_creases) continue;
    EdgeLine& edge = out.emplace_back();
    edge.line = i;
    edge.point_in_object = line.point_in_object;
    edge.center = line.center;
    edge.normal = line.normal;
    edge.by_pose = line.by_pose;
    edge.reach_px = std::min(reach_px, 0.5 * std::min(line.inside_px, line.outside_px));
    if (edge.reach_px < kMinEdgeReachPx) out.pop_back();
  }
}

void place_inner_edges(const View& view, const CameraModel& camera,
                       const Rigid3& camera_from_object, const Occluders& occluders,
                       double reach_px, const RevolvedSurface* revolved,
                       std::vector<EdgeLine>& out) {
  const LineProjector projector(camera, camera_from_object);
  const Eigen::Vector3d camera_in_object = camera_from_object.inverse().translation;
  for (const InnerEdgeSample& sample : view.edges) {
    Eigen::Vector3d point = sample.point.cast<double>();
    if (revolved != nullptr && sample.crease == 0 && revolved->contains(point)) {
      const Eigen::Vector3d normal = revolved->tangent(point).cross(sample.tangent.cast<double>());
      if (const auto limb = revolved->limb(point, normal, camera_in_object)) point = limb->point;
    }
    const Eigen::Vector3d in_camera = projector.in_camera(point);
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    const auto pixel = camera.project(in_camera, &pixel_by_point);
    if (!pixel) continue;
    const Eigen::Vector2d along =
        pixel_by_point * (projector.rotation() * sample.tangent.cast<double>());
    const double px_per_meter = along.norm();
    // An edge seen end-on has no direction across it.
    const double focal = camera.parameters().fx / in_camera.z();
    if (!(px_per_meter > 0.1 * focal) || occluders.hide(*pixel, in_camera)) continue;
    const double reach = std::min(reach_px, 0.5 * static_cast<double>(sample.clearance) * focal);
    if (reach < kMinEdgeReachPx) continue;
    EdgeLine& edge = out.emplace_back();
    edge.point_in_object = point;
    edge.center = *pixel;
    edge.normal = Eigen::Vector2d(-along.y(), along.x()) / px_per_meter;
    edge.by_pose = projector.derivative(point, edge.normal, pixel_by_point);
    edge.reach_px = reach;
  }
}

void find_steps(const PlaneView& gray, const LightTable& light, double threshold,
                std::span<EdgeLine> lines) {
  for (EdgeLine& line : lines) find_in_line(gray, light, static_cast<float>(threshold), line);
}

}  // namespace sightline::observe
