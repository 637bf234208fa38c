// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

struct Gray {
  int width = 0, height = 0;
  std::vector<uint8_t> bytes;
  PlaneView view() const { return {bytes.data(), width, height, width}; }
};

inline Gray copy_of(const PlaneView& plane) {
  Gray out{plane.width, plane.height, {}};
  for (int y = 0; y < plane.height; ++y) {
    out.bytes.insert(out.bytes.end(), plane.row(y), plane.row(y) + plane.width);
  }
  return out;
}

inline Gray halved(const Gray& full) {
  Gray out{full.width / 2, full.height / 2, {}};
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const uint8_t* p = full.bytes.data() + ptrdiff_t{2} * y * full.width + 2 * x;
      out.bytes.push_back(
          static_cast<uint8_t>((p[0] + p[1] + p[full.width] + p[full.width + 1] + 2) / 4));
    }
  }
  return out;
}

// What the camera sees after it has been turned (calibrated_from_now) and zoomed; edges repeat.
inline Gray seen_turned(const Gray& image, const CameraModel& lens, const Eigen::Vector3d& turn,
                        double zoom) {
  Vector6 tangent = Vector6::Zero();
  tangent.head<3>() = turn;
  const Eigen::Matrix3d calibrated_from_now = Rigid3::exp(tangent).rotation_matrix();
  const Eigen::Vector2d center(lens.parameters().cx, lens.parameters().cy);
  Gray out = image;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto ray = lens.unproject(center + (Eigen::Vector2d(x, y) - center) / zoom);
      const auto from = ray ? lens.project(calibrated_from_now * *ray) : std::nullopt;
      if (!from) continue;
      const double fx = std::clamp(from->x(), 0.0, image.width - 1.001);
      const double fy = std::clamp(from->y(), 0.0, image.height - 1.001);
      const int x0 = static_cast<int>(fx), y0 = static_cast<int>(fy);
      const double u = fx - x0, v = fy - y0;
      const uint8_t* p = image.bytes.data() + ptrdiff_t{y0} * image.width + x0;
      out.bytes[static_cast<size_t>(y * image.width + x)] =
          static_cast<uint8_t>((1 - v) * ((1 - u) * p[0] + u * p[1]) +
                               v * ((1 - u) * p[image.width] + u * p[image.width + 1]) + 0.5);
    }
  }
  return out;
}

/// A recording's cameras, with full-size gray images.
struct Footage {
  std::vector<CalibratedCamera> cameras;
  std::vector<std::vector<Gray>> images;  // by camera
};

// Blots at random, softened: still pictures of three rooms.
inline Footage synthetic(double focal = 600, int width = 640, int height = 480, uint32_t seed = 1) {
  Footage footage;
  const auto next = [&seed] { return (seed = seed * 1664525 + 1013904223) >> 16; };
  constexpr int kBlot = 10;
  for (const char* name : {"left", "middle", "right"}) {
    CameraModel::Parameters lens{LensModel::kBrownConrady, width,           height, focal, focal,
                                 width / 2 - 3.3,          height / 2 + 1.7};
    Vector6 place;
    place << 0.1 + 0.001 * next() / 65536, -0.7, 0.3, next() / 65536.0, 1.0 / 3, 0.7;
    footage.cameras.push_back({name, CameraModel::create(lens, name).value(), Rigid3::exp(place)});
    const int columns = width / kBlot + 2;
    std::vector<double> blots(static_cast<size_t>(columns) * (height / kBlot + 2));
    for (double& blot : blots) blot = 40 + next() % 170;
    Gray image{width, height, {}};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double* at = &blots[static_cast<size_t>(y / kBlot * columns + x / kBlot)];
        const double u = double(x % kBlot) / kBlot, v = double(y % kBlot) / kBlot;
        image.bytes.push_back(
            static_cast<uint8_t>((1 - v) * ((1 - u) * at[0] + u * at[1]) +
                                 v * ((1 - u) * at[columns] + u * at[columns + 1])));
      }
    }
    footage.images.push_back({std::move(image)});
  }
  return footage;
}

}  // namespace sightline
