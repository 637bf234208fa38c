// SPDX-License-Identifier: Apache-2.0
#include "calibrate/watch/turn_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "sightline/geometry/rigid3.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kAgrees = 1.0;       // [px]
constexpr double kLeastSigma = 0.06;  // of a place in the full-size image [px]
constexpr double kTukey = 4.7;        // sigmas
constexpr size_t kDraws = 160;
constexpr int kFewest = 8;
constexpr double kGoldenShare = 0.6180339887;

using Vector4 = Eigen::Vector4d;
using Matrix4 = Eigen::Matrix4d;

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + skew(v);
  return Eigen::AngleAxisd(angle, v / angle).toRotationMatrix();
}

// Parameters: turn, logarithm of the zoom.
struct Pose {
  explicit Pose(const Vector4& p) : rotation(rotation_of(-p.head<3>())), zoom(std::exp(p[3])) {}
  Eigen::Matrix3d rotation;
  double zoom;
};

class Fitter {
 public:
  Fitter(const CameraModel& lens, std::span<const ScenePair> pairs, bool with_zoom)
      : lens_(lens),
        center_(lens.parameters().cx, lens.parameters().cy),
        pairs_(pairs),
        with_zoom_(with_zoom) {}

  std::optional<Eigen::Vector2d> residual(const ScenePair& pair, const Pose& pose,
                                          Eigen::Matrix<double, 2, 4>* jacobian = nullptr) const {
    const Eigen::Vector3d now = pose.rotation * pair.ray;
    Eigen::Matrix<double, 2, 3> by_point;
    const auto seen = lens_.project(now, jacobian != nullptr ? &by_point : nullptr);
    if (!seen) return std::nullopt;
    const double zoom = pose.zoom;
    const Eigen::Vector2d from_center = *seen - center_;
    if (jacobian != nullptr) {
      jacobian->leftCols<3>() = zoom * by_point * skew(now);
      jacobian->col(3) = with_zoom_ ? Eigen::Vector2d(zoom * from_center) : Eigen::Vector2d::Zero();
    }
    return pair.pixel - (center_ + zoom * from_center);
  }

  // One step of least squares. False: not determined.
  template <typename Weight>
  bool step(std::span<const size_t> of, const Weight& weight, Vector4& p, Matrix4& normal) const {
    normal.setZero();
    Vector4 right = Vector4::Zero();
    Eigen::Matrix<double, 2, 4> jacobian;
    const Pose pose(p);
    for (const size_t i : of) {
      const auto r = residual(pairs_[i], pose, &jacobian);
      if (!r) continue;
      const double w = weight(r->norm());
      normal += w * jacobian.transpose() * jacobian;
      right += w * jacobian.transpose() * *r;
    }
    // Of the size of the others, which grow with the focal length squared.
    if (!with_zoom_) normal(3, 3) = normal.topLeftCorner<3, 3>().trace();
    const Eigen::LDLT<Matrix4> solver(normal);
    if (solver.info() != Eigen::Success || solver.rcond() < 1e-9) return false;
    p += solver.solve(right);
    return p.allFinite() && p.head<3>().norm() < 1 && std::abs(p[3]) < 0.5;
  }

  int count(const Vector4& p, double tolerance) const {
    int n = 0;
    const Pose pose(p);
    for (const ScenePair& pair : pairs_) {
      const auto r = residual(pair, pose);
      n += r && r->norm() < tolerance ? 1 : 0;
    }
    return n;
  }

  // Median length of a residual over that of a normal distribution.
  double spread(const Vector4& p, double beyond) const {
    std::vector<double> lengths;
    const Pose pose(p);
    for (const ScenePair& pair : pairs_) {
      const auto r = residual(pair, pose);
      if (r && r->norm() < beyond) lengths.push_back(r->norm());
    }
    if (lengths.empty()) return kLeastSigma;
    const auto middle = lengths.begin() + static_cast<ptrdiff_t>(lengths.size() / 2);
    std::nth_element(lengths.begin(), middle, lengths.end());
    return std::max(kLeastSigma, *middle / 1.1774);
  }

 private:
  const CameraModel& lens_;
  Eigen::Vector2d center_;
  std::span<const ScenePair> pairs_;
  bool with_zoom_;
};

// The start that most pairs agree with.
Vector4 find_start(const Fitter& fitter, size_t pairs, const Eigen::Vector3d& guess) {
  Vector4 best = Vector4::Zero();
  int most = fitter.count(best, kAgrees);
  const auto consider = [&](const Vector4& p) {
    const int n = fitter.count(p, kAgrees);
    if (n <= most) return;
    most = n;
    best = p;
  };
  Vector4 guessed = Vector4::Zero();
  guessed.head<3>() = guess;
  consider(guessed);
  Matrix4 normal;
  for (size_t draw = 0; draw < kDraws && static_cast<size_t>(most) < pairs; ++draw) {
    // Two pairs, drawn evenly without chance.
    const double along = std::fmod(static_cast<double>(draw + 1) * kGoldenShare, 1.0);
    const size_t a = draw % pairs;
    const size_t b = (a + 1 + static_cast<size_t>(along * static_cast<double>(pairs - 1))) % pairs;
    const std::array<size_t, 2> two{a, b};
    Vector4 p = Vector4::Zero();
    const auto even = [](double) { return 1.0; };
    if (fitter.step(two, even, p, normal) && fitter.step(two, even, p, normal)) consider(p);
  }
  return best;
}

}  // namespace

std::optional<TurnFit> fit_turn(const CameraModel& lens, std::span<const ScenePair> pairs,
                                const Eigen::Vector3d& guess, bool with_zoom) {
  if (pairs.size() < static_cast<size_t>(kFewest)) return std::nullopt;
  const Fitter fitter(lens, pairs, with_zoom);
  Vector4 p = find_start(fitter, pairs.size(), guess);
  std::vector<size_t> all(pairs.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = i;
  Matrix4 normal;
  double sigma = kAgrees / 2;
  for (int i = 0; i < 8; ++i) {
    const double cut = kTukey * sigma;
    const auto tukey = [cut](double r) {
      const double u = r / cut;
      return u < 1 ? (1 - u * u) * (1 - u * u) : 0;
    };
    if (!fitter.step(all, tukey, p, normal)) return std::nullopt;
    sigma = std::min(fitter.spread(p, 2 * kAgrees), kAgrees / 2);
  }
  TurnFit fit;
  fit.turn = p.head<3>();
  fit.zoom = std::exp(p[3]);
  fit.sigma_px = sigma;
  fit.is_inlier.resize(pairs.size());
  const Pose pose(p);
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto r = fitter.residual(pairs[i], pose);
    fit.is_inlier[i] = r && r->norm() < std::min(kAgrees, 3.5 * sigma) ? 1 : 0;
    fit.inliers += fit.is_inlier[i];
  }
  if (fit.inliers < kFewest) return std::nullopt;
  fit.covariance = sigma * sigma * normal.ldlt().solve(Matrix4::Identity()).topLeftCorner<3, 3>();
  return fit;
}

}  // namespace sightline::calibrate
