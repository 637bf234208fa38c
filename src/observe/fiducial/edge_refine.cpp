// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/edge_refine.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr int kRounds = 4;
constexpr int kMaxSamples = 48;          // per edge
constexpr double kStep = 0.25;           // along the profile [px]
constexpr double kDifference = 0.5;      // half of the gradient's baseline [px]
constexpr double kCornerModules = 0.75;  // left out at both ends of an edge
constexpr double kMinContrast = 4;       // light across the edge, of kRefineWhite
constexpr double kMinSeen = 0.5;         // share of an edge's points that must be found

/// A straight line in normalized image coordinates: normal . p = offset, |normal| = 1.
struct Line {
  Eigen::Vector2d normal;
  double offset = 0;
};

/// An image read as light.
struct Image {
  const PlaneView& gray;
  const LightTable& light;
};

double bilinear(const Image& image, double x, double y) {
  const int ix = static_cast<int>(x);
  const int iy = static_cast<int>(y);
  const double fx = x - ix;
  const double fy = y - iy;
  const uint8_t* top = image.gray.row(iy) + ix;
  const uint8_t* bottom = top + image.gray.stride;
  const LightTable& light = image.light;
  return (1 - fy) * ((1 - fx) * light[top[0]] + fx * light[top[1]]) +
         fy * ((1 - fx) * light[bottom[0]] + fx * light[bottom[1]]);
}

std::optional<Eigen::Vector2d> normalized(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  const auto ray = camera.unproject(pixel);
  if (!ray || ray->z() < 0.05) return std::nullopt;
  return Eigen::Vector2d(ray->head<2>() / ray->z());
}

/// Where along `normal` (unit, towards the bright side) the edge at `pixel` lies: the centroid of
/// the rising gradient within +-reach. Empty where the contrast is weak or the image ends.
std::optional<double> edge_offset(const Image& image, const Eigen::Vector2d& pixel,
                                  const Eigen::Vector2d& normal, double reach) {
  const double far = reach + kDifference;
  for (double s : {-far, far}) {
    const Eigen::Vector2d end = pixel + s * normal;
    if (end.x() < 0 || end.y() < 0 || end.x() >= image.gray.width - 1 ||
        end.y() >= image.gray.height - 1) {
      return std::nullopt;
    }
  }
  const auto at = [&](double s) {
    return bilinear(image, pixel.x() + s * normal.x(), pixel.y() + s * normal.y());
  };
  if (at(reach) - at(-reach) < kMinContrast) return std::nullopt;
  const int steps = static_cast<int>(reach / kStep);
  double sum = 0;
  double moment = 0;
  for (int i = -steps; i <= steps; ++i) {
    const double s = i * kStep;
    const double gradient = at(s + kDifference) - at(s - kDifference);
    if (gradient <= 0) continue;
    sum += gradient;
    moment += gradient * s;
  }
  if (sum <= 0) return std::nullopt;
  return moment / sum;
}

/// Total least squares through points, twice: the second time without those far off the first line.
struct LineFit {
  Line line;
  double scatter = 0;  ///< rms distance of the points kept
  int kept = 0;
};
LineFit fit_once(const Eigen::Vector2d* points, int count, const Line* near, double limit) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  LineFit fit;
  const auto kept = [&](const Eigen::Vector2d& p) {
    return near == nullptr || std::abs(near->normal.dot(p) - near->offset) <= limit;
  };
  for (int i = 0; i < count; ++i) {
    if (!kept(points[i])) continue;
    mean += points[i];
    ++fit.kept;
  }
  if (fit.kept < 3) return fit;
  mean /= fit.kept;
  for (int i = 0; i < count; ++i) {
    if (!kept(points[i])) continue;
    const Eigen::Vector2d d = points[i] - mean;
    moments.noalias() += d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
  eigen.computeDirect(moments);
  fit.line.normal = eigen.eigenvectors().col(0);
  fit.line.offset = fit.line.normal.dot(mean);
  fit.scatter = std::sqrt(std::max(0.0, eigen.eigenvalues()[0]) / fit.kept);
  return fit;
}

LineFit fit_line(const Eigen::Vector2d* points, int count) {
  const LineFit first = fit_once(points, count, nullptr, 0);
  if (first.kept < 3) return first;
  return fit_once(points, count, &first.line, 2.0 * first.scatter + 1e-9);
}

std::optional<Eigen::Vector2d> intersection(const Line& a, const Line& b) {
  const double det = a.normal.x() * b.normal.y() - a.normal.y() * b.normal.x();
  if (std::abs(det) < 0.05) return std::nullopt;
  return Eigen::Vector2d((a.offset * b.normal.y() - b.offset * a.normal.y()) / det,
                         (b.offset * a.normal.x() - a.offset * b.normal.x()) / det);
}

/// One edge from corner to corner (normalized coordinates).
struct EdgeMeasurement {
  LineFit fit;
  int tried = 0;
};
EdgeMeasurement measure_edge(const Image& image, const CameraModel& camera,
                             const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                             const SquareDetector::Border& border, double reach) {
  EdgeMeasurement out;
  const auto pixel_of = [&](double t) {
    const Eigen::Vector2d p = from + t * (to - from);
    return camera.project({p.x(), p.y(), 1.0});
  };
  const auto a = pixel_of(0);
  const auto b = pixel_of(1);
  if (!a || !b) return out;
  const double length = (*b - *a).norm();
  const Eigen::Vector2d along = (*b - *a) / length;
  // Corners run clockwise as seen in the image (y down): the outside is on the left of the walk.
  const Eigen::Vector2d outward(along.y(), -along.x());
  const Eigen::Vector2d bright = border.bright_inside ? Eigen::Vector2d(-outward) : outward;

  const double margin = std::min(0.3, kCornerModules / border.modules);
  const int samples = std::clamp(static_cast<int>(length * (1 - 2 * margin)), 5, kMaxSamples);
  std::array<Eigen::Vector2d, kMaxSamples> points;
  int found = 0;
  for (int i = 0; i < samples; ++i) {
    const double t = margin + (1 - 2 * margin) * i / (samples - 1);
    const auto pixel = pixel_of(t);
    if (!pixel) continue;
    const auto offset = edge_offset(image, *pixel, bright, reach);
    if (!offset) continue;
    const auto point = normalized(camera, *pixel + *offset * bright);
    if (point) points[static_cast<size_t>(found++)] = *point;
  }
  out.tried = samples;
  out.fit = fit_line(points.data(), found);
  return out;
}

}  // namespace

std::optional<RefinedSquare> refine_square(const PlaneView& gray, const LightTable& light,
                                           const CameraModel& camera,
                                           const std::array<Eigen::Vector2d, 4>& corners,
                                           const SquareDetector::Border& border) {
  std::array<Eigen::Vector2d, 4> now;
  std::array<double, 4> length;
  for (size_t k = 0; k < 4; ++k) {
    const auto point = normalized(camera, corners[k]);
    if (!point) return std::nullopt;
    now[k] = *point;
    length[k] = (corners[(k + 1) % 4] - corners[k]).norm();
  }
  RefinedSquare out;
  out.corners = corners;
  for (int round = 0; round < kRounds; ++round) {
    std::array<Line, 4> lines;
    double variance = 0;
    for (size_t k = 0; k < 4; ++k) {
      // A module across this edge is as wide as the neighboring edges are long.
      const double across = std::min(length[(k + 1) % 4], length[(k + 3) % 4]) / border.modules;
      const double reach = std::clamp(0.5 * across, 1.0, round == 0 ? 4.0 : 2.5);
      const EdgeMeasurement edge =
          measure_edge({gray, light}, camera, now[k], now[(k + 1) % 4], border, reach);
      if (edge.fit.kept < 3 || edge.fit.kept < kMinSeen * edge.tried) return std::nullopt;
      lines[k] = edge.fit.line;
      // At its end a fitted line is twice as uncertain as a mean of its points; and neighboring
      // points share pixels, so that only about half of them count. The mean over four edges.
      variance += edge.fit.scatter * edge.fit.scatter * (4.0 * 2.0 / 4.0) / edge.fit.kept;
    }
    double moved = 0;
    for (size_t k = 0; k < 4; ++k) {
      const auto corner = intersection(lines[(k + 3) % 4], lines[k]);
      if (!corner) return std::nullopt;
      const auto pixel = camera.project({corner->x(), corner->y(), 1.0});
      if (!pixel) return std::nullopt;
      moved = std::max(moved, (*pixel - out.corners[k]).norm());
      now[k] = *corner;
      out.corners[k] = *pixel;
    }
    out.scatter_px = std::sqrt(variance) * camera.parameters().fx;
    if (moved < 0.01) break;
  }
  for (size_t k = 0; k < 4; ++k) {
    if ((out.corners[k] - corners[k]).norm() > std::max(3.0, 0.15 * length[k])) return std::nullopt;
  }
  return out;
}

}  // namespace sightline::observe
