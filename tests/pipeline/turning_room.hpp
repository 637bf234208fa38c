// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "sightline/geometry/axis_history.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::test {

constexpr double kDegree = std::numbers::pi / 180;

/// Blurred random numbers, by bilinear lookup: walls whose truth is known everywhere.
class Texture {
 public:
  explicit Texture(unsigned seed) : cells_(kSide * kSide) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> gray(-1, 1);
    // Coarse and fine spots, so that every level of a pyramid has something to see.
    for (const auto& [cell, strength] : {std::pair(64, 40.f), {16, 45.f}, {4, 35.f}}) {
      const int across = kSide / cell;
      std::vector<float> coarse(static_cast<size_t>(across * across));
      for (float& value : coarse) value = strength * gray(random);
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) {
          cells_[index(x, y)] +=
              sample(coarse, across, static_cast<double>(x) / cell, static_cast<double>(y) / cell);
        }
      }
    }
  }
  /// At a place on a wall [m].
  float at(double u, double v) const { return 128 + sample(cells_, kSide, u / kCell, v / kCell); }

 private:
  static constexpr int kSide = 1024;
  static constexpr double kCell = 0.006;  // [m]
  static size_t index(int x, int y) {
    return static_cast<size_t>(y & (kSide - 1)) * kSide + static_cast<size_t>(x & (kSide - 1));
  }
  static float sample(const std::vector<float>& from, int side, double x, double y) {
    const double fx = std::floor(x), fy = std::floor(y);
    const auto ax = static_cast<float>(x - fx), ay = static_cast<float>(y - fy);
    const auto cell = [&](int dx, int dy) {
      const int mask = side - 1;
      return from[static_cast<size_t>((static_cast<int>(fy) + dy) & mask) *
                      static_cast<size_t>(side) +
                  static_cast<size_t>((static_cast<int>(fx) + dx) & mask)];
    };
    const float top = cell(0, 0) + ax * (cell(1, 0) - cell(0, 0));
    const float low = cell(0, 1) + ax * (cell(1, 1) - cell(0, 1));
    return top + ay * (low - top);
  }
  std::vector<float> cells_;
};

/// A closed room with pillars in it: a head at its middle looks at walls some meters away and at
/// things 1 m near.
struct Room {
  Texture texture{7};
  double contrast = 1, noise = 2;     ///< of the walls; gray levels
  Rigid3 world_from_room;             ///< moves with everything in it
  double cover = 0;                   ///< share of the width that something else hides, ...
  Eigen::Vector2d cover_shift{0, 0};  ///< ... which moves so [px]

  float gray(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d half(3.2, 2.6, 1.6);
    double distance = 1e9;
    Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
    for (int axis = 0; axis < 3; ++axis) {
      const double t = ((ray(axis) > 0 ? half(axis) : -half(axis)) - eye(axis)) / ray(axis);
      if (t > distance || !(t > 0)) continue;
      distance = t;
      normal = Eigen::Vector3d::Unit(axis);
    }
    for (int i = 0; i < 6; ++i) {  // pillars, square, turned as they stand
      const double around = i * 60 * kDegree + 0.3;
      const Eigen::Vector3d out(std::cos(around), std::sin(around), 0);
      const double t = (1.1 - eye.dot(out)) / ray.dot(out);
      if (!(t > 0) || t > distance) continue;
      const Eigen::Vector3d at = eye + t * ray - 1.1 * out;
      const double side = at.dot(Eigen::Vector3d(-out.y(), out.x(), 0));
      if (std::abs(side) > 0.09 || at.z() > 0.3) continue;
      return shade(side + i, at.z() + 5);
    }
    const Eigen::Vector3d at = eye + distance * ray;
    if (normal.x() != 0) return shade(at.y(), at.z() + 11 * ray.x());
    if (normal.y() != 0) return shade(at.x(), at.z() + 17 * ray.y() / std::abs(ray.y()));
    return shade(at.x(), at.y());
  }
  float shade(double u, double v) const {
    return 128 + static_cast<float>(contrast) * (texture.at(u, v) - 128);
  }
};

/// 1280x720 with 60 degrees across, or another.
inline CalibratedCamera head_camera(int width = 1280, int height = 720) {
  CameraModel::Parameters lens;
  lens.width = width;
  lens.height = height;
  lens.fx = lens.fy = 0.5 * width / std::tan(30 * kDegree);
  lens.cx = 0.5 * (width - 1);
  lens.cy = 0.5 * (height - 1);
  lens.distortion = {-0.08, 0.01};
  CalibratedCamera camera{"head", CameraModel::create(lens, "head").value(), {}, 0.5, 0, {}};
  CameraAxes& axes = camera.axes.emplace();
  Vector6 offset, mount;
  offset << 0, 0, 0, 0.004, 0.012, 0.06;
  mount << -std::numbers::pi / 2, 0, 0, 0.003, 0.035, 0.008;
  axes.pan_from_tilt = Rigid3::exp(offset);
  axes.tilt_from_camera = Rigid3(Rigid3::exp(mount).rotation, mount.tail<3>());
  axes.latency_s = 0.080;
  axes.latency_sigma_s = 0.001;
  axes.sigma = 0.0145 * kDegree;
  axes.acceleration = 150 * kDegree;
  camera.world_from_camera = axes.world_from_camera(0, 0);
  return camera;
}

/// A head with its encoder and its pictures, on a clock of its own: readings at 100 Hz in steps of
/// 0.05 degrees, 80 ms late; 30 frames a second, there 15 ms after they were taken.
class TurningHead {
 public:
  using Way = std::function<Eigen::Vector2d(double)>;  ///< pan, tilt [rad] by time [s]
  /// Pans at up to 60 deg/s.
  static Eigen::Vector2d swing(double t) {
    const double turn = 2 * std::numbers::pi * t / 2.62;
    return Eigen::Vector2d(25 * std::sin(turn), 4 * std::sin(0.8 * turn + 1)) * kDegree;
  }

  TurningHead(const CalibratedCamera& camera, Room room, Way way = swing)
      : camera_(camera),
        room_(std::move(room)),
        way_(std::move(way)),
        history_(*camera.axes, camera.model.parameters().fx) {
    const auto& lens = camera.model.parameters();
    for (int y = 0; y < lens.height; ++y) {
      for (int x = 0; x < lens.width; ++x) rays_.push_back(*camera.model.unproject({x, y}));
    }
  }

  Room& room() { return room_; }
  double now() const { return index_ / 30.0; }
  Eigen::Vector2d truth() const { return way_(now()); }
  /// What is done to readings before they are told.
  std::function<void(AxisReading&)> spoil{};

  /// The next frame, with what is known of its place when it arrives.
  FramePtr next() {
    ++index_;
    constexpr double kStep = 0.05 * kDegree, kLate = 0.080, kEvery = 0.01, kArrival = 0.015;
    for (; reading_ * kEvery + kLate <= now() + kArrival; ++reading_) {
      const Eigen::Vector2d angles = way_(reading_ * kEvery);
      AxisReading reading;
      reading.stamp = time_of(reading_ * kEvery + kLate);
      reading.pan = kStep * std::round(angles.x() / kStep);
      reading.tilt = kStep * std::round(angles.y() / kStep);
      if (spoil) spoil(reading);
      history_.add(reading);
    }
    FrameInfo info;
    info.sequence = static_cast<uint64_t>(index_);
    info.capture = time_of(now());
    info.arrival = time_of(now() + kArrival);
    info.width = camera_.model.width();
    info.height = camera_.model.height();
    info.place = history_.place_at(info.capture);
    return Frame::decoded(info, picture(), {}, pool());
  }

 private:
  static Time time_of(double seconds) { return Time{} + from_seconds(10 + seconds); }
  std::shared_ptr<ImagePool> pool() {
    if (!pool_) {
      pool_ = std::make_shared<ImagePool>(camera_.model.width(), camera_.model.height());
    }
    return pool_;
  }
  std::shared_ptr<const Image> picture() {
    const Eigen::Vector2d angles = truth();
    const Rigid3 place =
        room_.world_from_room.inverse() * camera_.axes->world_from_camera(angles.x(), angles.y());
    const Eigen::Matrix3d rotation = place.rotation_matrix();
    auto image = std::make_shared<Image>(camera_.model.width(), camera_.model.height());
    const auto plane = image->mutable_view().y;
    size_t i = 0;
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x, ++i) {
        // A cheap sum of four bytes is near enough to a normal distribution.
        random_ = random_ * 6364136223846793005u + 1442695040888963407u;
        const auto bits = static_cast<uint32_t>(random_ >> 32);
        const auto sum = static_cast<float>((bits & 255) + ((bits >> 8) & 255) +
                                            ((bits >> 16) & 255) + (bits >> 24)) -
                         510;
        const bool hidden = x < room_.cover * plane.width;
        const float gray = hidden ? room_.texture.at(0.004 * (x + room_.cover_shift.x()),
                                                     0.004 * (y + room_.cover_shift.y()))
                                  : room_.gray(place.translation, rotation * rays_[i]);
        const float value = gray + static_cast<float>(room_.noise) * sum / 148;
        plane.row(y)[x] = static_cast<uint8_t>(std::clamp(value, 0.f, 255.f));
      }
    }
    return image;
  }

  const CalibratedCamera camera_;
  Room room_;
  const Way way_;
  AxisHistory history_;
  std::vector<Eigen::Vector3d> rays_;
  std::shared_ptr<ImagePool> pool_;
  uint64_t random_ = 1;
  int index_ = 0, reading_ = -50;
};

}  // namespace sightline::test
