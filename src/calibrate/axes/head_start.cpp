// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/head_start.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "calibrate/solve/target_pose.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr size_t kLeastPoses = 4;  // of the body that the rotations are found by

Eigen::Matrix3d about(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

/// Levenberg-Marquardt on the pose of a body before a camera.
BodyPose refine(const SightedBody& body, const BodySight& sight, LensModel lens,
                const LensVector& values, const Rigid3& start) {
  const std::vector<double> weights(sight.corners.size(), 1);
  BodyPose best{start, 1e9};
  SightLinearization at, next;
  if (!linearize(body, sight, weights, lens, values.data(), {}, start, true, at)) return best;
  double damping = 1e-4;
  for (int step = 0; step < 40 && damping < 1e8; ++step) {
    Matrix6 h = at.body.transpose() * at.body;
    h.diagonal() *= 1 + damping;
    const Vector6 delta = -h.ldlt().solve(at.body.transpose() * at.error);
    const Rigid3 trial = best.camera_from_body * Rigid3::exp(delta);
    if (delta.allFinite() &&
        linearize(body, sight, weights, lens, values.data(), {}, trial, true, next) &&
        next.error.squaredNorm() < at.error.squaredNorm()) {
      const bool done = next.error.squaredNorm() > (1 - 1e-10) * at.error.squaredNorm();
      best.camera_from_body = trial;
      std::swap(at, next);
      damping *= 0.1;
      if (done) break;
    } else {
      damping *= 10;
    }
  }
  best.rms_px = std::sqrt(2 * at.error.squaredNorm() / static_cast<double>(at.error.size()));
  return best;
}

/// Corners of one part of a body, as a view of its target.
std::map<size_t, TargetView> views_by_part(const SightedBody& body, const BodySight& sight) {
  std::map<size_t, TargetView> views;
  for (const TargetCorner& corner : sight.corners) {
    const auto& part = body.part(corner.id);
    TargetCorner own = corner;
    own.id -= part.first_point;
    views[static_cast<size_t>(&part - body.parts.data())].corners.push_back(own);
  }
  return views;
}

/// One setting at rest before one body.
struct Look {
  Eigen::Vector2d read;  ///< [rad]
  Rigid3 body_from_camera;
  double rms_px = 0;
};

/// R = body_from_base * pan * tilt * tilt_from_camera, of rotations.
struct Rotations {
  Eigen::Matrix3d body_from_base, tilt_from_camera;
  Eigen::Vector2d scales{1, 1};
  double error = 1e9;  ///< median [rad]
};

Eigen::Matrix3d turned(const Eigen::Vector2d& angles) {
  return about(angles[0], Eigen::Vector3d::UnitZ()) * about(angles[1], Eigen::Vector3d::UnitX());
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return u * svd.matrixV().transpose();
}

std::vector<double> rotation_errors(const Rotations& r, const std::vector<Look>& looks) {
  std::vector<double> errors;
  for (const Look& look : looks) {
    const Eigen::Matrix3d predicted =
        r.body_from_base * turned(r.scales.cwiseProduct(look.read)) * r.tilt_from_camera;
    errors.push_back(
        Eigen::AngleAxisd(predicted.transpose() * look.body_from_camera.rotation.toRotationMatrix())
            .angle());
  }
  return errors;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Shah (2013): of R_i X = Z M_i the vectors of X and Z are the first singular vectors of the sum
/// of M_i (x) R_i. Twice more without the looks that do not agree.
Rotations solve_rotations(const std::vector<Look>& looks, const Eigen::Vector2d& scales) {
  Rotations out;
  out.scales = scales;
  std::vector<char> used(looks.size(), 1);
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix<double, 9, 9> sum = Eigen::Matrix<double, 9, 9>::Zero();
    for (size_t i = 0; i < looks.size(); ++i) {
      if (!used[i]) continue;
      const Eigen::Matrix3d m = turned(scales.cwiseProduct(looks[i].read));
      const Eigen::Matrix3d r = looks[i].body_from_camera.rotation.toRotationMatrix();
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
          sum.block<3, 3>(3 * row, 3 * column) += m(row, column) * r;
        }
      }
    }
    const Eigen::JacobiSVD<Eigen::Matrix<double, 9, 9>> svd(
        sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d z = Eigen::Map<const Eigen::Matrix3d>(svd.matrixU().col(0).data());
    Eigen::Matrix3d x = Eigen::Map<const Eigen::Matrix3d>(svd.matrixV().col(0).data());
    if (z.determinant() < 0) {  // both of the other sign are as good
      z = -z;
      x = -x;
    }
    out.body_from_base = nearest_rotation(z);
    out.tilt_from_camera = nearest_rotation(x).transpose();
    const std::vector<double> errors = rotation_errors(out, looks);
    out.error = median(errors);
    for (size_t i = 0; i < looks.size(); ++i) {
      used[i] = errors[i] <= std::max(4 * out.error, 0.2 * kDegree);
    }
  }
  return out;
}

/// The same chain with z of the base on the camera's upper side and x of the tilt frame on its
/// right. Half a turn about the other axis counts an axis the other way.
void turn_upright(Rotations& r, const std::vector<Look>& looks) {
  double up = 0;
  for (const Look& look : looks) {
    const Eigen::Matrix3d base_from_camera =
        turned(r.scales.cwiseProduct(look.read)) * r.tilt_from_camera;
    up -= base_from_camera(2, 1);
  }
  const auto flip = [&](const Eigen::Vector3d& axis, int scale) {
    const Eigen::Matrix3d half = about(std::numbers::pi, axis);
    r.body_from_base = r.body_from_base * half.transpose();
    r.tilt_from_camera = half * r.tilt_from_camera;
    r.scales[scale] *= -1;
  };
  if (up < 0) flip(Eigen::Vector3d::UnitX(), 0);
  if (r.tilt_from_camera(0, 0) < 0) flip(Eigen::Vector3d::UnitZ(), 1);
}

Rotations find_rotations(const std::vector<Look>& looks, bool hold_scales) {
  const std::vector<double> sizes =
      hold_scales ? std::vector<double>{1} : std::vector<double>{1, 0.7, 1.4, 0.5, 2};
  Rotations best;
  for (const double pan : sizes) {
    for (const double tilt : sizes) {
      const Rotations r = solve_rotations(looks, {pan, tilt});
      // Readings are degrees unless something else fits clearly better.
      if (r.error < (best.error > 1e8 ? 1 : 0.6) * best.error) best = r;
    }
  }
  turn_upright(best, looks);
  return best;
}

/// Places, by linear least squares: t = t_base + R pan ((0, d, 0) + tilt t_camera).
void solve_places(const Rotations& r, const std::vector<Look>& looks, HeadModel& model,
                  Rigid3& body_from_base) {
  const std::vector<double> errors = rotation_errors(r, looks);
  std::vector<size_t> used;
  for (size_t i = 0; i < looks.size(); ++i) {
    if (errors[i] <= std::max(4 * r.error, 0.2 * kDegree)) used.push_back(i);
  }
  const auto rows = 3 * static_cast<Eigen::Index>(used.size());
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(rows, 7);
  Eigen::VectorXd b(rows);
  for (size_t k = 0; k < used.size(); ++k) {
    const Look& look = looks[used[k]];
    const Eigen::Vector2d angles = r.scales.cwiseProduct(look.read);
    const Eigen::Matrix3d pan = r.body_from_base * about(angles[0], Eigen::Vector3d::UnitZ());
    const auto row = 3 * static_cast<Eigen::Index>(k);
    a.block<3, 3>(row, 0).setIdentity();
    a.block<3, 1>(row, 3) = pan.col(1);
    a.block<3, 3>(row, 4) = pan * about(angles[1], Eigen::Vector3d::UnitX());
    b.segment<3>(row) = look.body_from_camera.translation;
  }
  const Eigen::VectorXd x = a.colPivHouseholderQr().solve(b);
  body_from_base = Rigid3(Eigen::Quaterniond(r.body_from_base), x.head<3>());
  model.link = {0, x[3]};
  model.tilt_from_camera = Rigid3(Eigen::Quaterniond(r.tilt_from_camera), x.tail<3>());
}

/// Of a body that was seen by a head that is known: the look that the others agree with most.
Rigid3 base_from_body(const HeadModel& model, const std::vector<Look>& looks) {
  std::vector<Rigid3> all;
  for (const Look& look : looks) {
    const Eigen::Vector2d angles(model.encoder[0] * look.read[0], model.encoder[1] * look.read[1]);
    all.push_back(chain_of({}, model.link, model.tilt_from_camera, angles).world_from_camera *
                  look.body_from_camera.inverse());
  }
  size_t best = 0;
  double least = 1e18;
  for (size_t i = 0; i < all.size(); ++i) {
    double sum = 0;
    for (const Rigid3& other : all) {
      sum += translation_distance(all[i], other) + rotation_angle(all[i], other);
    }
    if (sum < least) best = i;
    least = std::min(least, sum);
  }
  return all[best];
}

std::vector<std::vector<Look>> looks_by_body(const HeadProblem& problem) {
  std::vector<std::vector<Look>> looks(problem.sights->bodies.size());
  for (const HeadView& view : problem.views) {
    if (view.moving()) continue;
    for (const BodySight& sight : view.setting->sights) {
      const auto pose = body_pose(problem.sights->bodies[sight.body], sight, problem.model.lens,
                                  problem.model.lenses[view.lens]);
      if (!pose) continue;
      looks[sight.body].push_back({view.rest, pose->camera_from_body.inverse(), pose->rms_px});
    }
  }
  return looks;
}

/// Lesser range of the two axes [rad] over looks.
double lesser_range(const std::vector<Look>& looks) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const Look& look : looks) {
    low = low.cwiseMin(look.read);
    high = high.cwiseMax(look.read);
  }
  return looks.size() < kLeastPoses ? -1 : (high - low).minCoeff();
}

}  // namespace

std::optional<BodyPose> body_pose(const SightedBody& body, const BodySight& sight, LensModel lens,
                                  const LensVector& values) {
  std::optional<BodyPose> best;
  for (const auto& [part, view] : views_by_part(body, sight)) {
    if (view.corners.size() < 4) continue;
    const auto& target = body.parts[part].target;
    const auto pose = target_pose(target, Eigen::Vector2d::Zero(), lens, values, view);
    if (!pose) continue;
    const Rigid3 start = pose->camera_from_target * body.parts[part].body_from_target.inverse();
    const BodyPose refined = refine(body, sight, lens, values, start);
    if (!best || refined.rms_px < best->rms_px) best = refined;
  }
  return best && best->rms_px < 1e8 ? best : std::nullopt;
}

Status start_from_nothing(HeadProblem& problem, bool hold_scales) {
  const auto looks = looks_by_body(problem);
  size_t main = 0;
  for (size_t b = 1; b < looks.size(); ++b) {
    if (lesser_range(looks[b]) > lesser_range(looks[main])) main = b;
  }
  if (lesser_range(looks[main]) < 2 * kDegree) {
    return make_error(ErrorCode::kInvalidInput, "camera " + problem.sights->cameras[0].name,
                      "no board was seen while both axes turned: turn each of them by ten degrees "
                      "or more before the same board, at {} settings or more",
                      kLeastPoses);
  }
  const Rotations r = find_rotations(looks[main], hold_scales);
  HeadModel& model = problem.model;
  model.encoder[0] = r.scales[0];
  model.encoder[1] = r.scales[1];
  Rigid3 main_from_base;
  solve_places(r, looks[main], model, main_from_base);
  model.world_from_base = Rigid3();
  model.world_from_body.assign(looks.size(), Rigid3());
  problem.free.bodies.assign(looks.size(), 0);
  for (size_t b = 0; b < looks.size(); ++b) {
    if (looks[b].empty()) continue;  // nobody on the head sees it
    problem.free.bodies[b] = 1;
    model.world_from_body[b] =
        b == main ? main_from_base.inverse() : base_from_body(model, looks[b]);
  }
  return {};
}

LensVector start_lens(const HeadSights& sights, const std::vector<const HeadSetting*>& settings,
                      LensModel lens, const LensVector& given) {
  // The flat part that most settings show tells a focal length.
  std::map<const CalibrationTarget*, std::vector<TargetView>> by_target;
  for (const HeadSetting* setting : settings) {
    for (const BodySight& sight : setting->sights) {
      const SightedBody& body = sights.bodies[sight.body];
      for (auto& [part, view] : views_by_part(body, sight)) {
        if (view.corners.size() >= 6) by_target[&body.parts[part].target].push_back(view);
      }
    }
  }
  const std::vector<TargetView>* most = nullptr;
  const CalibrationTarget* target = nullptr;
  for (const auto& [of, views] : by_target) {
    if (most != nullptr && views.size() <= most->size()) continue;
    most = &views;
    target = of;
  }
  if (most == nullptr) return given;
  const auto rms = [&](const LensVector& values) {
    std::vector<double> all;
    for (const TargetView& view : *most) {
      const auto pose = target_pose(*target, Eigen::Vector2d::Zero(), lens, values, view);
      all.push_back(pose ? pose->rms_px : 1e3);
    }
    return median(all);
  };
  std::vector<const TargetView*> views;
  for (const TargetView& view : *most) views.push_back(&view);
  const ViewedCamera& camera = sights.cameras[0];
  const auto other = initial_lens(*target, lens, camera.width, camera.height, views);
  return other && rms(*other) < 0.7 * rms(given) ? *other : given;
}

namespace {

/// The angles at which an image in motion is seen to be taken; empty where it does not fit.
std::optional<Eigen::Vector2d> seen_angles(const HeadProblem& problem, const HeadView& view,
                                           const Eigen::Vector2d& start) {
  constexpr double kFits = 4;  // [px]
  const HeadModel& model = problem.model;
  Eigen::Vector2d angles = start;
  double rms = 1e9;
  for (int step = 0; step < 12; ++step) {
    const HeadChain chain =
        chain_of(model.world_from_base, model.link, model.tilt_from_camera, angles);
    Eigen::Matrix2d h = Eigen::Matrix2d::Zero();
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    double squares = 0, rows = 0;
    for (size_t s = 0; s < view.weights.size(); ++s) {
      const BodySight& sight = view.setting->sights[s];
      SightLinearization at;
      if (!linearize(problem.sights->bodies[sight.body], sight, view.weights[s], model.lens,
                     model.lenses[view.lens].data(), chain.world_from_camera,
                     model.world_from_body[sight.body], true, at)) {
        return std::nullopt;
      }
      const Eigen::MatrixXd j = at.place * chain.by_angles;
      h += j.transpose() * j;
      g += j.transpose() * at.error;
      squares += at.error.squaredNorm();
      rows += static_cast<double>(at.error.size());
    }
    rms = std::sqrt(squares / std::max(1.0, rows));
    const Eigen::Vector2d delta = -h.ldlt().solve(g);
    if (!delta.allFinite() || delta.norm() > 1) return std::nullopt;
    angles += delta;
    if (delta.norm() < 1e-8) break;
  }
  return rms < kFits ? std::optional(angles) : std::nullopt;
}

}  // namespace

std::optional<double> start_latency(const HeadProblem& problem, LatencyCurve& curve) {
  constexpr double kFrom = -0.1, kStep = 0.005, kMostError = 3 * kDegree;
  constexpr size_t kLeastImages = 8;
  std::vector<std::pair<const HeadView*, Eigen::Vector2d>> seen;
  for (const HeadView& view : problem.views) {
    if (!view.moving() || !view.used) continue;
    const Readings& readings = view.times->readings;
    const auto near = readings.at(view.setting->from_s + problem.model.encoder[kEncoderLatency]);
    if (!near || !readings.at(view.setting->from_s + kFrom) ||
        !readings.at(view.setting->from_s + kMostLatency)) {
      continue;
    }
    const Eigen::Vector2d start(problem.model.encoder[0] * near->angles[0],
                                problem.model.encoder[1] * near->angles[1]);
    const auto angles = seen_angles(problem, view, start);
    if (angles) seen.emplace_back(&view, *angles);
  }
  curve = {};
  if (seen.size() < kLeastImages) return std::nullopt;
  size_t best = 0;
  for (double latency = kFrom; latency <= kMostLatency + 1e-9; latency += kStep) {
    double squares = 0;
    for (const auto& [view, angles] : seen) {
      EncoderVector encoder = problem.model.encoder;
      encoder[kEncoderLatency] = latency;
      Eigen::Vector2d read;
      if (!angles_of(*view, encoder, read, nullptr)) read = angles.array() + 1;
      squares += std::min((angles - read).squaredNorm(), kMostError * kMostError);
    }
    curve.latency_s.push_back(latency);
    curve.rms_deg.push_back(std::sqrt(squares / static_cast<double>(seen.size())) / kDegree);
    if (curve.rms_deg.back() < curve.rms_deg[best]) best = curve.rms_deg.size() - 1;
  }
  return curve.latency_s[best];
}

}  // namespace sightline::calibrate
