// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/view_sampler.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace sightline::observe {
namespace {

constexpr uint8_t kOutline = 1, kCrease = 2, kJump = 4, kSharp = 8;
constexpr int kShortestOutline = 12;  // sides of pixels; shorter ones are specks
constexpr float kNearOutline = 2.5f;  // [px] an edge closer to the outline is the outline
constexpr float kOnOutline = 1.5f;    // [px] a crease closer to the outline makes it
constexpr float kFirstStep = 3.0f;    // [px] where the search for the next edge starts

// Sides of a pixel clockwise from the top: outward direction, and the way along it with the inside
// on the right hand (y points down).
constexpr std::array<std::array<int, 2>, 4> kOut = {{{0, -1}, {1, 0}, {0, 1}, {-1, 0}}};
constexpr std::array<std::array<int, 2>, 4> kAlong = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

// Smoothing that keeps parabolas as they are, and the slope of the straight line through the same
// points (Savitzky and Golay, 1964), over nine points.
constexpr std::array<float, 9> kSmooth = {-21, 14, 39, 54, 59, 54, 39, 14, -21};
constexpr float kSmoothSum = 231;

// Of pixels that lie in or near an image of a few thousand.
int rounded(float value) { return static_cast<int>(value + 65536.5f) - 65536; }

}  // namespace

ViewSampler::ViewSampler(const CameraModel& camera, const ViewpointModelOptions& options,
                         const Eigen::Vector3d& center, double radius,
                         std::vector<CreasePoint> creases)
    : options_(options),
      side_(camera.width()),
      focal_(static_cast<float>(camera.parameters().fx)),
      middle_(static_cast<float>(camera.parameters().cx)),
      radius_(static_cast<float>(radius)),
      center_(center),
      creases_(std::move(creases)),
      visited_(static_cast<size_t>(side_) * static_cast<size_t>(side_)),
      marks_(visited_.size()) {}

void ViewSampler::sample(const DepthTile& tile, const Rigid3& camera_from_object, Sampled& out) {
  depth_ = tile;
  camera_from_object_ = camera_from_object.rotation_matrix().cast<float>();
  object_in_camera_ = camera_from_object.translation.cast<float>();
  object_from_camera_ = camera_from_object_.transpose();
  camera_in_object_ = -(object_from_camera_ * object_in_camera_);
  std::fill(marks_.begin(), marks_.end(), uint8_t{0});
  candidates_.clear();
  trace_outlines();
  mark_outline();
  mark_sharp_outline();
  take_contour(out);
  find_creases();
  find_depth_jumps();
  take_edges(out);
  take_shape(out);
}

Eigen::Vector3f ViewSampler::object_point(const Eigen::Vector2f& pixel, float inverse_depth) const {
  const float z = 1 / inverse_depth;
  const Eigen::Vector3f in_camera((pixel.x() - middle_) / focal_ * z,
                                  (pixel.y() - middle_) / focal_ * z, z);
  return object_from_camera_ * in_camera + camera_in_object_;
}

void ViewSampler::trace_outlines() {
  outline_.clear();
  std::fill(visited_.begin(), visited_.end(), uint8_t{0});
  for (int y = depth_.y; y < depth_.y + depth_.height; ++y) {
    for (int x = depth_.x; x < depth_.x + depth_.width; ++x) {
      if (!inside(x, y)) continue;
      // Every outline has a top side.
      if (!inside(x, y - 1) && (visited_[index(x, y)] & 1) == 0) trace_from(x, y, 0);
    }
  }
}

void ViewSampler::trace_from(int x, int y, int side) {
  std::vector<Eigen::Vector2i> pixels;
  std::vector<int> sides;
  while ((visited_[index(x, y)] & (1 << side)) == 0) {
    visited_[index(x, y)] = static_cast<uint8_t>(visited_[index(x, y)] | (1 << side));
    pixels.emplace_back(x, y);
    sides.push_back(side);
    const auto& along = kAlong[static_cast<size_t>(side)];
    const auto& out = kOut[static_cast<size_t>(side)];
    if (inside(x + along[0] + out[0], y + along[1] + out[1])) {
      x += along[0] + out[0];
      y += along[1] + out[1];
      side = (side + 3) % 4;
    } else if (inside(x + along[0], y + along[1])) {
      x += along[0];
      y += along[1];
    } else {
      side = (side + 1) % 4;
    }
  }
  if (static_cast<int>(pixels.size()) >= kShortestOutline) smooth_outline(pixels, sides);
}

void ViewSampler::smooth_outline(const std::vector<Eigen::Vector2i>& pixels,
                                 const std::vector<int>& sides) {
  const size_t n = pixels.size();
  std::vector<Eigen::Vector2f> raw(n);
  for (size_t i = 0; i < n; ++i) {
    const auto& out = kOut[static_cast<size_t>(sides[i])];
    raw[i] = pixels[i].cast<float>() +
             0.5f * Eigen::Vector2f(static_cast<float>(out[0]), static_cast<float>(out[1]));
  }
  std::optional<Eigen::Vector2f> before;
  float length = outline_.empty() ? 0 : outline_.back().from_start;
  for (size_t i = 0; i < n; ++i) {
    Eigen::Vector2f place = Eigen::Vector2f::Zero(), slope = Eigen::Vector2f::Zero();
    for (size_t k = 0; k < kSmooth.size(); ++k) {
      const Eigen::Vector2f& p = raw[(i + n + k - 4) % n];
      place += kSmooth[k] / kSmoothSum * p;
      slope += (static_cast<float>(k) - 4) * p;
    }
    if (slope.norm() < 1e-3f) continue;  // the tip of a line one pixel wide
    if (before) length += (place - *before).norm();
    before = place;
    // The inside is on the right hand of the way; y points down.
    const Eigen::Vector2f normal = Eigen::Vector2f(slope.y(), -slope.x()).normalized();
    // One pixel further in, the surface is less steep.
    const Eigen::Vector2f deeper = place - 1.0f * normal;
    float inverse = depth_.at(rounded(deeper.x()), rounded(deeper.y()));
    if (!(inverse > 0)) inverse = depth_.at(pixels[i].x(), pixels[i].y());
    outline_.push_back({place, normal, length, inverse});
  }
}

void ViewSampler::mark_outline() {
  const int reach = static_cast<int>(kNearOutline);
  for (const OutlinePoint& point : outline_) {
    const int x = rounded(point.pixel.x()), y = rounded(point.pixel.y());
    for (int v = std::max(0, y - reach); v <= std::min(side_ - 1, y + reach); ++v) {
      for (int u = std::max(0, x - reach); u <= std::min(side_ - 1, x + reach); ++u) {
        marks_[index(u, v)] |= kOutline;
      }
    }
  }
}

// Where a crease that can be seen runs along the outline.
void ViewSampler::mark_sharp_outline() {
  const int reach = static_cast<int>(kOnOutline);
  for (const CreasePoint& crease : creases_) {
    const Eigen::Vector3f p = camera_from_object_ * crease.point + object_in_camera_;
    const Eigen::Vector2f pixel(focal_ * p.x() / p.z() + middle_, focal_ * p.y() / p.z() + middle_);
    const int x = rounded(pixel.x()), y = rounded(pixel.y());
    if (x < 2 || y < 2 || x >= side_ - 2 || y >= side_ - 2) continue;
    if ((marks_[index(x, y)] & kOutline) == 0 || !visible(pixel, 1 / p.z())) continue;
    for (int v = y - reach; v <= y + reach; ++v) {
      for (int u = x - reach; u <= x + reach; ++u) marks_[index(u, v)] |= kSharp;
    }
  }
}

float ViewSampler::walk_inside(const Eigen::Vector2f& from, const Eigen::Vector2f& step) const {
  float distance = 1;
  const auto longest = static_cast<float>(2 * side_);
  while (distance < longest) {
    const Eigen::Vector2f p = from + distance * step;
    if (!inside(rounded(p.x()), rounded(p.y()))) break;
    distance += 1;
  }
  return distance;
}

float ViewSampler::walk_outside(const Eigen::Vector2f& from, const Eigen::Vector2f& step) const {
  float distance = 1;
  const auto longest = static_cast<float>(2 * side_);
  while (distance < longest) {
    const Eigen::Vector2f p = from + distance * step;
    const int x = rounded(p.x()), y = rounded(p.y());
    if (x < 0 || y < 0 || x >= side_ || y >= side_) return longest;
    if (inside(x, y)) break;
    distance += 1;
  }
  return distance;
}

void ViewSampler::take_contour(Sampled& out) const {
  out.contour.clear();
  out.contour_length = 0;
  if (outline_.empty()) return;
  const float length = std::max(1.0f, outline_.back().from_start);
  const float limit = ViewpointModel::kFreeLimit * radius_;
  const int wanted = std::clamp(static_cast<int>(length), 1, options_.contour_samples);
  const float center_depth = (camera_from_object_ * center_.cast<float>() + object_in_camera_).z();
  out.contour_length = length * center_depth / focal_;
  size_t at = 0;
  for (int i = 0; i < wanted; ++i) {
    const float place = length * (static_cast<float>(i) + 0.5f) / static_cast<float>(wanted);
    while (at + 1 < outline_.size() && outline_[at].from_start < place) ++at;
    const OutlinePoint& point = outline_[at];
    if (!(point.inverse_depth > 0)) continue;
    const float meters = 1 / (point.inverse_depth * focal_);
    ContourSample sample;
    sample.point = object_point(point.pixel, point.inverse_depth);
    sample.normal = object_from_camera_ * Eigen::Vector3f(point.normal.x(), point.normal.y(), 0.0f);
    sample.foreground = std::min(limit, meters * walk_inside(point.pixel, -point.normal));
    sample.background = std::min(limit, meters * walk_outside(point.pixel, point.normal));
    const int x = rounded(point.pixel.x()), y = rounded(point.pixel.y());
    if (x >= 0 && y >= 0 && x < side_ && y < side_) {
      sample.crease = (marks_[index(x, y)] & kSharp) != 0 ? 1 : 0;
    }
    out.contour.push_back(sample);
  }
}

bool ViewSampler::visible(const Eigen::Vector2f& pixel, float inverse_depth) const {
  const int x = rounded(pixel.x()), y = rounded(pixel.y());
  // Relative to the depth: a fiftieth of the radius.
  const float tolerance = 0.02f * radius_ * inverse_depth;
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      const float there = depth_.at(u, v);
      if (there > 0 && there <= inverse_depth * (1 + tolerance)) return true;
    }
  }
  return false;
}

void ViewSampler::find_creases() {
  for (const CreasePoint& crease : creases_) {
    const Eigen::Vector3f p = camera_from_object_ * crease.point + object_in_camera_;
    const Eigen::Vector2f pixel(focal_ * p.x() / p.z() + middle_, focal_ * p.y() / p.z() + middle_);
    const int x = rounded(pixel.x()), y = rounded(pixel.y());
    if (x < 1 || y < 1 || x >= side_ - 1 || y >= side_ - 1) continue;
    if ((marks_[index(x, y)] & kOutline) != 0 || !visible(pixel, 1 / p.z())) continue;
    const Eigen::Vector3f along = camera_from_object_ * crease.tangent;
    Eigen::Vector2f way(along.x() * p.z() - p.x() * along.z(),
                        along.y() * p.z() - p.y() * along.z());
    way /= p.z();
    if (way.norm() < 0.2f) continue;  // seen along itself
    way.normalize();
    marks_[index(x, y)] |= kCrease;
    candidates_.push_back(
        {pixel, {-way.y(), way.x()}, {crease.point, crease.tangent, 0.0f, uint8_t{1}}});
  }
}

void ViewSampler::find_depth_jumps() {
  for (int y = depth_.y + 1; y < depth_.y + depth_.height - 1; ++y) {
    for (int x = depth_.x + 1; x < depth_.x + depth_.width - 1; ++x) {
      if (inside(x, y) && (marks_[index(x, y)] & kOutline) == 0) add_jump(x, y);
    }
  }
}

// An edge candidate where the surface of this pixel ends in front of something else of the object.
void ViewSampler::add_jump(int x, int y) {
  const float here = depth_.at(x, y);
  const float jump = static_cast<float>(options_.depth_jump) * radius_ * here * here;
  Eigen::Vector2f away = Eigen::Vector2f::Zero();
  int steps = 0;
  for (size_t k = 0; k < 4; ++k) {
    const int ox = kOut[k][0], oy = kOut[k][1];
    const float there = depth_.at(x + ox, y + oy), behind = depth_.at(x - ox, y - oy);
    if (!(there > 0) || here - there < jump) continue;
    // On a steep smooth surface the step on the other side is as large.
    if (behind - here > 0.5f * (here - there)) continue;
    away += Eigen::Vector2f(static_cast<float>(ox), static_cast<float>(oy));
    ++steps;
  }
  if (steps == 0 || away.norm() < 0.5f) return;
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      if ((marks_[index(u, v)] & kCrease) != 0) return;  // a crease runs here and is exact
    }
  }
  // Which of the pixels around lie behind says more precisely where the edge runs.
  Eigen::Vector2f across = Eigen::Vector2f::Zero();
  for (int v = -2; v <= 2; ++v) {
    for (int u = -2; u <= 2; ++u) {
      if (here - depth_.at(x + u, y + v) >= jump) {
        across += Eigen::Vector2f(static_cast<float>(u), static_cast<float>(v));
      }
    }
  }
  if (across.norm() < 1) return;
  across.normalize();
  const Eigen::Vector2f pixel =
      Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) + 0.5f * away.normalized();
  marks_[index(x, y)] |= kJump;
  const Eigen::Vector3f tangent =
      object_from_camera_ * Eigen::Vector3f(-across.y(), across.x(), 0.0f);
  candidates_.push_back({pixel, across, {object_point(pixel, here), tangent, 0.0f, uint8_t{0}}});
}

float ViewSampler::clearance(const EdgeCandidate& edge) const {
  const auto longest = static_cast<float>(side_);
  const auto free = [&](float sign) {
    for (float distance = kFirstStep; distance < longest; distance += 1) {
      const Eigen::Vector2f p = edge.pixel + sign * distance * edge.across;
      const int x = rounded(p.x()), y = rounded(p.y());
      if (x < 1 || y < 1 || x >= side_ - 1 || y >= side_ - 1) return distance;
      const uint8_t around = marks_[index(x, y)] | marks_[index(x + 1, y)] |
                             marks_[index(x - 1, y)] | marks_[index(x, y + 1)] |
                             marks_[index(x, y - 1)];
      if (around != 0) return distance;
    }
    return longest;
  };
  return std::min(free(1), free(-1));
}

// One candidate per cell of a grid that is just coarse enough.
void ViewSampler::take_edges(Sampled& out) {
  out.edges.clear();
  if (options_.edge_samples == 0) return;
  const auto limit = static_cast<size_t>(options_.edge_samples);
  std::vector<size_t> kept;
  for (int cell = 3;; ++cell) {
    const size_t columns = static_cast<size_t>(side_ / cell + 1);
    std::vector<uint8_t> taken(columns * columns);
    kept.clear();
    for (size_t i = 0; i < candidates_.size(); ++i) {
      const Eigen::Vector2f& p = candidates_[i].pixel;
      const auto column = static_cast<size_t>(std::clamp(rounded(p.x()), 0, side_ - 1) / cell);
      const auto row = static_cast<size_t>(std::clamp(rounded(p.y()), 0, side_ - 1) / cell);
      if (std::exchange(taken[row * columns + column], uint8_t{1}) == 0) kept.push_back(i);
    }
    if (kept.size() <= limit) break;
  }
  const float longest = ViewpointModel::kFreeLimit * radius_;
  for (const size_t i : kept) {
    InnerEdgeSample sample = candidates_[i].sample;
    const float z = (camera_from_object_ * sample.point + object_in_camera_).z();
    sample.clearance = std::min(longest, clearance(candidates_[i]) * z / focal_);
    out.edges.push_back(sample);
  }
}

void ViewSampler::take_shape(Sampled& out) const {
  const float center_depth = (camera_from_object_ * center_.cast<float>() + object_in_camera_).z();
  const float meters = center_depth / focal_;
  size_t count = 0;
  for (int y = 0; y < depth_.height; ++y) {
    const float* row = depth_.row(y);
    count +=
        static_cast<size_t>(std::count_if(row, row + depth_.width, [](float d) { return d > 0; }));
  }
  out.area = static_cast<float>(count) * meters * meters;
  constexpr int kSide = ViewpointModel::kMaskSize;
  const float cell = 2 * radius_ / static_cast<float>(kSide) / meters;
  for (int y = 0; y < kSide; ++y) {
    uint32_t bits = 0;
    for (int x = 0; x < kSide; ++x) {
      const float half = 0.5f * static_cast<float>(kSide - 1);
      const int px = rounded(middle_ + (static_cast<float>(x) - half) * cell);
      const int py = rounded(middle_ + (static_cast<float>(y) - half) * cell);
      if (inside(px, py)) bits |= 1u << x;
    }
    out.mask[static_cast<size_t>(y)] = bits;
  }
}

}  // namespace sightline::observe
