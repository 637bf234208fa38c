// SPDX-License-Identifier: Apache-2.0
#include "synthetic_head.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline::test {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kRest = 0.8, kMove = 0.5;             // [s]
constexpr double kFrameRate = 20, kReadingRate = 100;  // [1/s]
constexpr double kFine = 0.001;                        // [s], of the axis' play

Rigid3 turn(double angle, const Eigen::Vector3d& axis) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), Eigen::Vector3d::Zero()};
}

Rigid3 shifted(double x, double y, double z) {
  return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, y, z)};
}

CalibrationTarget board() {
  CalibrationTarget target;
  target.name = "board";
  target.kind = TargetKind::kCharuco;
  target.columns = 8;
  target.rows = 6;
  target.square = 0.05;
  target.marker = 0.037;
  target.dictionary = "5X5_100";
  return target;
}

CameraModel lens(double focal) {
  CameraModel::Parameters p;
  p.width = 1280;
  p.height = 720;
  p.fx = p.fy = focal;
  p.cx = 641.3;
  p.cy = 357.8;
  p.distortion = {-0.12, 0.05, 0.0004, -0.0003, 0};
  return *CameraModel::create(p, "test");
}

CameraAxes random_axes(const SyntheticHeadOptions& o, Random& random) {
  const auto tilted = [&](double degrees) {
    return Rigid3::exp((Vector6() << degrees * kDegree * random.normal<3>(), 0, 0, 0).finished());
  };
  CameraAxes axes;
  axes.world_from_base = shifted(random.uniform(-1, 1), random.uniform(-1, 1), 1.2) *
                         turn(random.uniform(-3, 3), Eigen::Vector3d::UnitZ()) * tilted(1.5);
  axes.pan_from_tilt = shifted(0.004, 0.012 * random.normal(), 0.06) * tilted(0.5);
  // The camera: x right, y down, z ahead, in x right, y ahead, z up.
  axes.tilt_from_camera = shifted(0.01 * random.normal(), 0.04, 0.015) *
                          turn(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()) * tilted(2);
  axes.pan_scale = o.pan_scale;
  axes.tilt_scale = o.tilt_scale;
  axes.latency_s = o.latency_s;
  axes.backlash = o.play_deg * kDegree;
  return axes;
}

std::vector<TargetCorner> see(const CameraModel& model, const Rigid3& world_from_camera,
                              const Rigid3& world_from_body, const CalibrationTarget& target,
                              double noise_px, Random& random) {
  const Rigid3 camera_from_body = world_from_camera.inverse() * world_from_body;
  std::vector<TargetCorner> out;
  for (int id = 0; id < target.corner_count(); ++id) {
    const Eigen::Vector2d p = target.corner(id);
    const auto pixel = model.project(camera_from_body * Eigen::Vector3d(p.x(), p.y(), 0));
    const Eigen::Vector2d noise = noise_px * random.normal<2>();
    if (!pixel || !model.contains(*pixel + noise)) continue;
    out.push_back({id, *pixel + noise, Eigen::Vector2d::Zero()});
  }
  return out;
}

double focal_at(double zoom) { return 900 * zoom_factor(zoom); }

HeadRecording record(const SyntheticHeadOptions& o, SyntheticHead& head, size_t body,
                     Random& random) {
  const HeadWay way(o, random);
  const auto angles = way.with_play(o.play_deg * kDegree);
  HeadRecording out;
  out.name = "recording " + std::to_string(body + 1);
  out.readings = read_head(o, way, random);
  const CalibrationTarget target = board();
  for (double t = 0.003; t < way.end(); t += 1 / kFrameRate) {
    for (size_t camera = 0; camera < head.truth.size(); ++camera) {
      const CalibratedCamera& c = head.truth[camera];
      const Eigen::Vector2d& at = angles[static_cast<size_t>(t / kFine + 0.5)];
      const Rigid3 place =
          camera == 0 ? c.axes->world_from_camera(at[0], at[1]) : c.world_from_camera;
      HeadImage image;
      image.camera = camera;
      image.capture = kHeadStart + from_seconds(t);
      const CameraModel model =
          camera == 0 && !o.zooms.empty() ? lens(focal_at(way.zoom(t))) : c.model;
      auto corners = see(model, place, head.world_from_body[body], target, o.noise_px, random);
      if (corners.empty()) continue;
      image.sights.push_back({body, std::move(corners)});
      out.images.push_back(std::move(image));
    }
  }
  return out;
}

}  // namespace

HeadWay::HeadWay(const SyntheticHeadOptions& o, Random& random) : moving_(o.moving_s) {
  const size_t zooms = std::max<size_t>(1, o.zooms.size());
  for (size_t i = 0; i < o.settings * zooms; ++i) {
    places_.emplace_back(random.uniform(-1, 1) * o.pan_range_deg * kDegree,
                         random.uniform(-1, 1) * o.tilt_range_deg * kDegree);
    zoom_.push_back(o.zooms.empty() ? 0 : o.zooms[i / o.settings]);
  }
  swing_ = Eigen::Vector2d(0.8 * o.pan_range_deg, 0.8 * o.tilt_range_deg) * kDegree;
}

double HeadWay::rests() const { return static_cast<double>(places_.size()) * (kRest + kMove); }

double HeadWay::end() const { return rests() + (moving_ > 0 ? moving_ + kMove : 0); }

Eigen::Vector2d HeadWay::at(double t) const {
  if (t <= 0) return places_[0];
  const auto i = static_cast<size_t>(t / (kRest + kMove));
  const double since = t - (rests() - kMove);  // it turns to and fro
  if (moving_ > 0 && since >= 0) {
    const double ramp = std::min(1.0, since / kMove);
    const Eigen::Vector2d swing(swing_[0] * std::sin(2.3 * since),
                                swing_[1] * std::sin(3.1 * since));
    return places_.back() + ramp * ramp * (3 - 2 * ramp) * (swing - places_.back());
  }
  if (i + 1 >= places_.size()) return places_.back();
  const double within = t - static_cast<double>(i) * (kRest + kMove);
  const double s = std::max(0.0, within - kRest) / kMove;
  return places_[i] + s * s * (3 - 2 * s) * (places_[i + 1] - places_[i]);
}

double HeadWay::zoom(double t) const {
  const auto i = static_cast<size_t>(std::max(0.0, t + kMove / 2) / (kRest + kMove));
  return zoom_[std::min(i, zoom_.size() - 1)];
}

std::vector<Eigen::Vector2d> HeadWay::with_play(double play) const {
  std::vector<Eigen::Vector2d> out{at(0)};
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(play / 2);
  for (double t = kFine; t < end() + 1; t += kFine) {
    const Eigen::Vector2d motor = at(t);
    out.push_back(out.back().cwiseMax(motor - half).cwiseMin(motor + half));
  }
  return out;
}

std::vector<AxisReading> read_head(const SyntheticHeadOptions& o, const HeadWay& way,
                                   Random& random) {
  std::vector<AxisReading> out;
  for (double t = -1; t < way.end() + 1; t += 1 / kReadingRate) {
    const Eigen::Vector2d motor = way.at(t - o.latency_s);
    AxisReading r;
    r.stamp = kHeadStart + from_seconds(t);
    const auto said = [&](double angle) {
      angle += o.noise_deg * kDegree * random.normal();
      const double step = o.step_deg * kDegree;
      return step > 0 ? std::round(angle / step) * step : angle;
    };
    r.pan = said(motor[0] / o.pan_scale);
    r.tilt = said(motor[1] / o.tilt_scale);
    r.zoom = way.zoom(t - o.latency_s);
    out.push_back(r);
  }
  return out;
}

std::vector<CalibratedCamera> SyntheticHead::calibration() const {
  std::vector<CalibratedCamera> out = truth;
  out[0].axes.reset();
  out[0].world_from_camera = Rigid3();
  return out;
}

SyntheticHead make_head(const SyntheticHeadOptions& o) {
  Random random(o.seed);
  SyntheticHead head;
  CalibratedCamera camera{"head", lens(o.zooms.empty() ? 900 : focal_at(o.zooms[0])), Rigid3()};
  camera.axes = random_axes(o, random);
  camera.world_from_camera = camera.axes->world_from_camera(0, 0);
  head.truth.push_back(camera);
  const CalibrationTarget target = board();
  const Eigen::Vector2d half = target.size() / 2;
  for (size_t b = 0; b < o.recordings; ++b) {
    // Its middle before the head, turned by some twenty degrees.
    const Eigen::Vector3d middle(0.1 * random.normal(), 0.06 * random.normal(),
                                 1.1 + 0.3 * random.uniform());
    const Rigid3 turned = turn(random.uniform(0.2, 0.5), Eigen::Vector3d::UnitY()) *
                          turn(random.uniform(-0.4, 0.4), Eigen::Vector3d::UnitX());
    head.world_from_body.push_back(camera.world_from_camera *
                                   shifted(middle.x(), middle.y(), middle.z()) * turned *
                                   shifted(-half.x(), -half.y(), 0));
    head.sights.bodies.push_back(
        {"board of recording " + std::to_string(b + 1), {{target, Rigid3(), 0}}, std::nullopt});
  }
  for (size_t c = 0; c < o.fixed_cameras; ++c) {
    const Rigid3 beside = shifted(0.4 * (c % 2 == 0 ? 1 : -1), 0.1, 0) *
                          turn(c % 2 == 0 ? -0.3 : 0.3, Eigen::Vector3d::UnitY());
    head.truth.push_back(
        {"fixed" + std::to_string(c + 1), lens(880), camera.world_from_camera * beside});
  }
  for (const CalibratedCamera& c : head.truth) {
    head.sights.cameras.push_back({c.name, c.model.width(), c.model.height(), 0});
  }
  for (size_t b = 0; b < o.recordings; ++b) {
    head.sights.recordings.push_back(record(o, head, b, random));
  }
  return head;
}

CameraAxes in_its_gauge(const CameraAxes& axes) {
  const Eigen::Vector3d u = axes.pan_from_tilt.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d q = axes.pan_from_tilt.translation;
  const double heading = std::atan2(u.y(), u.x()), twist = -std::asin(u.z());
  const Rigid3 turned = turn(heading, Eigen::Vector3d::UnitZ());
  // The tilt axis in the turned base; along it to where it is nearest to the pan axis.
  const Eigen::Vector3d at = turned.inverse() * q;
  const double along = -at.x() / std::cos(twist);
  const Eigen::Vector3d foot = at + along * Eigen::Vector3d(std::cos(twist), 0, -std::sin(twist));
  CameraAxes out = axes;
  out.world_from_base = axes.world_from_base * turned * shifted(0, 0, foot.z());
  out.pan_from_tilt = Rigid3(turn(twist, Eigen::Vector3d::UnitY()).rotation, {0, foot.y(), 0});
  out.tilt_from_camera = (out.world_from_base * out.pan_from_tilt).inverse() *
                         axes.world_from_base * axes.pan_from_tilt * axes.tilt_from_camera;
  return out;
}

Eigen::Matrix<double, kAxesParameters, 1> axes_error(const CameraAxes& truth,
                                                     const AxesSolution& solved, double play) {
  const CameraAxes a = in_its_gauge(truth), &b = *solved.camera.axes;
  const auto twist = [](const CameraAxes& axes) {
    const Eigen::Matrix3d m = axes.pan_from_tilt.rotation_matrix();
    return std::atan2(m(0, 2), m(0, 0));
  };
  Eigen::Matrix<double, kAxesParameters, 1> out;
  out.segment<6>(kBase) = difference(a.world_from_base, b.world_from_base);
  out[kTwist] = twist(b) - twist(a);
  out[kOffset] = b.pan_from_tilt.translation.y() - a.pan_from_tilt.translation.y();
  out.segment<6>(kMount) = difference(a.tilt_from_camera, b.tilt_from_camera);
  out[kPanScale] = b.pan_scale - a.pan_scale;
  out[kTiltScale] = b.tilt_scale - a.tilt_scale;
  // As estimated, also where it is too little to be written.
  const auto estimated = [&](const char* name) {
    const auto at = std::ranges::find(solved.estimates, name, &AxesEstimate::name);
    return at->value * kDegree;
  };
  out[kPanPlay] = estimated("play of pan") - play;
  out[kTiltPlay] = estimated("play of tilt") - play;
  out[kLatency] = b.latency_s - a.latency_s;
  return out;
}

}  // namespace sightline::test
