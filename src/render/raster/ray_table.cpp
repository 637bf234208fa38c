// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/ray_table.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sightline {
namespace {

/// Fisheye rays at 89 degrees and more from the axis are left out: x/z grows without bound there.
constexpr double kWidestAngle = 89.0 * std::numbers::pi / 180.0;
constexpr float kNoRay = std::numeric_limits<float>::quiet_NaN();
constexpr int kCurvatureCells = 256;

using Matrix23 = Eigen::Matrix<double, 2, 3>;

double fold_radius(const CameraModel& model) {
  if (model.parameters().lens != LensModel::kFisheye) return model.max_valid_radius();
  return std::tan(std::min(model.max_valid_radius(), kWidestAngle));
}

/// Tables over the radius are laid out over 1 - cos(angle to the axis): smooth at the axis, where
/// lenses are polynomials of r^2, and at the rim of a fisheye, where r grows without bound.
double radius_of_share(double s) { return std::sqrt(s * (2 - s)) / (1 - s); }
double share_of_radius(double r) { return 1 - 1 / std::sqrt(1 + r * r); }

/// One row or column walked outward from a start ray: each pixel is solved from the extrapolation
/// of those before it, a parabola through three. It is close enough for a single Newton step almost
/// everywhere; a straight line through two needs a second one.
class RayWalk {
 public:
  RayWalk(const RayTable& table, double fold) : table_(table), fold_(fold) {}

  void restart(const std::optional<Eigen::Vector2d>& ray) {
    known_ = ray ? 1 : 0;
    if (ray) last_ = *ray;
    ended_ = !ray;
  }
  /// Ray of the next pixel; once a pixel has none, neither have those further out.
  std::optional<Eigen::Vector2d> next(double px, double py) {
    if (ended_) return std::nullopt;
    auto ray = table_.solve_ray(px, py, extrapolated());
    if (!ray) ray = from_model(px, py);
    if (!ray) {
      ended_ = true;
      return std::nullopt;
    }
    third_ = second_;
    second_ = last_;
    last_ = *ray;
    known_ = std::min(known_ + 1, 3);
    return ray;
  }
  std::optional<Eigen::Vector2d> from_model(double px, double py) const {
    const auto ray = table_.model().unproject({px, py});
    if (!ray || !(ray->z() > 0)) return std::nullopt;
    const Eigen::Vector2d m = ray->head<2>() / ray->z();
    if (!(m.norm() <= fold_)) return std::nullopt;
    return m;
  }

 private:
  Eigen::Vector2d extrapolated() const {
    if (known_ > 2) return 3 * (last_ - second_) + third_;
    if (known_ > 1) return 2 * last_ - second_;
    return last_;
  }

  const RayTable& table_;
  double fold_;
  Eigen::Vector2d last_ = Eigen::Vector2d::Zero();  ///< the newest, the one before it, ...
  Eigen::Vector2d second_ = Eigen::Vector2d::Zero(), third_ = Eigen::Vector2d::Zero();
  int known_ = 0;  ///< so many of them
  bool ended_ = false;
};

}  // namespace

std::shared_ptr<const RayTable> RayTable::build(const CameraModel& model) {
  return std::shared_ptr<const RayTable>(new RayTable(model));
}

RayTable::RayTable(const CameraModel& model) : model_(model) {
  stride_ = (static_cast<size_t>(even_width()) + 16 + 15) / 16 * 16;
  const size_t size = stride_ * static_cast<size_t>(even_height());
  x_.assign(size, kNoRay);
  y_.assign(size, kNoRay);
  project_limit_ = fold_radius(model_);
  fill_rays();
  fill_blocks();
  project_limit_ = std::min(project_limit_, 1.15 * max_ray_radius_ + 0.1);
  fill_lookup();
  fill_curvature();
}

/// Rows outward from the principal point's, pixels outward from its column: the region with rays is
/// the image of a disc around it, so each walk meets its border once.
void RayTable::fill_rays() {
  const CameraModel::Parameters& p = model_.parameters();
  const int x0 = std::clamp(static_cast<int>(p.cx), 0, p.width - 1);
  const int y0 = std::clamp(static_cast<int>(p.cy), 0, p.height - 1);
  RayWalk column(*this, project_limit_);
  RayWalk row(*this, project_limit_);
  const auto center = column.from_model(x0, y0);
  const auto fill_row = [&](int y, const std::optional<Eigen::Vector2d>& start) {
    float* const x_out = x_.data() + static_cast<size_t>(y) * stride_;
    float* const y_out = y_.data() + static_cast<size_t>(y) * stride_;
    const auto put = [&](int x, const Eigen::Vector2d& ray) {
      x_out[x] = static_cast<float>(ray.x());
      y_out[x] = static_cast<float>(ray.y());
    };
    if (!start) return;
    put(x0, *start);
    for (const int step : {1, -1}) {
      row.restart(start);
      for (int x = x0 + step; x >= 0 && x < p.width; x += step) {
        const auto ray = row.next(x, y);
        if (!ray) break;
        put(x, *ray);
      }
    }
  };
  fill_row(y0, center);
  for (const int step : {1, -1}) {
    column.restart(center);
    for (int y = y0 + step; y >= 0 && y < p.height; y += step) fill_row(y, column.next(x0, y));
  }
}

void RayTable::fill_blocks() {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  block_columns_ = (even_width() + kBlock - 1) / kBlock;
  block_rows_ = (even_height() + kBlock - 1) / kBlock;
  blocks_.assign(static_cast<size_t>(block_columns_) * static_cast<size_t>(block_rows_),
                 {kInf, -kInf, kInf, -kInf});
  frame_bounds_ = {kInf, -kInf, kInf, -kInf};
  double largest = 0;
  for (int y = 0; y < height(); ++y) {
    for (int x = 0; x < width(); ++x) {
      const float rx = x_row(y)[x];
      const float ry = y_row(y)[x];
      if (!(rx == rx)) continue;
      for (RayBounds* b : {&blocks_[static_cast<size_t>(y / kBlock * block_columns_ + x / kBlock)],
                           &frame_bounds_}) {
        *b = {std::min(b->min_x, rx), std::max(b->max_x, rx), std::min(b->min_y, ry),
              std::max(b->max_y, ry)};
      }
      largest = std::max(largest, double{rx} * rx + double{ry} * ry);
    }
  }
  max_ray_radius_ = std::sqrt(largest);
}

std::optional<Eigen::Vector2d> RayTable::solve_ray(double px, double py,
                                                   const Eigen::Vector2d& start) const {
  Eigen::Vector2d m = start;
  for (int i = 0; i < 20; ++i) {
    Matrix23 j;
    const auto pixel = model_.project({m.x(), m.y(), 1}, &j);
    if (!pixel) return std::nullopt;
    const double determinant = j(0, 0) * j(1, 1) - j(0, 1) * j(1, 0);
    if (!(determinant > 0)) return std::nullopt;
    const double ex = px - pixel->x();
    const double ey = py - pixel->y();
    const Eigen::Vector2d step((j(1, 1) * ex - j(0, 1) * ey) / determinant,
                               (j(0, 0) * ey - j(1, 0) * ex) / determinant);
    m += step;
    // Newton's error after a step is about the square of the step: 1e-5 px leaves nothing to gain.
    if (ex * ex + ey * ey < 1e-10) {
      if (!(m.norm() <= project_limit_)) return std::nullopt;
      return m;
    }
  }
  return std::nullopt;
}

std::optional<Eigen::Vector2d> RayTable::exact_ray(int px, int py) const {
  const Eigen::Vector2d start(x_row(py)[px], y_row(py)[px]);
  if (!start.allFinite()) return std::nullopt;
  return solve_ray(px, py, start);
}

std::optional<Eigen::Vector2d> RayTable::project(const Eigen::Vector2d& ray) const {
  if (!(ray.squaredNorm() <= project_limit_ * project_limit_)) return std::nullopt;
  return model_.project({ray.x(), ray.y(), 1});
}

void RayTable::fill_lookup() {
  const CameraModel::Parameters& p = model_.parameters();
  const bool tangential = p.lens != LensModel::kFisheye;
  const double p1 = tangential ? p.distortion[2] : 0;
  const double p2 = tangential ? p.distortion[3] : 0;
  const double s_limit = share_of_radius(project_limit_);
  const auto factor = [&](double s) {
    const double r = std::min(radius_of_share(s), project_limit_);
    if (r < 1e-7) return 1.0;
    const auto pixel = model_.project({r, 0, 1});
    return pixel ? ((pixel->x() - p.cx) / p.fx - 3 * p2 * r * r) / r : 0.0;
  };
  constexpr int kCells = RadialLookup::kCells;
  lookup_.value.resize(kCells + 1);
  lookup_.step.assign(kCells + 1, 0.0f);
  for (int i = 0; i <= kCells; ++i) {
    lookup_.value[static_cast<size_t>(i)] = static_cast<float>(factor(s_limit * i / kCells));
  }
  double error = 0;
  for (size_t i = 0; i < kCells; ++i) {
    lookup_.step[i] = lookup_.value[i + 1] - lookup_.value[i];
    for (const double t : {0.25, 0.5, 0.75}) {
      const double s = s_limit * (static_cast<double>(i) + t) / kCells;
      const double line = lookup_.value[i] + t * lookup_.step[i];
      error = std::max(error, std::abs(line - factor(s)) * radius_of_share(s));
    }
  }
  lookup_.scale = static_cast<float>(kCells / s_limit);
  // Twice what the samples show, and the rounding of float pixels.
  lookup_.error_px = static_cast<float>(2 * error * std::max(p.fx, p.fy) +
                                        1e-6 * (std::max(p.width, p.height) + p.fx + p.fy));
  lookup_.p1 = static_cast<float>(p1);
  lookup_.p2 = static_cast<float>(p2);
  lookup_.fx = static_cast<float>(p.fx);
  lookup_.fy = static_cast<float>(p.fy);
  lookup_.cx = static_cast<float>(p.cx);
  lookup_.cy = static_cast<float>(p.cy);
}

/// Second derivatives by differences of the Jacobian, at several azimuths of each cell's border.
/// In the radial direction r and the tangential t, the second derivative along any unit direction
/// is at most max(|F_rr|, |F_tt|) + |F_rt|.
void RayTable::fill_curvature() {
  const double s_limit = share_of_radius(project_limit_);
  const auto jacobian = [&](const Eigen::Vector2d& m, Eigen::Matrix2d& out) {
    Matrix23 j;
    if (!model_.project({m.x(), m.y(), 1}, &j)) return false;
    out = j.leftCols<2>();
    return true;
  };
  const auto bound_at = [&](double r, double azimuth) {
    const Eigen::Vector2d er(std::cos(azimuth), std::sin(azimuth));
    const Eigen::Vector2d et(-er.y(), er.x());
    const double h = 1e-4 * (1 + r);
    const Eigen::Vector2d m = std::max(0.0, std::min(r, project_limit_ - 2 * h)) * er;
    Eigen::Matrix2d a, b, c, d;
    if (!jacobian(m - h * er, a) || !jacobian(m + h * er, b) || !jacobian(m - h * et, c) ||
        !jacobian(m + h * et, d))
      return 0.0;
    const Eigen::Matrix2d along = (b - a) / (2 * h);
    const Eigen::Matrix2d across = (d - c) / (2 * h);
    return std::max((along * er).norm(), (across * et).norm()) + (along * et).norm();
  };
  std::vector<double> at(kCurvatureCells + 1, 0.0);
  for (int i = 0; i <= kCurvatureCells; ++i) {
    const double r = radius_of_share(s_limit * i / kCurvatureCells);
    for (int k = 0; k < 8; ++k) {
      at[static_cast<size_t>(i)] =
          std::max(at[static_cast<size_t>(i)], bound_at(r, k * std::numbers::pi / 4 + 0.1));
    }
  }
  curvature_to_.assign(kCurvatureCells + 1, 0.0);
  curvature_from_.assign(kCurvatureCells + 1, 0.0);
  for (size_t i = 0; i <= kCurvatureCells; ++i) {
    // A cell answers for both its borders, with room for what lies between the samples.
    const double cell = 1.3 * std::max(at[i], at[std::min<size_t>(i + 1, kCurvatureCells)]);
    curvature_to_[i] = std::max(cell, i > 0 ? curvature_to_[i - 1] : 0.0);
    curvature_from_[i] = cell;
  }
  for (size_t i = kCurvatureCells; i-- > 0;)
    curvature_from_[i] = std::max(curvature_from_[i], curvature_from_[i + 1]);
}

double RayTable::curvature_bound(double min_radius, double max_radius) const {
  const double cells_per_s = kCurvatureCells / share_of_radius(project_limit_);
  const auto cell = [&](double r) {
    const double i = share_of_radius(std::clamp(r, 0.0, project_limit_)) * cells_per_s;
    return static_cast<size_t>(std::clamp(i, 0.0, static_cast<double>(kCurvatureCells)));
  };
  return std::min(curvature_to_[cell(max_radius)], curvature_from_[cell(min_radius)]);
}

}  // namespace sightline
