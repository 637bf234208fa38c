// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/ray_pose.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "sightline/base/log.hpp"

namespace sightline::observe {
namespace {

constexpr double kMinRayZ = 0.1;            // z of a unit ray that P3P may use
constexpr size_t kNeighbors = 20;           // in the image, of which some samples are made
constexpr double kMinDistancePx = 5;        // between the matches of a sample
constexpr double kMinAreaShare = 0.1;       // area of a sample by the square of its longest side
constexpr double kMissProbability = 0.001;  // chance that no sample was free of wrong matches
constexpr size_t kMinMatches = 4;           // of a camera that samples are taken from
constexpr size_t kMaxHypotheses = 40;       // poses under way

// A match as a ray of its camera.
struct RayMatch {
  Eigen::Vector3d ray, point, seen_from;
  Eigen::Vector2d pixel;
};

struct Scored {
  Rigid3 world_from_object;
  double score = 0;
};

// Repeatable numbers: splitmix64 (Steele, Lea, Flood, 2014).
class SplitMix64 {
 public:
  explicit SplitMix64(uint64_t seed) : state_(seed) {}
  size_t below(size_t n) { return static_cast<size_t>(bits() % n); }

 private:
  uint64_t bits() {
    uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  uint64_t state_;
};

using Sample = std::array<const RayMatch*, 3>;

bool well_spread(const Sample& sample) {
  const Eigen::Vector3d u = sample[1]->point - sample[0]->point;
  const Eigen::Vector3d v = sample[2]->point - sample[0]->point;
  const double longest = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
  if (u.cross(v).norm() < kMinAreaShare * longest) return false;
  for (size_t i = 0; i < 3; ++i) {
    if ((sample[i]->pixel - sample[(i + 1) % 3]->pixel).norm() < kMinDistancePx) return false;
  }
  return true;
}

// camera_from_object of three rays to three points: up to four (Ke and Roumeliotis, 2017).
std::vector<Rigid3> three_ray_poses(const Sample& sample) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> places;
  for (const RayMatch* match : sample) {
    points.emplace_back(match->point.x(), match->point.y(), match->point.z());
    places.emplace_back(match->ray.x() / match->ray.z(), match->ray.y() / match->ray.z());
  }
  std::vector<Rigid3> poses;
  try {
    std::vector<cv::Mat> rotations, shifts;
    cv::solveP3P(points, places, cv::Matx33d::eye(), cv::noArray(), rotations, shifts,
                 cv::SOLVEPNP_AP3P);
    for (size_t i = 0; i < rotations.size(); ++i) {
      const Eigen::Vector3d axis(rotations[i].at<double>(0), rotations[i].at<double>(1),
                                 rotations[i].at<double>(2));
      const Eigen::Vector3d shift(shifts[i].at<double>(0), shifts[i].at<double>(1),
                                  shifts[i].at<double>(2));
      const double angle = axis.norm();
      if (!std::isfinite(angle) || !shift.allFinite()) continue;
      poses.emplace_back(angle > 1e-12 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis / angle))
                                       : Eigen::Quaterniond::Identity(),
                         shift);
    }
  } catch (const cv::Exception& error) {
    log::debug("features: OpenCV refused three points: {}", error.what());
  }
  return poses;
}

class Sampler {
 public:
  Sampler(std::span<const RigView> views, std::span<const RigMatch> matches,
          const RigPoseOptions& options)
      : views_(views), options_(options), ray_matches_(views.size()), random_(options.seed) {
    for (const RigMatch& m : matches) {
      const auto ray = views[m.view].camera->model.unproject(m.match.pixel);
      if (!ray || ray->z() < kMinRayZ) continue;
      ray_matches_[m.view].push_back({*ray, m.match.point_in_object, m.seen_from, m.match.pixel});
    }
    for (const RigView& view : views) {
      camera_from_world_.push_back(view.camera->world_from_camera.inverse());
    }
    for (const auto& ray_matches : ray_matches_) neighbors_.push_back(neighbors_of(ray_matches));
  }

  std::vector<Scored> run() {
    size_t all = 0;
    for (const auto& ray_matches : ray_matches_)
      all += ray_matches.size() >= kMinMatches ? ray_matches.size() : 0;
    if (all == 0) return {};
    double needed = options_.trials;
    for (int trial = 0; trial < options_.trials && trial < needed; ++trial) {
      const size_t view = view_of(random_.below(all));
      Sample sample;
      if (!draw(view, trial % 2 == 0, sample)) continue;
      for (const Rigid3& camera_from_object : three_ray_poses(sample)) {
        remember(views_[view].camera->world_from_camera * camera_from_object);
      }
      needed = trials_needed(all);
    }
    return std::move(best_);
  }

 private:
  static std::vector<std::vector<size_t>> neighbors_of(const std::vector<RayMatch>& ray_matches) {
    std::vector<std::vector<size_t>> out(ray_matches.size());
    std::vector<size_t> order;
    for (size_t i = 0; i < ray_matches.size(); ++i) {
      order.clear();
      for (size_t k = 0; k < ray_matches.size(); ++k) {
        if ((ray_matches[k].pixel - ray_matches[i].pixel).norm() >= kMinDistancePx)
          order.push_back(k);
      }
      const auto middle =
          order.begin() + static_cast<ptrdiff_t>(std::min(kNeighbors, order.size()));
      std::partial_sort(order.begin(), middle, order.end(), [&](size_t a, size_t b) {
        const double to_a = (ray_matches[a].pixel - ray_matches[i].pixel).squaredNorm();
        const double to_b = (ray_matches[b].pixel - ray_matches[i].pixel).squaredNorm();
        return to_a != to_b ? to_a < to_b : a < b;
      });
      out[i].assign(order.begin(), middle);
    }
    return out;
  }

  // The camera that the n-th match belongs to.
  size_t view_of(size_t n) const {
    for (size_t i = 0; i < ray_matches_.size(); ++i) {
      if (ray_matches_[i].size() < kMinMatches) continue;
      if (n < ray_matches_[i].size()) return i;
      n -= ray_matches_[i].size();
    }
    return 0;
  }

  bool draw(size_t view, bool local, Sample& sample) {
    const std::vector<RayMatch>& ray_matches = ray_matches_[view];
    const size_t first = random_.below(ray_matches.size());
    const std::vector<size_t>& near = neighbors_[view][first];
    if (near.size() < 2) return false;
    const auto another = [&] {
      return &ray_matches[local ? near[random_.below(near.size())]
                                : random_.below(ray_matches.size())];
    };
    sample = {&ray_matches[first], another(), another()};
    return well_spread(sample);
  }

  // Truncated squared error of all cameras' rays; 1 for each that fits exactly.
  double score(const Rigid3& world_from_object) const {
    double sum = 0;
    for (size_t i = 0; i < views_.size(); ++i) {
      const Rigid3 camera_from_object = camera_from_world_[i] * world_from_object;
      const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
      const Eigen::Vector3d eye = -(rotation.transpose() * camera_from_object.translation);
      const double pixel = 1 / views_[i].camera->model.parameters().fx;
      const double motion = options_.slack * std::abs(views_[i].seconds);
      for (const RayMatch& match : ray_matches_[i]) {
        const Eigen::Vector3d at = rotation * match.point + camera_from_object.translation;
        const double along = at.dot(match.ray);
        if (along <= 0) continue;
        const double reach = options_.inlier_px * pixel * along + motion;
        const double share = (at.squaredNorm() - along * along) / (reach * reach);
        if (share >= 1) continue;
        const Eigen::Vector3d back = eye - match.point;
        if (back.dot(match.seen_from) < options_.facing * back.norm()) continue;
        sum += 1 - share;
      }
    }
    return sum;
  }

  void remember(const Rigid3& world_from_object) {
    const double value = score(world_from_object);
    if (best_.size() == kMaxHypotheses && value <= best_.back().score) return;
    if (value <= 3.5) return;  // its own sample alone
    for (Scored& known : best_) {
      if (rotation_angle(known.world_from_object, world_from_object) > 0.1 ||
          translation_distance(known.world_from_object, world_from_object) > 0.02)
        continue;
      if (value > known.score) known = {world_from_object, value};
      return sort();
    }
    best_.push_back({world_from_object, value});
    sort();
    if (best_.size() > kMaxHypotheses) best_.pop_back();
  }
  void sort() {
    std::stable_sort(best_.begin(), best_.end(),
                     [](const Scored& a, const Scored& b) { return a.score > b.score; });
  }

  double trials_needed(size_t all) const {
    if (best_.empty()) return options_.trials;
    const double share = std::min(0.99, best_.front().score / static_cast<double>(all));
    return 50 + std::log(kMissProbability) / std::log(1 - share * share * share);
  }

  std::span<const RigView> views_;
  const RigPoseOptions& options_;
  std::vector<std::vector<RayMatch>> ray_matches_;  ///< by view
  std::vector<Rigid3> camera_from_world_;
  std::vector<std::vector<std::vector<size_t>>> neighbors_;
  SplitMix64 random_;
  std::vector<Scored> best_;
};

}  // namespace

std::vector<Rigid3> ray_poses(std::span<const RigView> views, std::span<const RigMatch> matches,
                              const RigPoseOptions& options) {
  std::vector<Rigid3> out;
  for (const Scored& pose : Sampler(views, matches, options).run()) {
    if (out.size() == options.kept) break;
    out.push_back(pose.world_from_object);
  }
  return out;
}

}  // namespace sightline::observe
