// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/ray_pose.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <unordered_map>

#include "sightline/base/log.hpp"

namespace sightline::observe {
namespace {

constexpr double kMinRayZ = 0.1;       // z of a unit ray that P3P may use
constexpr double kMinDistancePx = 5;   // between the matches of a sample
constexpr double kMinAreaShare = 0.1;  // area of a sample by the square of its longest side
constexpr size_t kMinMatches = 4;      // of a camera that samples are taken from
constexpr size_t kMaxHypotheses = 40;  // poses under way
constexpr double kOwnSupport = 3.5;    // of a pose by its own sample, at most
// Of matches that agree with the pose that one of them makes. It is off by its tilt, size and
// orientation, the more so the farther from it.
constexpr PatchTolerance kRoughly{0.9, 1.9, 0.05};
constexpr double kReachShare = 0.4, kReachPx = 4;
constexpr size_t kMaxGroups = 40;
constexpr size_t kMaxSeeds = 300, kMaxMembers = 600;  // of a camera: its best matches
constexpr int kGroupsOfOne = 6;                       // groups that one match is in

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

using Sample = std::array<const RigMatch*, 3>;

// Matches of one camera, the one that they agree with first.
struct Group {
  size_t view = 0;
  std::vector<const RigMatch*> members;
};

const Eigen::Vector3d& point_of(const RigMatch& match) { return match.match.point_in_object; }

bool well_spread(const Sample& sample) {
  const Eigen::Vector3d u = point_of(*sample[1]) - point_of(*sample[0]);
  const Eigen::Vector3d v = point_of(*sample[2]) - point_of(*sample[0]);
  const double longest = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
  if (u.cross(v).norm() < kMinAreaShare * longest) return false;
  for (size_t i = 0; i < 3; ++i) {
    if ((sample[i]->match.pixel - sample[(i + 1) % 3]->match.pixel).norm() < kMinDistancePx)
      return false;
  }
  return true;
}

// camera_from_object of three rays to three points: up to four (Ke and Roumeliotis, 2017).
std::vector<Rigid3> three_ray_poses(const Sample& sample) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> places;
  for (const RigMatch* match : sample) {
    const Eigen::Vector3d &point = point_of(*match), &ray = match->seen.ray;
    points.emplace_back(point.x(), point.y(), point.z());
    places.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
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
      : views_(views), options_(options), matches_(views.size()), random_(options.seed) {
    for (const RigMatch& m : matches) {
      if (m.seen.ray.z() >= kMinRayZ) matches_[m.view].push_back(&m);
    }
    for (const RigView& view : views) {
      camera_from_world_.push_back(view.camera->world_from_camera.inverse());
    }
  }

  std::vector<Scored> run() {
    const std::vector<Group> groups = chosen(all_groups());
    for (size_t trial = 0; trial < static_cast<size_t>(options_.trials); ++trial) {
      if (groups.empty()) break;
      const Group& group = groups[trial % groups.size()];
      Sample sample;
      if (!draw(group.members, sample)) continue;
      for (const Rigid3& camera_from_object : three_ray_poses(sample)) {
        remember(views_[group.view].camera->world_from_camera * camera_from_object);
      }
    }
    return std::move(best_);
  }

 private:
  std::vector<Group> all_groups() const {
    std::vector<Group> out;
    for (size_t view = 0; view < views_.size(); ++view) {
      if (matches_[view].size() < kMinMatches) continue;
      for (const RigMatch* match : best_of(view, kMaxSeeds)) {
        for (const Rigid3& pose : patch_poses(match->trained, point_of(*match), match->seen)) {
          Group group{view, {match}};
          add_agreeing(pose, group);
          if (group.members.size() >= kMinMatches) out.push_back(std::move(group));
        }
      }
    }
    return out;
  }

  std::span<const RigMatch* const> best_of(size_t view, size_t count) const {
    return std::span(matches_[view]).first(std::min(count, matches_[view].size()));
  }

  void add_agreeing(const Rigid3& camera_from_object, Group& group) const {
    const RigMatch& from = *group.members.front();
    const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
    const double pixel = 1 / views_[group.view].camera->model.parameters().fx;
    for (const RigMatch* match : best_of(group.view, kMaxMembers)) {
      if (match == &from) continue;
      const Eigen::Vector3d at = rotation * point_of(*match) + camera_from_object.translation;
      const double reach =
          kReachShare * (match->seen.ray - from.seen.ray).norm() + kReachPx * pixel;
      if ((at.normalized() - match->seen.ray).squaredNorm() > reach * reach) continue;
      if (looks_like(match->trained, rotation, at, match->seen, kRoughly)) {
        group.members.push_back(match);
      }
    }
  }

  // The largest, of one match a few.
  static std::vector<Group> chosen(std::vector<Group> groups) {
    std::stable_sort(groups.begin(), groups.end(), [](const Group& a, const Group& b) {
      return a.members.size() > b.members.size();
    });
    std::vector<Group> out;
    std::unordered_map<const RigMatch*, int> groups_of;
    for (Group& group : groups) {
      if (out.size() == kMaxGroups) break;
      if (groups_of[group.members.front()] >= kGroupsOfOne) continue;
      for (const RigMatch* match : group.members) ++groups_of[match];
      out.push_back(std::move(group));
    }
    return out;
  }

  bool draw(const std::vector<const RigMatch*>& members, Sample& sample) {
    const auto another = [&] { return members[1 + random_.below(members.size() - 1)]; };
    sample = {members.front(), another(), another()};
    return well_spread(sample);
  }

  // Truncated squared error of all cameras' rays; 1 for each that fits exactly.
  double score(const Rigid3& world_from_object) const {
    double sum = 0;
    for (size_t i = 0; i < views_.size(); ++i) {
      const Rigid3 camera_from_object = camera_from_world_[i] * world_from_object;
      const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
      const double pixel = 1 / views_[i].camera->model.parameters().fx;
      const double motion = options_.slack * std::abs(views_[i].seconds);
      for (const RigMatch* match : matches_[i]) {
        const Eigen::Vector3d at = rotation * point_of(*match) + camera_from_object.translation;
        const double along = at.dot(match->seen.ray);
        if (along <= 0) continue;
        const double reach = options_.inlier_px * pixel * along + motion;
        const double share = (at.squaredNorm() - along * along) / (reach * reach);
        if (share >= 1) continue;
        if (looks_like(match->trained, rotation, at, match->seen, options_.patch)) sum += 1 - share;
      }
    }
    return sum;
  }

  void remember(const Rigid3& world_from_object) {
    const double value = score(world_from_object);
    if (best_.size() == kMaxHypotheses && value <= best_.back().score) return;
    if (value <= kOwnSupport) return;
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

  std::span<const RigView> views_;
  const RigPoseOptions& options_;
  std::vector<std::vector<const RigMatch*>> matches_;  ///< by view
  std::vector<Rigid3> camera_from_world_;
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
