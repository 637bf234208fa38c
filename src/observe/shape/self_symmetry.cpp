// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/self_symmetry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "observe/shape/view_sphere.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline::observe {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr size_t kSurface = 16000;  // samples that stand for the surface
constexpr size_t kJudged = 1200, kFine = 300, kCoarse = 100;
constexpr int kCells = 40;         // along a side of the grid of samples
constexpr double kUsual = 0.02;    // of the radius: 95 % of the surface
constexpr double kLargest = 0.06;  // and all of it
constexpr double kFar = 0.12;      // of the radius: distances beyond it count as this
constexpr double kPromising = 0.09, kNearly = 0.03;  // mean distance, before and after a few rounds
constexpr int kAngles = 24;                          // that are tried about an axis
constexpr int kFirstRounds = 4, kRounds = 12;        // of moving the surface onto itself
constexpr double kMoments = 0.45;  // change of the second moments that another 12 degrees may make
constexpr double kSameRotation = 10 * kDegree;
constexpr size_t kMaxRotations = 120;  // of a ball, which has no end of them

struct SurfacePoint {
  Eigen::Vector3d point, normal;
};

// Evenly spread without a pattern: Roberts' sequence, folded into the triangles.
std::vector<SurfacePoint> spread_samples(const TriangleMesh& mesh, size_t count) {
  std::vector<double> areas;
  double total = 0;
  const auto corner = [&](const std::array<uint32_t, 3>& face, size_t k) {
    return Eigen::Vector3d(mesh.vertices[face[k]].cast<double>());
  };
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3d a = corner(face, 0);
    areas.push_back(0.5 * (corner(face, 1) - a).cross(corner(face, 2) - a).norm());
    total += areas.back();
  }
  std::vector<SurfacePoint> samples;
  double due = 0, made = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const Eigen::Vector3d origin = corner(mesh.faces[f], 0);
    const Eigen::Vector3d u = corner(mesh.faces[f], 1) - origin;
    const Eigen::Vector3d v = corner(mesh.faces[f], 2) - origin;
    const Eigen::Vector3d normal = u.cross(v).normalized();
    due += static_cast<double>(count) * areas[f] / total;
    for (; due >= 1; due -= 1) {
      ++made;
      double a = 0.7548776662 * made, b = 0.5698402910 * made;
      a -= std::floor(a);
      b -= std::floor(b);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      samples.push_back({origin + a * u + b * v, normal});
    }
  }
  return samples;
}

std::vector<SurfacePoint> every(const std::vector<SurfacePoint>& samples, size_t count) {
  std::vector<SurfacePoint> out;
  const size_t step = std::max<size_t>(1, samples.size() / count);
  for (size_t i = step / 2; i < samples.size(); i += step) out.push_back(samples[i]);
  return out;
}

/// The surface by its samples, sorted into a grid, about its middle and in units of its radius.
class Surface {
 public:
  explicit Surface(const TriangleMesh& mesh) : radius_(static_cast<double>(mesh.radius)) {
    samples_ = spread_samples(mesh, kSurface);
    for (const SurfacePoint& sample : samples_)
      middle_ += sample.point / static_cast<double>(samples_.size());
    for (SurfacePoint& sample : samples_) {
      sample.point = (sample.point - middle_) / radius_;
      moments_ += sample.point * sample.point.transpose() / static_cast<double>(samples_.size());
    }
    for (const SurfacePoint& sample : samples_) reach_ = std::max(reach_, sample.point.norm());
    starts_.assign(static_cast<size_t>(kCells * kCells * kCells) + 1, 0);
    for (const SurfacePoint& sample : samples_) ++starts_[cell_of(sample.point) + 1];
    for (size_t i = 1; i < starts_.size(); ++i) starts_[i] += starts_[i - 1];
    sorted_.resize(samples_.size());
    std::vector<size_t> next(starts_.begin(), starts_.end() - 1);
    for (const SurfacePoint& sample : samples_) sorted_[next[cell_of(sample.point)]++] = sample;
  }

  /// The sample nearest to a point; null beyond kFar.
  const SurfacePoint* nearest(const Eigen::Vector3d& point) const {
    const double size = 2 * reach_ / kCells;
    const int around = static_cast<int>(std::ceil(kFar / size));
    const Eigen::Array3i middle = place_of(point);
    const SurfacePoint* best = nullptr;
    double closest = kFar * kFar;
    for (int ring = 0; ring <= around; ++ring) {
      if (best != nullptr && closest < std::pow((ring - 1) * size, 2)) break;
      for (int z = -ring; z <= ring; ++z) {
        for (int y = -ring; y <= ring; ++y) {
          const bool face = std::abs(z) == ring || std::abs(y) == ring;
          for (int x = -ring; x <= ring; x += face || ring == 0 ? 1 : 2 * ring) {
            const Eigen::Array3i at = middle + Eigen::Array3i(x, y, z);
            if ((at < 0).any() || (at >= kCells).any()) continue;
            const size_t cell = index_of(at);
            for (size_t i = starts_[cell]; i < starts_[cell + 1]; ++i) {
              const double squared = (sorted_[i].point - point).squaredNorm();
              if (squared >= closest) continue;
              closest = squared;
              best = &sorted_[i];
            }
          }
        }
      }
    }
    return best;
  }

  /// Distance of a point from the surface: from the plane of the nearest sample, which lies no
  /// farther aside than the samples do from one another.
  double distance(const Eigen::Vector3d& point) const {
    const SurfacePoint* sample = nearest(point);
    if (sample == nullptr) return kFar;
    const Eigen::Vector3d off = point - sample->point;
    const double along = std::abs(off.dot(sample->normal));
    const double aside = std::sqrt(std::max(0.0, off.squaredNorm() - along * along));
    const double spacing = 4.0 / std::sqrt(static_cast<double>(samples_.size()));
    return std::max(along, aside > spacing ? off.norm() : 0.0);
  }

  const std::vector<SurfacePoint>& samples() const { return samples_; }
  const Eigen::Matrix3d& moments() const { return moments_; }
  const Eigen::Vector3d& middle() const { return middle_; }
  double radius() const { return radius_; }

 private:
  Eigen::Array3i place_of(const Eigen::Vector3d& point) const {
    return ((point.array() / (2 * reach_) + 0.5) * kCells)
        .floor()
        .cast<int>()
        .max(0)
        .min(kCells - 1);
  }
  static size_t index_of(const Eigen::Array3i& place) {
    return static_cast<size_t>((place.z() * kCells + place.y()) * kCells + place.x());
  }
  size_t cell_of(const Eigen::Vector3d& point) const { return index_of(place_of(point)); }

  double radius_;
  double reach_ = 1e-9;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moments_ = Eigen::Matrix3d::Zero();
  std::vector<SurfacePoint> samples_, sorted_;
  std::vector<size_t> starts_;
};

double mean_distance(const Surface& surface, const std::vector<SurfacePoint>& samples,
                     const Rigid3& transform) {
  double sum = 0;
  for (const SurfacePoint& sample : samples) sum += surface.distance(transform * sample.point);
  return sum / static_cast<double>(samples.size());
}

bool maps_onto_itself(const Surface& surface, const std::vector<SurfacePoint>& samples,
                      const Rigid3& transform) {
  const size_t few = samples.size() / 20;
  size_t off = 0;
  for (const SurfacePoint& sample : samples) {
    const double distance = surface.distance(transform * sample.point);
    if (distance > kLargest) return false;
    off += distance > kUsual ? 1 : 0;
  }
  return off <= few;
}

// Moves the transformed surface onto itself: distances along the normals, by least squares.
Rigid3 improved(const Surface& surface, const std::vector<SurfacePoint>& samples, Rigid3 transform,
                int rounds = kRounds) {
  for (int round = 0; round < rounds; ++round) {
    Matrix6 system = Matrix6::Identity() * 1e-6;
    Vector6 right = Vector6::Zero();
    for (const SurfacePoint& sample : samples) {
      const Eigen::Vector3d point = transform * sample.point;
      const SurfacePoint* other = surface.nearest(point);
      if (other == nullptr) continue;
      Vector6 slope;
      slope << point.cross(other->normal), other->normal;
      system += slope * slope.transpose();
      right += slope * (other->point - point).dot(other->normal);
    }
    const Vector6 step = system.ldlt().solve(right);
    // The step is small, and one of the moved surface.
    const Rigid3 moved = Rigid3(
        Eigen::Quaterniond(Eigen::AngleAxisd(step.head<3>().norm(), step.head<3>().normalized())),
        step.tail<3>());
    if (!(step.norm() > 1e-5)) break;
    transform = moved * transform;
  }
  return transform;
}

std::vector<Eigen::Quaterniond> candidate_rotations(const Surface& surface,
                                                    const std::vector<SurfacePoint>& coarse) {
  const Eigen::Matrix3d& moments = surface.moments();
  const Eigen::Matrix3d even = Eigen::Matrix3d::Identity() * (moments.trace() / 3);
  const double max = std::max(kMoments * (moments - even).norm(), 0.02 * moments.norm());
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<Eigen::Vector3d> axes;
  for (const Eigen::Vector3d& axis : make_view_sphere(2).directions) {
    const double side = axis.z() != 0 ? axis.z() : axis.y() != 0 ? axis.y() : axis.x();
    if (side > 0) axes.push_back(axis);
  }
  for (const Eigen::Vector3d& axis : axes) {
    for (int i = 2; i <= kAngles - 2; ++i) {
      const Eigen::Quaterniond rotation(
          Eigen::AngleAxisd(2 * std::numbers::pi * i / kAngles, axis));
      const Eigen::Matrix3d r = rotation.toRotationMatrix();
      if ((r * moments * r.transpose() - moments).norm() > max) continue;
      if (mean_distance(surface, coarse, Rigid3(rotation, Eigen::Vector3d::Zero())) < kPromising) {
        rotations.push_back(rotation);
      }
    }
  }
  return rotations;
}

// An axis about which any transform leaves the shape as it is.
std::optional<Eigen::Vector3d> free_axis(const Surface& surface,
                                         const std::vector<SurfacePoint>& samples,
                                         const std::vector<Rigid3>& rotations) {
  std::optional<Eigen::Vector3d> best;
  size_t max = 5;  // an axis that matters shows in more rotations than that
  for (const Rigid3& transform : rotations) {
    const Eigen::Vector3d axis = Eigen::AngleAxisd(transform.rotation).axis();
    size_t same = 0;
    for (const Rigid3& other : rotations) {
      const Eigen::Vector3d second = Eigen::AngleAxisd(other.rotation).axis();
      same += std::abs(axis.dot(second)) > std::cos(6 * kDegree) ? 1 : 0;
    }
    if (same <= max) continue;
    bool free = true;
    for (const double degrees : {11.3, 25.7, 41.9, 68.3, 103.1}) {
      const Eigen::Quaterniond rotation(Eigen::AngleAxisd(degrees * kDegree, axis));
      const Rigid3 start(rotation, Eigen::Vector3d::Zero());
      const Rigid3 end = improved(surface, every(samples, kFine), start);
      free = free && rotation_angle(start, end) < 4 * kDegree &&
             maps_onto_itself(surface, samples, end);
    }
    if (!free) continue;
    best = axis;
    max = same;
  }
  return best;
}

// The smallest angle between two rotations, any rotation about `axis` before or after being
// allowed.
double apart(const Rigid3& a, const Rigid3& b, const std::optional<Eigen::Vector3d>& axis) {
  if (!axis) return rotation_angle(a, b);
  const Eigen::Vector3d u = a.rotation * *axis, v = b.rotation * *axis;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

}  // namespace

SelfSymmetry find_self_symmetry(const TriangleMesh& mesh) {
  const Surface surface(mesh);
  if (surface.samples().size() < kJudged) return {};
  const std::vector<SurfacePoint> judged = every(surface.samples(), kJudged);
  const std::vector<SurfacePoint> coarse = every(surface.samples(), kCoarse);
  const std::vector<SurfacePoint> fine = every(judged, kFine);
  std::vector<Rigid3> found;
  const auto known = [&](const Rigid3& transform) {
    return rotation_angle(transform, Rigid3()) < kSameRotation ||
           std::any_of(found.begin(), found.end(), [&](const Rigid3& other) {
             return rotation_angle(other, transform) < kSameRotation;
           });
  };
  for (const Eigen::Quaterniond& start : candidate_rotations(surface, coarse)) {
    if (known(Rigid3(start, Eigen::Vector3d::Zero()))) continue;
    const Rigid3 nearer =
        improved(surface, coarse, Rigid3(start, Eigen::Vector3d::Zero()), kFirstRounds);
    if (known(nearer) || mean_distance(surface, coarse, nearer) > kNearly) continue;
    const Rigid3 transform = improved(surface, fine, nearer);
    if (known(transform) || !maps_onto_itself(surface, judged, transform)) continue;
    found.push_back(transform);
    if (found.size() > kMaxRotations) return {};  // a ball
  }
  SelfSymmetry out;
  out.middle = surface.middle();
  out.axis = free_axis(surface, judged, found);
  for (const Rigid3& transform : found) {
    if (out.rotations.size() == ShapeSymmetry::kMax) break;
    const auto same = [&](const Rigid3& other) {
      return apart(transform, other, out.axis) < kSameRotation;
    };
    if (out.axis && same(Rigid3())) continue;
    // From the middle of the surface, in units of its radius, to the object's frame.
    const Eigen::Vector3d& middle = surface.middle();
    const Rigid3 in_object(transform.rotation, surface.radius() * transform.translation + middle -
                                                   transform.rotation * middle);
    if (std::any_of(out.rotations.begin(), out.rotations.end(), same)) continue;
    out.rotations.push_back(in_object);
  }
  return out;
}

}  // namespace sightline::observe
