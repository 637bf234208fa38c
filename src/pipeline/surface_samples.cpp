// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/surface_samples.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sightline/base/log.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline {
namespace {

constexpr float kOneColor = 4;  // [levels] a mesh whose colors vary less has only one

// Y'CbCr as images are.
Eigen::Vector3f to_yuv(const Eigen::Vector3f& rgb) {
  const float r = rgb.x(), g = rgb.y(), b = rgb.z();
  return {16 + 65.481f * r + 128.553f * g + 24.966f * b,
          128 - 37.797f * r - 74.203f * g + 112.0f * b,
          128 + 112.0f * r - 93.786f * g - 18.214f * b};
}

uint8_t pixel_of(const PlaneView& plane, const Eigen::Vector2f& place) {
  const float u = place.x() - std::floor(place.x()), v = place.y() - std::floor(place.y());
  const int x = std::min(plane.width - 1, static_cast<int>(u * static_cast<float>(plane.width)));
  const int y =
      std::min(plane.height - 1, static_cast<int>((1 - v) * static_cast<float>(plane.height)));
  return plane.row(y)[x];
}

Eigen::Vector3f color_at(const SurfaceTriangle& triangle, const SurfaceImages& textures, float a,
                         float b) {
  const auto index = static_cast<size_t>(triangle.texture);
  if (triangle.texture < 0 || !textures[index]) return to_yuv(triangle.color);
  const Eigen::Vector2f place = triangle.places[0] + a * (triangle.places[1] - triangle.places[0]) +
                                b * (triangle.places[2] - triangle.places[0]);
  if (!place.allFinite()) return to_yuv(triangle.color);
  const I420View view = textures[index]->view();
  return {static_cast<float>(pixel_of(view.y, place)), static_cast<float>(pixel_of(view.u, place)),
          static_cast<float>(pixel_of(view.v, place))};
}

// Of a patch of 2 `reach` [m] about the spot, so that the fine print that no camera resolves is
// averaged.
Eigen::Vector3f patch_color(const SurfaceTriangle& triangle, const SurfaceImages& textures, float a,
                            float b, float reach) {
  const float step_a = reach / (triangle.corners[1] - triangle.corners[0]).norm();
  const float step_b = reach / (triangle.corners[2] - triangle.corners[0]).norm();
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float count = 0;
  for (int i = -2; i <= 2; ++i) {
    for (int k = -2; k <= 2; ++k) {
      const float u = a + 0.5f * static_cast<float>(i) * step_a;
      const float v = b + 0.5f * static_cast<float>(k) * step_b;
      if (u < 0 || v < 0 || u + v > 1) continue;
      sum += color_at(triangle, textures, u, v);
      count += 1;
    }
  }
  return count > 0 ? Eigen::Vector3f(sum / count) : color_at(triangle, textures, a, b);
}

double area_of(const SurfaceTriangle& triangle) {
  const Eigen::Vector3d u = (triangle.corners[1] - triangle.corners[0]).cast<double>();
  const Eigen::Vector3d v = (triangle.corners[2] - triangle.corners[0]).cast<double>();
  return 0.5 * u.cross(v).norm();
}

bool one_color(const std::vector<SurfaceSample>& samples) {
  Eigen::Vector3f low = Eigen::Vector3f::Constant(1e9f), high = -low;
  for (const SurfaceSample& spot : samples) {
    low = low.cwiseMin(spot.color);
    high = high.cwiseMax(spot.color);
  }
  return (high - low).maxCoeff() < kOneColor;
}

}  // namespace

Result<std::shared_ptr<const Image>> read_texture(const MeshSurface& surface, size_t index) {
  const std::string& bytes = surface.embedded.at(index);
  const std::filesystem::path& name = surface.textures.at(index);
  return bytes.empty() ? read_image(name) : parse_image(bytes, name.string());
}

SurfaceImages surface_images(const MeshSurface& surface) {
  SurfaceImages textures;
  for (size_t i = 0; i < surface.textures.size(); ++i) {
    auto image = read_texture(surface, i);
    if (!image) log::warning("{}; its colors are not used", image.error().message());
    textures.push_back(image ? *std::move(image) : nullptr);
  }
  return textures;
}

std::vector<SurfaceSample> surface_samples(const MeshSurface& surface, const SurfaceImages& images,
                                           size_t count) {
  double total = 0;
  for (const SurfaceTriangle& triangle : surface.triangles) total += area_of(triangle);
  std::vector<SurfaceSample> samples;
  if (!(total > 0)) return samples;
  const auto reach = static_cast<float>(0.6 * std::sqrt(total / static_cast<double>(count)));
  double due = 0;
  uint32_t made = 0;
  for (const SurfaceTriangle& triangle : surface.triangles) {
    const Eigen::Vector3f u = triangle.corners[1] - triangle.corners[0];
    const Eigen::Vector3f v = triangle.corners[2] - triangle.corners[0];
    const Eigen::Vector3f across = u.cross(v);
    due += static_cast<double>(count) * area_of(triangle) / total;
    for (; due >= 1; due -= 1) {
      // Evenly spread without a pattern: Roberts' sequence, folded into the triangle.
      ++made;
      double a = 0.7548776662 * made, b = 0.5698402910 * made;
      a -= std::floor(a);
      b -= std::floor(b);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      const auto fa = static_cast<float>(a), fb = static_cast<float>(b);
      samples.push_back({triangle.corners[0] + fa * u + fb * v, across.normalized(),
                         patch_color(triangle, images, fa, fb, reach)});
    }
  }
  if (one_color(samples)) samples.clear();
  return samples;
}

}  // namespace sightline
