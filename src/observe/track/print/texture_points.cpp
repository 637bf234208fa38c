// SPDX-License-Identifier: Apache-2.0
#include "observe/track/print/texture_points.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

namespace {

float gray_at(const PlaneView& gray, double x, double y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const auto fx = static_cast<float>(x - ix), fy = static_cast<float>(y - iy);
  const uint8_t* const top = gray.row(iy) + ix;
  const uint8_t* const low = top + gray.stride;
  const float above = static_cast<float>(top[0]) + fx * static_cast<float>(top[1] - top[0]);
  const float below = static_cast<float>(low[0]) + fx * static_cast<float>(low[1] - low[0]);
  return above + fy * (below - above);
}

// Least eigenvalue of the mean of the gradients' squares over a 7 x 7 window.
float corner_strength(const PlaneView& gray, int x, int y) {
  constexpr int kWindow = 3;
  float xx = 0, xy = 0, yy = 0;
  for (int v = -kWindow; v <= kWindow; ++v) {
    const uint8_t* const row = gray.row(y + v);
    const uint8_t* const above = gray.row(y + v - 1);
    const uint8_t* const below = gray.row(y + v + 1);
    for (int u = x - kWindow; u <= x + kWindow; ++u) {
      const auto gx = static_cast<float>(row[u + 1] - row[u - 1]);
      const auto gy = static_cast<float>(below[u] - above[u]);
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  constexpr float kCount = (2 * kWindow + 1) * (2 * kWindow + 1) * 4;
  const float half_trace = 0.5f * (xx + yy), half_difference = 0.5f * (xx - yy);
  return (half_trace - std::sqrt(half_difference * half_difference + xy * xy)) / kCount;
}

}  // namespace

TexturePoints::TexturePoints(const CameraModel& camera, const DepthRendererFactory& factory)
    : TexturePoints(camera, {kMinPatchCorrelation, kMinCornerStrength}) {
  if (factory) renderer_ = factory(camera);
}

TexturePoints::TexturePoints(const CameraModel& camera, const Limits& limits)
    : camera_(camera), limits_(limits) {
  points_.reserve(kMax);
  candidates_.reserve(kMaxCandidates);
  found_.reserve(kPerFrame);
}

// Where the image correlates best with the patch, warped as the pose says; `pixel` is the start.
// Brightness and contrast may differ.
bool TexturePoints::align(const PlaneView& gray, const Point& point, const Eigen::Matrix2d& warp,
                          Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d start = pixel;
  const Eigen::Matrix2d back = warp.inverse();
  // The image's gradient is that of the patch, warped.
  const Eigen::Matrix2d step_from_slope =
      (back.transpose() * point.gradient_squares * back).inverse();
  if (!step_from_slope.allFinite()) return false;
  const double reach = kRadius * (warp.cwiseAbs().rowwise().sum().maxCoeff()) + 1;
  Patch seen;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if ((pixel - start).squaredNorm() > kMaxShiftPx * kMaxShiftPx || pixel.x() < reach ||
        pixel.y() < reach || pixel.x() >= gray.width - 1 - reach ||
        pixel.y() >= gray.height - 1 - reach) {
      return false;
    }
    float mean = 0;
    size_t i = 0;
    for (int v = -kRadius; v <= kRadius; ++v) {
      for (int u = -kRadius; u <= kRadius; ++u, ++i) {
        seen[i] = gray_at(gray, pixel.x() + warp(0, 0) * u + warp(0, 1) * v,
                          pixel.y() + warp(1, 0) * u + warp(1, 1) * v);
        mean += seen[i];
      }
    }
    mean /= static_cast<float>(seen.size());
    float squares = 0, product = 0;
    for (i = 0; i < seen.size(); ++i) {
      seen[i] -= mean;
      squares += seen[i] * seen[i];
      product += seen[i] * point.patch[i];
    }
    if (!(squares > 1)) return false;
    const float gain = point.norm / std::sqrt(squares);
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    for (int v = -kRadius + 1; v < kRadius; ++v) {
      for (int u = -kRadius + 1; u < kRadius; ++u) {
        const auto at = static_cast<size_t>((v + kRadius) * kSide + u + kRadius);
        const auto error = static_cast<double>(gain * seen[at] - point.patch[at]);
        slope.x() += error * 0.5 * static_cast<double>(point.patch[at + 1] - point.patch[at - 1]);
        slope.y() +=
            error * 0.5 * static_cast<double>(point.patch[at + kSide] - point.patch[at - kSide]);
      }
    }
    const Eigen::Vector2d step = -step_from_slope * (back.transpose() * slope);
    pixel += step.norm() > 1.5 ? Eigen::Vector2d(1.5 * step.normalized()) : step;
    if (step.norm() < kConvergedPx)
      return product > limits_.correlation * point.norm * std::sqrt(squares);
  }
  return false;
}

void TexturePoints::find(const PlaneView& gray, const Rigid3& camera_from_object,
                         const Occluders& occluders, bool ambiguous) {
  found_.clear();
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  const Eigen::Vector3d eye = camera_from_object.inverse().translation;
  tried_ = 0;
  for (Point& point : points_) {
    if (tried_ == kPerFrame) break;
    const Eigen::Vector3d direction = (eye - point.in_object).normalized();
    const Eigen::Vector3d normal = point.tangent_u.cross(point.tangent_v).normalized();
    if (direction.dot(point.direction) < kMinSameAspect || normal.dot(direction) < kMinCosine)
      continue;
    const Eigen::Vector3d in_camera = rotation * point.in_object + camera_from_object.translation;
    Eigen::Matrix<double, 2, 3> by_point;
    const auto expected = camera_.project(in_camera, &by_point);
    if (!expected || occluders.hide(*expected, in_camera)) continue;
    ++tried_;
    Eigen::Matrix2d image_from_tangent;
    image_from_tangent << by_point * (rotation * point.tangent_u),
        by_point * (rotation * point.tangent_v);
    const Eigen::Matrix2d warp = image_from_tangent * point.image_from_tangent.inverse();
    Eigen::Vector2d pixel = *expected;
    if (align(gray, point, warp, pixel)) {
      found_.push_back({point.in_object, pixel});
      point.misses = 0;
    } else if (!ambiguous) {
      ++point.misses;
    }
  }
  std::erase_if(points_, [](const Point& point) { return point.misses > kMaxMisses; });
}

bool TexturePoints::crowded(const Eigen::Vector2d& pixel, double spacing) const {
  for (const Found& other : found_) {
    if ((other.pixel - pixel).squaredNorm() < spacing * spacing) return true;
  }
  for (const Candidate& other : candidates_) {
    if ((Eigen::Vector2d(other.x, other.y) - pixel).squaredNorm() < spacing * spacing) return true;
  }
  return false;
}

void TexturePoints::note_candidates(const PlaneView& gray, int left, int top, int right,
                                    int bottom) {
  candidates_.clear();
  if (!renderer_ || found_.size() >= kEnough || points_.size() >= kMax) return;
  if (rest_-- > 0) return;
  pause_ = found_.size() < kEnough / 4 ? std::min(2 * pause_, kLongestPause) : kShortestPause;
  rest_ = pause_;
  constexpr int kMargin = kRadius + 2;
  left = std::max(left, kMargin);
  top = std::max(top, kMargin);
  right = std::min(right, gray.width - 1 - kMargin);
  bottom = std::min(bottom, gray.height - 1 - kMargin);
  if (left >= right || top >= bottom) return;
  find_corners(gray, left, top, right, bottom, nullptr, kMaxCandidates);
}

namespace {

bool on_surface(const DepthTile& depth, int tile_x, int tile_y) {
  constexpr int kReach = TexturePoints::kRadius + 1;
  for (const int dy : {-kReach, 0, kReach}) {
    const float* const row = depth.row(tile_y + dy);
    for (const int dx : {-kReach, 0, kReach}) {
      if (!(row[tile_x + dx] > 0)) return false;
    }
  }
  return true;
}

}  // namespace

void TexturePoints::find_corners(const PlaneView& gray, int left, int top, int right, int bottom,
                                 const DepthTile* surface, size_t max) {
  const int origin_x = surface != nullptr ? surface->x : 0;
  const int origin_y = surface != nullptr ? surface->y : 0;
  const int columns = (right - left) / kCornerGrid + 1, rows = (bottom - top) / kCornerGrid + 1;
  strengths_.assign(static_cast<size_t>(columns * rows), 0.0f);
  const auto strength = [&](int i, int j) -> float& {
    return strengths_[static_cast<size_t>(j * columns + i)];
  };
  size_t places = 0;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const int x = left + i * kCornerGrid, y = top + j * kCornerGrid;
      if (surface != nullptr && !on_surface(*surface, x, y)) continue;
      ++places;
      strength(i, j) = corner_strength(gray, x, y);
    }
  }
  // The strongest of the grid first, as long as they keep their distance. Where a print is strong
  // on one side all of them would lie there, and that side alone says little of the tilt: so of a
  // whole surface first as far apart as covers it (in the manner of Brown, Szeliski and Winder,
  // Multi-image matching using multi-scale oriented patches, CVPR 2005).
  const double even =
      kCornerGrid * std::sqrt(static_cast<double>(places) / static_cast<double>(max));
  if (surface != nullptr && even > kPointSpacingPx)
    pick(gray, {left, top}, {origin_x, origin_y}, columns, max, even);
  pick(gray, {left, top}, {origin_x, origin_y}, columns, max, kPointSpacingPx);
}

void TexturePoints::pick(const PlaneView& gray, const Eigen::Vector2i& first,
                         const Eigen::Vector2i& origin, int columns, size_t max, double spacing) {
  crowded_.clear();
  while (candidates_.size() < max) {
    const auto best = std::max_element(strengths_.begin(), strengths_.end());
    if (*best < limits_.corner_strength) break;
    const int at = static_cast<int>(best - strengths_.begin());
    const int x = first.x() + at % columns * kCornerGrid,
              y = first.y() + at / columns * kCornerGrid;
    const float value = *best;
    *best = 0;
    if (crowded(Eigen::Vector2d(origin.x() + x, origin.y() + y), spacing)) {
      crowded_.emplace_back(at, value);
      continue;
    }
    Candidate& candidate = candidates_.emplace_back();
    candidate.x = origin.x() + x;
    candidate.y = origin.y() + y;
    candidate.strength = value;
    size_t i = 0;
    for (int v = -kRadius; v <= kRadius; ++v) {
      for (int u = -kRadius; u <= kRadius; ++u) {
        candidate.patch[i++] = static_cast<float>(gray.row(y + v)[x + u]);
      }
    }
  }
  for (const auto& [at, value] : crowded_) strengths_[static_cast<size_t>(at)] = value;
}

// The whole patch has to lie on one smooth piece of surface that is seen well enough.
bool TexturePoints::make_point(const Candidate& candidate, const DepthTile& depth,
                               const Rigid3& object_from_camera, Point& point) const {
  constexpr double kFlat = 0.01;  // share by which 1/z may bend over the patch
  const auto at = [&](int dx, int dy) {
    return static_cast<double>(depth.at(candidate.x + dx, candidate.y + dy));
  };
  const double middle = at(0, 0);
  if (!(middle > 0)) return false;
  constexpr int kReach = kRadius + 1;
  for (const auto& [dx, dy] :
       {std::pair{kReach, 0}, {0, kReach}, {kReach, kReach}, {kReach, -kReach}}) {
    const double one = at(dx, dy), other = at(-dx, -dy);
    if (!(one > 0 && other > 0)) return false;
    if (std::abs(one + other - 2 * middle) > kFlat * middle) return false;
  }
  const auto place = [&](int dx, int dy) -> std::optional<Eigen::Vector3d> {
    const auto ray = camera_.unproject(Eigen::Vector2d(candidate.x + dx, candidate.y + dy));
    if (!ray || !(ray->z() > 0)) return std::nullopt;
    return object_from_camera * Eigen::Vector3d(*ray / (ray->z() * at(dx, dy)));
  };
  const auto here = place(0, 0), right = place(kReach, 0), left = place(-kReach, 0);
  const auto below = place(0, kReach), above = place(0, -kReach);
  if (!here || !right || !left || !below || !above) return false;
  point.in_object = *here;
  // Seen from outside, right times down points away from the camera: order them so that the cross
  // product is the outward normal.
  point.tangent_u = (*below - *above).normalized();
  point.tangent_v = (*right - *left).normalized();
  point.direction = (object_from_camera.translation - *here).normalized();
  const Eigen::Vector3d normal = point.tangent_u.cross(point.tangent_v);
  if (!(normal.normalized().dot(point.direction) > kMinCosine)) return false;
  Eigen::Matrix<double, 2, 3> by_point;
  const Rigid3 camera_from_object = object_from_camera.inverse();
  if (!camera_.project(camera_from_object * *here, &by_point)) return false;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  point.image_from_tangent << by_point * (rotation * point.tangent_u),
      by_point * (rotation * point.tangent_v);

  point.patch = candidate.patch;
  float mean = 0;
  for (const float level : point.patch) mean += level;
  mean /= static_cast<float>(point.patch.size());
  float squares = 0;
  for (float& level : point.patch) {
    level -= mean;
    squares += level * level;
  }
  point.norm = std::sqrt(squares);
  point.gradient_squares.setZero();
  for (int v = -kRadius + 1; v < kRadius; ++v) {
    for (int u = -kRadius + 1; u < kRadius; ++u) {
      const auto i = static_cast<size_t>((v + kRadius) * kSide + u + kRadius);
      const Eigen::Vector2d gradient(
          0.5 * static_cast<double>(point.patch[i + 1] - point.patch[i - 1]),
          0.5 * static_cast<double>(point.patch[i + kSide] - point.patch[i - kSide]));
      point.gradient_squares += gradient * gradient.transpose();
    }
  }
  return true;
}

void TexturePoints::forget() {
  points_.clear();
  candidates_.clear();
  found_.clear();
  rest_ = 0;
  pause_ = kShortestPause;
}

void TexturePoints::drop_candidates() {
  if (candidates_.empty()) return;
  candidates_.clear();
  rest_ = pause_ = kRestAfterDrop;
}

void TexturePoints::keep_candidates(const Rigid3& camera_from_object) {
  if (candidates_.empty() || !renderer_) return;
  make_points(renderer_->render(camera_from_object), camera_from_object);
}

void TexturePoints::take(const PlaneView& rendered, const DepthTile& depth,
                         const Rigid3& camera_from_object) {
  constexpr int kMargin = kRadius + 2;
  candidates_.clear();
  found_.clear();
  const int right = depth.width - 1 - kMargin, bottom = depth.height - 1 - kMargin;
  if (right <= kMargin || bottom <= kMargin) return;
  find_corners(rendered, kMargin, kMargin, right, bottom, &depth, kPerFrame);
  make_points(depth, camera_from_object);
}

void TexturePoints::make_points(const DepthTile& depth, const Rigid3& camera_from_object) {
  const Rigid3 object_from_camera = camera_from_object.inverse();
  for (const Candidate& candidate : candidates_) {
    if (points_.size() >= kMax) break;
    Point point;
    if (make_point(candidate, depth, object_from_camera, point)) points_.push_back(point);
  }
  candidates_.clear();
}

}  // namespace sightline::observe
