// SPDX-License-Identifier: Apache-2.0
#include "observe/stereo/epipolar_match.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace sightline::observe {
namespace {

constexpr double kStepPx = 0.7;         // between candidates on the curve
constexpr int kMaxCandidates = 400;     // a curve longer than that is searched more coarsely
constexpr int kPeakDistance = 3;        // candidates between a peak and its runner-up
constexpr float kMinContrast = 1.5f;    // standard deviation of a patch [levels]
constexpr float kContrastRatio = 1.7f;  // between the two images of a patch
constexpr double kTilts[] = {-0.9, -0.45, 0.45, 0.9};  // [rad] of the plane, about two axes

/// Mean taken off, unit length; returns what the length was, 0 for a patch without contrast.
float normalize(std::vector<float>& patch) {
  float sum = 0;
  for (const float v : patch) sum += v;
  const float mean = sum / static_cast<float>(patch.size());
  float squares = 0;
  for (float& v : patch) {
    v -= mean;
    squares += v * v;
  }
  const float length = std::sqrt(squares);
  if (length < kMinContrast * std::sqrt(static_cast<float>(patch.size()))) return 0;
  for (float& v : patch) v /= length;
  return length;
}

double dot(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i] * b[i]);
  return sum;
}

}  // namespace

/// The first view's ray through a pixel, and those one patch radius right of it and below it.
struct EpipolarMatcher::Ray {
  Eigen::Vector3d middle, right, below;  // unit, world axes
  double low = 0, high = 0;              // 1/distance at which it leaves and enters the region
};

/// A point on the ray and how well the patches correlate there.
struct EpipolarMatcher::Candidate {
  double inverse_depth = 0;
  double score = -1;
};

/// The best candidate of a whole curve.
struct EpipolarMatcher::CurveScan {
  Candidate best;
  double runner_up = -1;  ///< score of the best other peak
  double step = 0;        ///< of the inverse depth between candidates
};

EpipolarMatcher::EpipolarMatcher(const MatchView& first, const MatchView& second,
                                 const StereoRegion& region, const StereoPointOptions& options)
    : first_(first),
      second_(second),
      region_(region),
      options_(options),
      first_center_(first.camera_from_world.inverse().translation),
      second_center_(second.camera_from_world.inverse().translation) {
  const auto side = static_cast<size_t>(2 * options.patch_radius_px + 1);
  for (auto* patch : {&reference_, &warped_, &ahead_, &behind_}) patch->resize(side * side);
}

std::optional<EpipolarMatcher::Ray> EpipolarMatcher::ray_of(const Eigen::Vector2d& pixel) const {
  const CameraModel& model = first_.camera->model;
  const double r = options_.patch_radius_px;
  const auto middle = model.unproject(pixel);
  const auto right = model.unproject(pixel + Eigen::Vector2d(r, 0));
  const auto below = model.unproject(pixel + Eigen::Vector2d(0, r));
  if (!middle || !right || !below) return std::nullopt;
  const Eigen::Quaterniond turn = first_.camera_from_world.rotation.conjugate();
  Ray ray{turn * *middle, turn * *right, turn * *below};
  const Eigen::Vector3d to_region = region_.center - first_center_;
  const double along = ray.middle.dot(to_region);
  const double aside = to_region.squaredNorm() - along * along;
  const double half = region_.radius * region_.radius - aside;
  if (half <= 0 || along <= 0) return std::nullopt;
  const double nearest = std::max(along - std::sqrt(half), 0.05 * along);
  ray.low = 1 / (along + std::sqrt(half));
  ray.high = 1 / nearest;
  return ray;
}

std::optional<Eigen::Vector2d> EpipolarMatcher::second_pixel(const Ray& ray,
                                                             double inverse_depth) const {
  return second_.project(first_center_ + ray.middle / inverse_depth);
}

// The pixel of the patch's center and the affine map of its pixels, for a plane through the point.
bool EpipolarMatcher::warp(const Ray& ray, double inverse_depth, const Eigen::Vector3d& normal,
                           Eigen::Vector2d& pixel, Eigen::Matrix2d& map) const {
  const Eigen::Vector3d from_first = ray.middle / inverse_depth;
  const double distance = normal.dot(from_first);
  const auto in_second = [&](const Eigen::Vector3d& direction) -> std::optional<Eigen::Vector2d> {
    const double facing = normal.dot(direction);
    if (facing * distance <= 0) return std::nullopt;
    return second_.project(first_center_ + direction * (distance / facing));
  };
  const auto middle = in_second(ray.middle), right = in_second(ray.right),
             below = in_second(ray.below);
  if (!middle || !right || !below) return false;
  pixel = *middle;
  map.col(0) = (*right - *middle) / options_.patch_radius_px;
  map.col(1) = (*below - *middle) / options_.patch_radius_px;
  // A patch seen edge-on, mirrored or much larger is no match of this one.
  const double scale = map.determinant();
  return scale > 0.2 && scale < 5;
}

bool EpipolarMatcher::sample(const Ray& ray, double inverse_depth, const Eigen::Vector3d& normal,
                             std::vector<float>& patch) const {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d map;
  if (!warp(ray, inverse_depth, normal, pixel, map)) return false;
  const int r = options_.patch_radius_px;
  if (!second_.plane->holds(pixel, r * map.cwiseAbs().rowwise().sum().maxCoeff())) return false;
  const Eigen::Vector2f middle = pixel.cast<float>();
  const Eigen::Matrix2f m = map.cast<float>();
  float* to = patch.data();
  for (int y = -r; y <= r; ++y) {
    for (int x = -r; x <= r; ++x) {
      const Eigen::Vector2f at =
          middle + static_cast<float>(x) * m.col(0) + static_cast<float>(y) * m.col(1);
      *to++ = second_.plane->sample(at.x(), at.y());
    }
  }
  // The same surface under the same light has about the same contrast.
  const float contrast = normalize(patch);
  return contrast > reference_contrast_ / kContrastRatio &&
         contrast < reference_contrast_ * kContrastRatio;
}

double EpipolarMatcher::score(const Ray& ray, double inverse_depth, const Eigen::Vector3d& normal) {
  return sample(ray, inverse_depth, normal, warped_) ? dot(reference_, warped_) : -1;
}

// Hill climbing on the score in halving steps; the score reached.
double EpipolarMatcher::climb(const Ray& ray, const Eigen::Vector3d& normal, double step,
                              Candidate& candidate) {
  candidate.score = score(ray, candidate.inverse_depth, normal);
  for (; step > 0.2 * kStepPx; step *= 0.5) {
    for (const double way : {-step, step}) {
      const double there = score(ray, candidate.inverse_depth + way, normal);
      if (there > candidate.score) candidate = {candidate.inverse_depth + way, there};
    }
  }
  return candidate.score;
}

// Gauss-Newton on the inverse depth with the normalized patches as residuals; returns the standard
// deviation of the inverse depth: residuals of neighboring pixels are smoothed, hence correlated,
// so that they count for less than their number.
double EpipolarMatcher::refine(const Ray& ray, const Eigen::Vector3d& normal, double step,
                               Candidate& candidate) {
  constexpr double kCorrelatedPixels = 9;
  double variance = step * step;
  for (int i = 0; i < 4; ++i) {
    const double at = candidate.inverse_depth;
    const double small = 0.3 * step;
    if (!sample(ray, at, normal, warped_) || !sample(ray, at + small, normal, ahead_) ||
        !sample(ray, at - small, normal, behind_)) {
      break;
    }
    double square = 0, product = 0, rest = 0;
    for (size_t k = 0; k < reference_.size(); ++k) {
      const double slope = static_cast<double>(ahead_[k] - behind_[k]) / (2 * small);
      const double miss = static_cast<double>(reference_[k] - warped_[k]);
      square += slope * slope;
      product += slope * miss;
      rest += miss * miss;
    }
    if (!(square > 0)) break;
    variance = kCorrelatedPixels * rest / static_cast<double>(reference_.size()) / square;
    const double move = std::clamp(product / square, -step, step);
    const double there = score(ray, at + move, normal);
    if (there < candidate.score) break;
    candidate = {at + move, there};
    if (std::abs(move) < 0.01 * step) break;
  }
  return std::sqrt(variance);
}

// The patch of the first view around a pixel; false without contrast.
bool EpipolarMatcher::take_reference(const Eigen::Vector2d& pixel) {
  const int r = options_.patch_radius_px;
  if (!first_.plane->holds(pixel, r)) return false;
  float* to = reference_.data();
  for (int y = -r; y <= r; ++y) {
    for (int x = -r; x <= r; ++x) {
      *to++ = first_.plane->sample(static_cast<float>(pixel.x()) + static_cast<float>(x),
                                   static_cast<float>(pixel.y()) + static_cast<float>(y));
    }
  }
  reference_contrast_ = normalize(reference_);
  return reference_contrast_ > 0;
}

// Scores the whole curve with planes of one normal.
std::optional<EpipolarMatcher::CurveScan> EpipolarMatcher::scan(const Ray& ray,
                                                                const Eigen::Vector3d& normal) {
  const auto start = second_pixel(ray, ray.low), end = second_pixel(ray, ray.high);
  if (!start || !end) return std::nullopt;
  const double length = (*end - *start).norm();
  const int count = std::clamp(static_cast<int>(length / kStepPx) + 2, 3, kMaxCandidates);
  CurveScan out;
  out.step = (ray.high - ray.low) / (count - 1);
  scores_.resize(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    scores_[static_cast<size_t>(i)] = score(ray, ray.low + i * out.step, normal);
  }
  const auto best = std::max_element(scores_.begin(), scores_.end());
  if (*best <= 0) return std::nullopt;
  const auto index = static_cast<int>(best - scores_.begin());
  out.best = {ray.low + index * out.step, *best};
  for (int i = 1; i + 1 < count; ++i) {
    const auto k = static_cast<size_t>(i);
    const bool peak = scores_[k] >= scores_[k - 1] && scores_[k] >= scores_[k + 1];
    if (peak && std::abs(i - index) >= kPeakDistance) {
      out.runner_up = std::max(out.runner_up, scores_[k]);
    }
  }
  return out;
}

// Tilts the plane about two axes to where the patches correlate best.
Eigen::Vector3d EpipolarMatcher::tilt_plane(const Ray& ray, Eigen::Vector3d normal, double step,
                                            Candidate& candidate) {
  const Eigen::Vector3d across = (second_center_ - first_center_).cross(normal).normalized();
  const Eigen::Vector3d along = across.cross(normal);
  for (const Eigen::Vector3d& axis : {across, along}) {
    const Eigen::Vector3d before = normal;
    for (const double tilt : kTilts) {
      const Eigen::Vector3d tilted = Eigen::AngleAxisd(tilt, axis) * before;
      Candidate other = candidate;
      if (climb(ray, tilted, 0.5 * step, other) <= candidate.score) continue;
      candidate = other;
      normal = tilted;
    }
  }
  return normal;
}

std::optional<EpipolarMatch> EpipolarMatcher::match(const Eigen::Vector2d& pixel, bool tilted) {
  const auto ray = ray_of(pixel);
  if (!ray || !take_reference(pixel)) return std::nullopt;
  const Eigen::Vector3d point = first_center_ + 2 * ray->middle / (ray->low + ray->high);
  const Eigen::Vector3d facing =
      ((first_center_ - point).normalized() + (second_center_ - point).normalized()).normalized();
  const auto scanned = scan(*ray, facing);
  if (!scanned) return std::nullopt;
  const double step = scanned->step;
  Candidate best = scanned->best;
  climb(*ray, facing, 0.5 * step, best);
  const Eigen::Vector3d normal = tilted ? tilt_plane(*ray, facing, step, best) : facing;
  const double sigma = refine(*ray, normal, step, best);
  const auto found = second_pixel(*ray, best.inverse_depth);
  const auto beside = second_pixel(*ray, best.inverse_depth + 0.1 * step);
  if (!found || !beside || best.inverse_depth < ray->low || best.inverse_depth > ray->high) {
    return std::nullopt;
  }
  EpipolarMatch match;
  match.pixel = *found;
  match.score = best.score;
  match.runner_up = scanned->runner_up;
  match.sigma_px = sigma * (*beside - *found).norm() / (0.1 * step);
  return match;
}

Eigen::Vector2d EpipolarMatcher::epipolar_direction(const Eigen::Vector2d& pixel) const {
  const auto ray = ray_of(pixel);
  if (!ray) return Eigen::Vector2d::Zero();
  const Eigen::Vector3d point = first_center_ + 2 * ray->middle / (ray->low + ray->high);
  const Eigen::Vector3d nearer = point + 1e-3 * (second_center_ - point);
  const auto moved = first_.project(nearer);
  if (!moved || (*moved - pixel).norm() < 1e-9) return Eigen::Vector2d::Zero();
  return (*moved - pixel).normalized();
}

}  // namespace sightline::observe
