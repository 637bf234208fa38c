// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "../support/random.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/calibration_target.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/fiducial/target_print.hpp"

namespace sightline::test {

/// The board as a picture: dark, bright, and white paper around it.
class Print {
 public:
  explicit Print(const CalibrationTarget& target)
      : size_(target.size()),
        columns_(static_cast<int>((size_.x() + 2 * kBorder) / kCell)),
        rows_(static_cast<int>((size_.y() + 2 * kBorder) / kCell)),
        levels_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_), 200) {
    const auto dark = target_print(target);
    for (const PrintedRect& r : *dark) {
      for (int y = cell(r.top); y < cell(r.top + r.height); ++y) {
        for (int x = cell(r.left); x < cell(r.left + r.width); ++x) {
          levels_[static_cast<size_t>(y) * static_cast<size_t>(columns_) + static_cast<size_t>(x)] =
              40;
        }
      }
    }
  }
  /// Level of a ray that starts in front of the print, in the target's frame; negative beside it.
  int seen(const Eigen::Vector3f& from, const Eigen::Vector3f& direction) const {
    const float along = -from.z() / direction.z();
    if (!(along > 0) || direction.z() <= 0) return -1;  // the print's back is out of sight
    const Eigen::Vector3f hit = from + along * direction;
    return at({hit.x(), hit.y()});
  }
  /// Level at a place of the target's plane; negative beside the paper.
  int at(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d end = size_ + Eigen::Vector2d::Constant(kBorder);
    // Written so that what is not finite is beside it.
    if (!(p.x() > -kBorder && p.y() > -kBorder && p.x() < end.x() && p.y() < end.y())) return -1;
    const int x = std::min(cell(p.x()), columns_ - 1), y = std::min(cell(p.y()), rows_ - 1);
    return levels_[static_cast<size_t>(y) * static_cast<size_t>(columns_) + static_cast<size_t>(x)];
  }

 private:
  static constexpr double kCell = 0.0002, kBorder = 0.02;
  static int cell(double meters) { return static_cast<int>((meters + kBorder) / kCell); }

  Eigen::Vector2d size_;
  int columns_, rows_;
  std::vector<uint8_t> levels_;
};

/// A print, and where it stands behind the others.
struct PlacedPrint {
  const Print* print;
  Rigid3 world_from_target;
};

/// One camera's images of prints in front of a gray wall, nine rays to a pixel.
class Photographer {
 public:
  /// `gamma`: light adds up, and is written as its 1/gamma-th power; 1: levels add up.
  explicit Photographer(const CalibratedCamera& camera, double gamma = 1)
      : camera_(camera), gamma_(gamma) {
    for (size_t level = 0; level < light_.size(); ++level) {
      light_[level] = static_cast<float>(std::pow(static_cast<double>(level) / 255, gamma));
    }
    for (int y = 0; y < camera.model.height(); ++y) {
      for (int x = 0; x < camera.model.width(); ++x) {
        for (int k = 0; k < static_cast<int>(kRays); ++k) {
          const auto ray = camera.model.unproject({x + (k % 3 - 1) / 3.0, y + (k / 3 - 1) / 3.0});
          rays_.push_back(ray.value_or(Eigen::Vector3d::UnitZ()).cast<float>());
        }
      }
    }
  }

  /// The first print is in front.
  std::vector<uint8_t> shoot(const std::vector<PlacedPrint>& prints) const {
    return shoot(prints, camera_.world_from_camera);
  }
  /// From elsewhere.
  std::vector<uint8_t> shoot(const std::vector<PlacedPrint>& prints,
                             const Rigid3& world_from_camera) const {
    std::vector<float> sums(rays_.size() / kRays, 0);
    add_light(prints, world_from_camera, 0, rays_.size(), sums);
    return developed(sums);
  }
  /// A print that is elsewhere for each row (rolling shutter): pose_at(row) is world_from_target.
  template <typename PoseAt>
  std::vector<uint8_t> shoot_rows(const Print& print, const PoseAt& pose_at) const {
    std::vector<float> sums(rays_.size() / kRays, 0);
    const size_t in_row = rays_.size() / static_cast<size_t>(camera_.model.height());
    for (int row = 0; row < camera_.model.height(); ++row) {
      const size_t first = static_cast<size_t>(row) * in_row;
      add_light({{&print, pose_at(row)}}, camera_.world_from_camera, first, first + in_row, sums);
    }
    return developed(sums);
  }

 private:
  static constexpr size_t kRays = 9;

  /// Of the rays from `first` up to `end`.
  void add_light(const std::vector<PlacedPrint>& prints, const Rigid3& world_from_camera,
                 size_t first, size_t end, std::vector<float>& sums) const {
    constexpr int kWall = 120;
    std::vector<char> free(end - first, 1);
    for (const PlacedPrint& placed : prints) {
      const Rigid3 target_from_camera = placed.world_from_target.inverse() * world_from_camera;
      const Eigen::Matrix3f turn = target_from_camera.rotation.toRotationMatrix().cast<float>();
      const Eigen::Vector3f from = target_from_camera.translation.cast<float>();
      for (size_t i = first; i < end; ++i) {
        if (!free[i - first]) continue;
        const int level = placed.print->seen(from, turn * rays_[i]);
        if (level < 0) continue;
        free[i - first] = 0;
        sums[i / kRays] += light_[static_cast<size_t>(level)];
      }
    }
    for (size_t i = first; i < end; ++i)
      if (free[i - first]) sums[i / kRays] += light_[kWall];
  }

  std::vector<uint8_t> developed(const std::vector<float>& sums) const {
    std::vector<uint8_t> image;
    for (const float sum : sums) {
      const double light = std::min(1.0, static_cast<double>(sum) / kRays);
      image.push_back(static_cast<uint8_t>(255 * std::pow(light, 1 / gamma_) + 1e-4));
    }
    return image;
  }

  const CalibratedCamera& camera_;
  const double gamma_;
  std::array<float, 256> light_{};
  std::vector<Eigen::Vector3f> rays_;
};

/// One image with noise of the sensor.
FramePtr noisy_frame(uint32_t camera, uint64_t sequence, const CameraModel& lens,
                     const std::vector<uint8_t>& levels, Time at, Random& random);

}  // namespace sightline::test
