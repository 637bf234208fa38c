// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/silhouette_search.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

#include "observe/detect/detect_constants.hpp"
#include "sightline/geometry/rotation_between.hpp"

namespace sightline::observe {
namespace {

constexpr size_t kViews = 162, kFewViews = 42;
constexpr int kTurns = 24;
constexpr int kSide = ViewpointModel::kMaskSize;

// Foreground in a square about a place.
struct Square {
  double weight = 0;  ///< pixels; shadow counts half
  double lost = 0;    ///< unknown or out of the image
  double area = 0;
};

Square square(const SilhouetteCamera& camera, double x, double y, double half) {
  const int width = camera.map->width, height = camera.map->height;
  const int left = static_cast<int>(std::lround(x - half)),
            right = static_cast<int>(std::lround(x + half)) + 1,
            top = static_cast<int>(std::lround(y - half)),
            bottom = static_cast<int>(std::lround(y + half)) + 1;
  Square out;
  out.area = static_cast<double>(right - left) * (bottom - top);
  const int l = std::clamp(left, 0, width), r = std::clamp(right, 0, width),
            t = std::clamp(top, 0, height), b = std::clamp(bottom, 0, height);
  const auto sum = [&](const std::vector<uint32_t>& sums) {
    const auto at = [&](int u, int v) {
      return sums[static_cast<size_t>(v) * static_cast<size_t>(width + 1) + static_cast<size_t>(u)];
    };
    return static_cast<double>(at(r, b) - at(l, b) - at(r, t) + at(l, t));
  };
  out.weight = sum(camera.weight) / 2;
  out.lost = sum(camera.unknown) + out.area - static_cast<double>(r - l) * (b - t);
  return out;
}

Eigen::Quaterniond ray_turn(const Eigen::Vector3d& ray) {
  return rotation_between(Eigen::Vector3d::UnitZ(), ray);
}

double turn_angle(int turn) { return 2 * std::numbers::pi * turn / kTurns; }

uint8_t class_at(const ForegroundMap& map, double x, double y) {
  const int u = static_cast<int>(std::floor(x + 0.5)), v = static_cast<int>(std::floor(y + 0.5));
  if (u < 0 || v < 0 || u >= map.width || v >= map.height) return ForegroundMap::kUnknown;
  return map.row(v)[u];
}

// The ball's square, turned back by `angle`, in the cells of the masks.
MaskPatch cut_patch(const ForegroundMap& map, double x, double y, double radius, double angle) {
  MaskPatch out;
  const double cell = 2 * radius / kSide;
  const double c = std::cos(angle) * cell, s = std::sin(angle) * cell;
  for (int j = 0; j < kSide; ++j) {
    for (int i = 0; i < kSide; ++i) {
      const double u = i - 0.5 * (kSide - 1), v = j - 0.5 * (kSide - 1);
      const uint8_t what = class_at(map, x + c * u - s * v, y + s * u + c * v);
      const uint64_t bit = uint64_t{1} << (i + (j % 2) * kSide);
      const auto word = static_cast<size_t>(j / 2);
      if (what == ForegroundMap::kForeground) out.front[word] |= bit;
      if (what == ForegroundMap::kShadow) out.shadow[word] |= bit;
      if (what == ForegroundMap::kUnknown) out.unknown[word] |= bit;
    }
  }
  return out;
}

int count(const MaskPatch::Bits& bits) {
  int sum = 0;
  for (const uint64_t word : bits) sum += std::popcount(word);
  return sum;
}

// Counts in half pixels: foreground is worth two, shadow one.
double overlap_over_union(int mask, int front, int shadow, int unknown, int all_front,
                          int all_shadow) {
  if (mask == 0 || unknown > kMaxUnknown * mask) return -1;
  const int common = 2 * front + shadow;
  const int beside = 2 * (all_front - front) + all_shadow - shadow;
  return static_cast<double>(common) / (2 * (mask - unknown) + beside);
}

}  // namespace

void SilhouetteCamera::sum_up() {
  const auto width = static_cast<size_t>(map->width), height = static_cast<size_t>(map->height);
  const size_t stride = width + 1;
  weight.assign(stride * (height + 1), 0);
  unknown.assign(stride * (height + 1), 0);
  for (size_t y = 0; y < height; ++y) {
    const uint8_t* row = map->row(static_cast<int>(y));
    uint32_t front = 0, lost = 0;
    for (size_t x = 0; x < width; ++x) {
      lost += row[x] == ForegroundMap::kUnknown;
      front += row[x] == ForegroundMap::kUnknown ? 0u : row[x];
      const size_t i = (y + 1) * stride + x + 1;
      weight[i] = weight[i - stride] + front;
      unknown[i] = unknown[i - stride] + lost;
    }
  }
}

SilhouetteSearch::SilhouetteSearch(const TemplateBank& bank) : bank_(bank) {
  const ViewpointModel& model = bank.model();
  const double radius = model.radius();
  for (size_t i = 0; i < model.size(); ++i) {
    MaskPatch::Bits bits{};
    const ViewpointModel::Mask& mask = model.mask(i);
    for (size_t y = 0; y < mask.size(); ++y) {
      bits[y / 2] |= static_cast<uint64_t>(mask[y]) << (y % 2 == 0 ? 0 : kSide);
    }
    masks_.push_back(bits);
    cells_.push_back(static_cast<uint16_t>(count(bits)));
    const double area = static_cast<double>(model.view(i).area) / (radius * radius);
    min_area_ = i == 0 ? area : std::min(min_area_, area);
    max_area_ = std::max(max_area_, area);
  }
  const size_t views = std::min(kViews, model.size());
  for (size_t i = 0; i < model.size(); ++i) {
    size_t best = 0;
    for (size_t k = 1; k < views; ++k) {
      if (model.view(k).direction.dot(model.view(i).direction) >
          model.view(best).direction.dot(model.view(i).direction)) {
        best = k;
      }
    }
    coarse_view_.push_back(static_cast<uint16_t>(best));
  }
}

std::optional<SilhouetteSearch::Ball> SilhouetteSearch::ball(const SilhouetteCamera& camera,
                                                             const Eigen::Vector3d& center) const {
  const Eigen::Vector3d in_camera = camera.camera_from_world * center;
  const double distance = in_camera.norm();
  if (in_camera.z() < 0.01 * distance || distance < 1.01 * bank_.model().radius())
    return std::nullopt;
  const auto pixel = camera.camera->model.project(in_camera);
  if (!pixel) return std::nullopt;
  Ball out;
  out.x = (pixel->x() + 0.5) / 2 - 0.5;
  out.y = (pixel->y() + 0.5) / 2 - 0.5;
  out.radius = camera.camera->model.parameters().fx / 2 * bank_.model().radius() / distance;
  if (out.x < 0 || out.y < 0 || out.x > camera.map->width - 1 || out.y > camera.map->height - 1)
    return std::nullopt;
  return out;
}

// 1: as much foreground as some view has, and nothing around. Negative: nothing is known there.
double SilhouetteSearch::place_score(const SilhouetteCamera& camera, const Ball& ball) const {
  const Square in = square(camera, ball.x, ball.y, ball.radius);
  const double known = 1 - in.lost / in.area;
  if (known < 1 - kMaxUnknown) return -1;
  const Square out = square(camera, ball.x, ball.y, 1.5 * ball.radius + 1);
  const double squared = ball.radius * ball.radius * known;
  const double min = 0.8 * min_area_ * squared, max = 1.1 * max_area_ * squared;
  const double beside = (out.weight - in.weight) / std::max(1.0, out.area - in.area);
  return std::min(1.0, in.weight / min) - 0.5 * std::max(0.0, in.weight / max - 1) - 0.7 * beside;
}

void SilhouetteSearch::add_places(std::span<const SilhouetteCamera> cameras, size_t from,
                                  std::vector<Place>& out) const {
  const SilhouetteCamera& camera = cameras[from];
  const double focal = camera.camera->model.parameters().fx / 2;
  const double radius = bank_.model().radius();
  const Rigid3 world_from_camera = camera.camera_from_world.inverse();
  const size_t needed = std::min<size_t>(2, cameras.size());
  for (double distance = camera.nearest; distance <= camera.farthest;
       distance = cameras.size() == 1 ? kOneCameraStep * distance
                                      : distance + kDepthStep * radius) {
    const double r = focal * radius / distance;
    if (r < kMinRadiusPx) break;
    const double step = std::max(1.0, kPlaceStep * r);
    for (double y = 0; y < camera.map->height; y += step) {
      for (double x = 0; x < camera.map->width; x += step) {
        const double own = place_score(camera, {x, y, r});
        if (own < kMinPlaceScore) continue;
        const auto ray = camera.camera->model.unproject({2 * x + 0.5, 2 * y + 0.5});
        if (!ray) continue;
        Place place{world_from_camera * (distance * *ray), own, from, {}};
        size_t seen = 1;
        for (size_t i = 0; i < cameras.size(); ++i) {
          if (i == from) continue;
          const auto other = ball(cameras[i], place.center);
          const double score = other ? place_score(cameras[i], *other) : -1;
          if (score < kMinPlaceScore) continue;
          place.score += score;
          ++seen;
        }
        if (seen >= needed) out.push_back(place);
      }
    }
  }
}

std::vector<SilhouetteSearch::Place> SilhouetteSearch::find_places(
    std::span<const SilhouetteCamera> cameras) const {
  std::vector<Place> all, out;
  for (size_t i = 0; i < cameras.size(); ++i) add_places(cameras, i, all);
  std::stable_sort(all.begin(), all.end(),
                   [](const Place& a, const Place& b) { return a.score > b.score; });
  for (const Place& place : all) {
    const bool known = std::any_of(out.begin(), out.end(), [&](const Place& other) {
      return (other.center - place.center).norm() < 0.6 * bank_.model().radius();
    });
    if (!known) out.push_back(place);
    if (out.size() == kMaxPlaces) break;
  }
  return out;
}

std::vector<float> SilhouetteSearch::overlaps(const SilhouetteCamera& camera, const Ball& ball,
                                              size_t views) const {
  std::vector<float> out(views * kTurns);
  std::vector<MaskOverlap> found(views);
  bank_.work().masks += out.size();
  for (int turn = 0; turn < kTurns; ++turn) {
    const MaskPatch patch = cut_patch(*camera.map, ball.x, ball.y, ball.radius, turn_angle(turn));
    const int front = count(patch.front), shadow = count(patch.shadow);
    overlap_masks({masks_.data(), views}, patch, found.data());
    for (size_t view = 0; view < views; ++view) {
      const MaskOverlap& o = found[view];
      out[view * kTurns + static_cast<size_t>(turn)] = static_cast<float>(
          overlap_over_union(cells_[view], o.front, o.shadow, o.unknown, front, shadow));
    }
  }
  return out;
}

// How one camera sees what the first one sees under a view and a turn.
struct SilhouetteSearch::RotatedView {
  Eigen::Matrix3d from_first;  ///< axes along its ray, from those along the first one's
  std::vector<float> overlaps;
};

std::vector<JointPose> SilhouetteSearch::orient(std::span<const SilhouetteCamera> cameras,
                                                const Place& place, size_t views,
                                                size_t max) const {
  const ViewpointModel& model = bank_.model();
  views = std::min(views, model.size());
  const SilhouetteCamera& first = cameras[place.camera];
  const Eigen::Matrix3d world_from_ray = (first.camera_from_world.rotation.conjugate() *
                                          ray_turn(first.camera_from_world * place.center))
                                             .toRotationMatrix();
  const auto own = ball(first, place.center);
  if (!own) return {};
  const std::vector<float> own_overlaps = overlaps(first, *own, views);
  std::vector<RotatedView> others;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const auto other = i == place.camera ? std::nullopt : ball(cameras[i], place.center);
    if (!other) continue;
    const Eigen::Quaterniond along = ray_turn(cameras[i].camera_from_world * place.center);
    others.push_back({(along.conjugate() * cameras[i].camera_from_world.rotation) * world_from_ray,
                      overlaps(cameras[i], *other, std::min(kViews, model.size()))});
  }
  std::vector<JointPose> out;
  std::vector<std::pair<float, uint32_t>> ranked;
  for (size_t view = 0; view < views; ++view) {
    const Eigen::Matrix3d upright = model.view(view).camera_from_object.rotation_matrix();
    for (int turn = 0; turn < kTurns; ++turn) {
      const size_t index = view * kTurns + static_cast<size_t>(turn);
      const Eigen::Matrix3d along =
          Eigen::AngleAxisd(turn_angle(turn), Eigen::Vector3d::UnitZ()) * upright;
      float sum = std::max(0.0f, own_overlaps[index] - static_cast<float>(kChance));
      for (const RotatedView& other : others) {
        const Eigen::Matrix3d seen = other.from_first * along;
        const size_t nearest =
            coarse_view_[model.nearest(Eigen::Vector3d(-seen.row(2).transpose()))];
        const Eigen::Matrix3d turned =
            seen * model.view(nearest).camera_from_object.rotation_matrix().transpose();
        const double angle = std::atan2(turned(1, 0) - turned(0, 1), turned(0, 0) + turned(1, 1));
        const long step = std::lround(angle * kTurns / (2 * std::numbers::pi));
        const auto t = static_cast<size_t>((step + kTurns) % kTurns);
        sum += std::max(0.0f, other.overlaps[nearest * kTurns + t] - static_cast<float>(kChance));
      }
      if (sum > 0) ranked.emplace_back(-sum, static_cast<uint32_t>(index));
    }
  }
  std::sort(ranked.begin(), ranked.end());
  for (const auto& [score, index] : ranked) {
    const Eigen::Matrix3d rotation =
        world_from_ray *
        Eigen::AngleAxisd(turn_angle(static_cast<int>(index % kTurns)), Eigen::Vector3d::UnitZ()) *
        model.view(index / kTurns).camera_from_object.rotation_matrix();
    const Eigen::Quaterniond turned(rotation);
    const Rigid3 pose(turned, place.center - turned * model.center());
    const bool known = std::any_of(out.begin(), out.end(), [&](const JointPose& other) {
      return rotation_angle(other.world_from_object, pose) < 0.4;
    });
    if (!known) out.push_back({pose, -static_cast<double>(score)});
    if (out.size() == max) break;
  }
  return out;
}

std::vector<JointPose> SilhouetteSearch::orientations(std::span<const SilhouetteCamera> cameras,
                                                      const Eigen::Vector3d& center,
                                                      size_t max) const {
  if (cameras.empty()) return {};
  return orient(cameras, {center, 0, 0, {}}, kViews, max);
}

double SilhouetteSearch::overlap(const SilhouetteCamera& camera, const Rigid3& world_from_object,
                                 int step) const {
  ++bank_.work().overlaps;
  const auto flat =
      bank_.weak_perspective(camera.camera->model, camera.camera_from_world * world_from_object, 2);
  if (!flat) return -1;
  const double radius = static_cast<double>(flat->scale) * bank_.model().radius();
  const double cell = 2 * radius / kSide;
  const double c = std::cos(static_cast<double>(flat->turn)) * cell,
               s = std::sin(static_cast<double>(flat->turn)) * cell;
  const ViewpointModel::Mask& mask = bank_.model().mask(flat->view);
  int inside = 0, unknown = 0;
  std::array<int, 4> in{}, all{};
  for (int j = step / 2; j < kSide; j += step) {
    const uint32_t row = mask[static_cast<size_t>(j)];
    for (int i = step / 2; i < kSide; i += step) {
      const double u = i - 0.5 * (kSide - 1), v = j - 0.5 * (kSide - 1);
      const uint8_t what = class_at(*camera.map, static_cast<double>(flat->x) + c * u - s * v,
                                    static_cast<double>(flat->y) + s * u + c * v);
      const int bit = static_cast<int>(row >> i & 1u);
      inside += bit;
      in[what] += bit;
      ++all[what];
    }
  }
  unknown = in[ForegroundMap::kUnknown];
  return overlap_over_union(inside, in[ForegroundMap::kForeground], in[ForegroundMap::kShadow],
                            unknown, all[ForegroundMap::kForeground], all[ForegroundMap::kShadow]);
}

double SilhouetteSearch::score(std::span<const SilhouetteCamera> cameras,
                               const Rigid3& world_from_object, int step) const {
  double sum = 0;
  for (const SilhouetteCamera& camera : cameras) {
    sum += std::max(0.0, overlap(camera, world_from_object, step) - kChance);
  }
  return sum;
}

std::vector<JointPose> SilhouetteSearch::search(std::span<const SilhouetteCamera> cameras,
                                                size_t max) const {
  const double radius = bank_.model().radius();
  std::vector<Place> places = find_places(cameras);
  const Eigen::Vector3d& center = bank_.model().center();
  const auto climb = [&](const Rigid3& pose) {
    return climb_pose(pose, center, 0.15, 0.3 * radius, 3,
                      [&](const Rigid3& tried) { return score(cameras, tried, 2); });
  };
  // Few views tell good places from bad ones, and even a wrong one draws the place to the middle
  // of the foreground.
  for (Place& place : places) {
    const auto best = orient(cameras, place, kFewViews, 1);
    place.score = best.empty() ? 0 : best.front().score;
    if (!best.empty()) place.pose = best.front().world_from_object;
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.score > b.score; });
  if (places.size() > kMaxGoodPlaces) places.resize(kMaxGoodPlaces);
  std::vector<JointPose> out;
  for (Place& place : places) {
    if (!(place.score > 0)) break;
    place.center = climb(place.pose).world_from_object * center;
    for (const JointPose& pose : orient(cameras, place, kViews, kMaxPosesOfPlace)) {
      out.push_back(climb(pose.world_from_object));
    }
  }
  remove_duplicates(out, 0.15 * radius, 0.15);
  if (out.size() > max) out.resize(max);
  return out;
}

}  // namespace sightline::observe
