// SPDX-License-Identifier: Apache-2.0
#include "surface_shader.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>

#include "sightline/base/check.hpp"
#include "sightline/render/backend.hpp"

namespace sightline {
namespace {

using Texel = SurfaceTexture::Texel;
using Level = SurfaceTexture::Level;

constexpr int kMostProbes = 4;

/// The three colours of a texel in 16 bits each, so that one product serves all.
uint64_t spread(Texel t) {
  return uint64_t{t & 255u} | uint64_t{t >> 8 & 255u} << 16 | uint64_t{t >> 16 & 255u} << 32;
}
Texel packed(uint64_t c) {
  return static_cast<Texel>((c & 0xff) | (c >> 8 & 0xff00) | (c >> 16 & 0xff0000));
}
constexpr uint64_t kHalves = 0x008000800080;
constexpr uint64_t kBytes = 0x00ff00ff00ff;

/// Between two, `share` of 256 of the second.
uint64_t mix(uint64_t a, uint64_t b, uint32_t share) {
  return (a * (256 - share) + b * share + kHalves) >> 8 & kBytes;
}

/// The next whole number below; the library's is a call on processors without SSE4.
int whole(float value) {
  const int i = static_cast<int>(value);
  return value < static_cast<float>(i) ? i - 1 : i;
}

/// Two texels beside each other on a row (or rows on a column) that repeats, and how much of the
/// second is seen from `place`, a share of the texture.
struct Pair {
  size_t first, second;
  uint32_t share;  ///< of 256
};
Pair pair_at(float place, int size) {
  // Whole repeats first: what is left is precise, and at most half a texel outside.
  const float at = (place - static_cast<float>(whole(place))) * static_cast<float>(size) - 0.5f;
  const int below = whole(at);
  const int first = below < 0 ? size - 1 : std::min(below, size - 1);
  const int second = first + 1 < size ? first + 1 : 0;
  return {static_cast<size_t>(first), static_cast<size_t>(second),
          static_cast<uint32_t>((at - static_cast<float>(below)) * 256.0f)};
}

uint64_t bilinear(const Level& level, const Eigen::Vector2f& place) {
  const Pair x = pair_at(place.x(), level.width);
  const Pair y = pair_at(place.y(), level.height);
  const auto width = static_cast<size_t>(level.width);
  const Texel* const top = level.texels.data() + y.first * width;
  const Texel* const bottom = level.texels.data() + y.second * width;
  return mix(mix(spread(top[x.first]), spread(top[x.second]), x.share),
             mix(spread(bottom[x.first]), spread(bottom[x.second]), x.share), y.share);
}

/// log2 to within 0.09, from the bits of the number.
float rough_log2(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  const auto exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
  const float mantissa = std::bit_cast<float>((bits & 0x7fffffu) | 0x3f800000u);
  return exponent + mantissa - 1;
}

uint8_t to_byte(float value) {
  return static_cast<uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f);
}

/// As the tile compositor lights a plain colour.
int lit(int value, int rest, int light) { return rest + (((value - rest) * light + 128) >> 8); }

}  // namespace

Texel sample_texture(const SurfaceTexture& texture, const Eigen::Vector2f& place,
                     const Eigen::Vector2f& across, const Eigen::Vector2f& down) {
  const std::vector<Level>& levels = texture.levels();
  const Eigen::Vector2f size(static_cast<float>(levels.front().width),
                             static_cast<float>(levels.front().height));
  const float along = across.cwiseProduct(size).squaredNorm();
  const float other = down.cwiseProduct(size).squaredNorm();
  const Eigen::Vector2f& longer = along > other ? across : down;
  const float longest = std::max(std::max(along, other), 1e-12f);
  const float shortest = std::max(std::min(along, other), 1.0f);
  // As many as the footprint is times longer than wide.
  int probes = 1;
  while (probes < kMostProbes &&
         longest >= static_cast<float>((probes + 1) * (probes + 1)) * shortest)
    ++probes;
  constexpr std::array<float, kMostProbes> kShares = {1.0f, 1 / 4.0f, 1 / 9.0f, 1 / 16.0f};
  // The square's logarithm is twice the length's.
  const float depth =
      std::clamp(0.5f * rough_log2(longest * kShares[static_cast<size_t>(probes - 1)]), 0.0f,
                 static_cast<float>(levels.size() - 1));
  // Half of the way from one level to the next shows one of them alone, which costs half.
  auto level = static_cast<size_t>(depth);
  const float between = std::clamp(2 * (depth - static_cast<float>(level)) - 0.5f, 0.0f, 1.0f);
  auto share = static_cast<uint32_t>(between * 256.0f);
  if (share == 256) ++level, share = 0;
  constexpr std::array<float, kMostProbes> kHalfSteps = {1 / 2.0f, 1 / 4.0f, 1 / 6.0f, 1 / 8.0f};
  uint64_t sum = 0;
  for (int i = 0; i < probes; ++i) {
    // Of one probe the step is zero.
    const float step =
        (static_cast<float>(2 * i + 1 - probes)) * kHalfSteps[static_cast<size_t>(probes - 1)];
    const Eigen::Vector2f at = place + step * longer;
    const uint64_t fine = bilinear(levels[level], at);
    sum += share == 0 ? fine : mix(fine, bilinear(levels[level + 1], at), share);
  }
  if (probes == 1) return packed(sum);
  const auto mean = [&](int shift) {
    const auto count = static_cast<uint64_t>(probes);
    return static_cast<Texel>(((sum >> shift & 0xffffu) + count / 2) / count);
  };
  return mean(0) | mean(16) << 8 | mean(32) << 16;
}

/// One frame's numbers.
struct SurfaceShader::View {
  const RenderMesh& mesh;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  Eigen::Vector3d light;  ///< object's frame
  bool smooth, textured;
};

SurfaceShader::SurfaceShader(std::shared_ptr<const RayTable> rays)
    : rays_(std::move(rays)), faces_(kKept) {}

void SurfaceShader::run(const RenderMesh& mesh, const Rigid3& camera_from_object, Shading shading,
                        bool textured, RasterTile& tile) {
  SL_CHECK(tile.has_faces(), "a tile with faces");
  SL_CHECK(!textured || mesh.paint.size() == mesh.faces.size(), "a mesh with paint");
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  const View view{mesh,
                  rotation,
                  camera_from_object.translation,
                  rotation.transpose() * Eigen::Vector3d(kLightX, kLightY, kLightZ),
                  shading == Shading::kSmooth && !mesh.face_corner_normals.empty(),
                  textured};
  for (Face& face : faces_) face.number = RasterTile::kNoFace;
  stride_ = tile.stride();
  if (textured) {
    const size_t size = stride_ * static_cast<size_t>(tile.height()) + RasterTile::kSlack;
    for (auto& plane : planes_) {
      if (plane.size() < size) plane.resize(size);
    }
  }
  for (int y = 0; y < tile.height(); ++y) shade_row(view, y, tile);
  if (textured) repeat_frame_edge(tile.rect());
}

/// The chroma sample at the border of a frame of odd size covers pixels outside it.
void SurfaceShader::repeat_frame_edge(const TileRect& rect) {
  const int width = rays_->width() - rect.x;
  const int height = rays_->height() - rect.y;
  for (auto& plane : planes_) {
    if (width < rect.width) {
      for (int y = 0; y < rect.height; ++y) {
        uint8_t* const last = plane.data() + row(y) + width;
        last[0] = last[-1];
      }
    }
    if (height < rect.height)
      std::copy_n(plane.data() + row(height - 1), rect.width, plane.data() + row(height));
  }
}

/// Edge functions of the face in the camera's frame are its corners' weights; sums of them with
/// what the corners carry are linear in the ray, too.
void SurfaceShader::set_up(const View& view, uint32_t number, float ray_x, float ray_y,
                           Face& face) const {
  const RenderMesh& mesh = view.mesh;
  std::array<Eigen::Vector3d, 3> corner;
  for (size_t i = 0; i < 3; ++i)
    corner[i] = view.rotation * mesh.vertex(mesh.faces[number][i]) + view.translation;
  // weight[i] is zero along the edge across from corner i.
  std::array<Eigen::Vector3d, 3> weight = {corner[1].cross(corner[2]), corner[2].cross(corner[0]),
                                           corner[0].cross(corner[1])};
  const double volume = corner[0].dot(weight[0]);
  double total = 0;
  for (Eigen::Vector3d& w : weight) {
    w.z() += w.x() * double{ray_x} + w.y() * double{ray_y};
    total += w.z();
  }
  // One at the origin, whose ray meets the face.
  for (Eigen::Vector3d& w : weight) w /= total != 0 ? total : 1;
  const auto sum = [&](double p, double q, double r) {
    const Eigen::Vector3d s = p * weight[0] + q * weight[1] + r * weight[2];
    return Linear{static_cast<float>(s.x()), static_cast<float>(s.y()), static_cast<float>(s.z())};
  };
  face.number = number;
  face.origin_x = ray_x;
  face.origin_y = ray_y;
  face.weight = sum(1, 1, 1);
  face.luminance = mesh.luminance[number];
  const double side = volume > 0 ? -1 : 1;  // seen from behind, as in FacePlanes
  face.flat = static_cast<float>(std::max(0.0, side * mesh.normal(number).dot(view.light)));
  if (view.smooth) {
    std::array<Eigen::Vector3d, 3> n;
    for (size_t i = 0; i < 3; ++i)
      n[i] = side * mesh.corner_normals[mesh.face_corner_normals[number][i]].cast<double>();
    for (int k = 0; k < 3; ++k)
      face.normal[static_cast<size_t>(k)] = sum(n[0][k], n[1][k], n[2][k]);
    face.towards = sum(n[0].dot(view.light), n[1].dot(view.light), n[2].dot(view.light));
  }
  if (!view.textured) return;
  const FacePaint& paint = mesh.paint[number];
  face.texture =
      paint.texture < 0 ? nullptr : mesh.textures[static_cast<size_t>(paint.texture)].get();
  if (face.texture != nullptr) {
    for (int k = 0; k < 2; ++k) {
      face.colors[static_cast<size_t>(k)] =
          sum(double{paint.places[0][k]}, double{paint.places[1][k]}, double{paint.places[2][k]});
    }
  } else {
    face.colors = {sum(paint.colors[0].y, paint.colors[1].y, paint.colors[2].y),
                   sum(paint.colors[0].u, paint.colors[1].u, paint.colors[2].u),
                   sum(paint.colors[0].v, paint.colors[1].v, paint.colors[2].v)};
  }
}

void SurfaceShader::shade_row(const View& view, int y, RasterTile& tile) {
  const uint32_t* const numbers = tile.face(y);
  uint8_t* const shades = tile.shade(y);
  const int frame_y = tile.rect().y + y;
  const float* const ray_x = rays_->x_row(frame_y) + tile.rect().x;
  const float* const ray_y = rays_->y_row(frame_y) + tile.rect().x;
  // A neighbour above or below for the size of a pixel; beyond the picture there is none.
  const bool last_row = frame_y + 1 >= rays_->height();
  const int down = last_row ? std::max(frame_y - 1, 0) : frame_y + 1;
  const float* const next_x = rays_->x_row(down) + tile.rect().x;
  const float* const next_y = rays_->y_row(down) + tile.rect().x;
  uint8_t* const luma = view.textured ? planes_[0].data() + row(y) : nullptr;
  uint8_t* const us = view.textured ? planes_[1].data() + row(y) : nullptr;
  uint8_t* const vs = view.textured ? planes_[2].data() + row(y) : nullptr;
  const auto ambient = static_cast<float>(kAmbient);
  for (int x = 0; x < tile.width(); ++x) {
    const uint32_t number = numbers[x];
    if (number == RasterTile::kNoFace) continue;
    Face& face = faces_[number % kKept];
    if (face.number != number) set_up(view, number, ray_x[x], ray_y[x], face);
    const float dx = ray_x[x] - face.origin_x;
    const float dy = ray_y[x] - face.origin_y;
    float lambert = face.flat;
    if (view.smooth) {
      float square = 0;
      for (const Linear& axis : face.normal) square += axis.at(dx, dy) * axis.at(dx, dy);
      // Normals that cancel one another say nothing.
      if (square > 1e-12f) lambert = std::max(0.0f, face.towards.at(dx, dy) / std::sqrt(square));
    }
    const float level = ambient + (1 - ambient) * std::min(lambert, 1.0f);
    if (!view.textured) {
      shades[x] = static_cast<uint8_t>(255.0f * level * face.luminance + 0.5f);
      continue;
    }
    shades[x] = static_cast<uint8_t>(255.0f * level + 0.5f);
    const int light = 80 + (175 * shades[x] >> 8);
    const float over = 1 / face.weight.at(dx, dy);
    int color_y, color_u, color_v;
    if (face.texture != nullptr) {
      const Eigen::Vector2f place(face.colors[0].at(dx, dy) * over,
                                  face.colors[1].at(dx, dy) * over);
      // d(place) / d(ray) = (numerator' - place * weight') / weight.
      const Eigen::Vector2f by_x = Eigen::Vector2f(face.colors[0].a - place.x() * face.weight.a,
                                                   face.colors[1].a - place.y() * face.weight.a) *
                                   over;
      const Eigen::Vector2f by_y = Eigen::Vector2f(face.colors[0].b - place.x() * face.weight.b,
                                                   face.colors[1].b - place.y() * face.weight.b) *
                                   over;
      const auto step = [&](float to_x, float to_y) -> Eigen::Vector2f {
        const float sx = to_x - ray_x[x], sy = to_y - ray_y[x];
        if (!(std::abs(sx) + std::abs(sy) < 1)) return Eigen::Vector2f::Zero();
        return by_x * sx + by_y * sy;
      };
      const Texel t = sample_texture(*face.texture, place, step(ray_x[x + 1], ray_y[x + 1]),
                                     step(next_x[x], next_y[x]));
      color_y = static_cast<int>(t & 255u);
      color_u = static_cast<int>(t >> 8 & 255u);
      color_v = static_cast<int>(t >> 16 & 255u);
    } else {
      color_y = to_byte(face.colors[0].at(dx, dy) * over);
      color_u = to_byte(face.colors[1].at(dx, dy) * over);
      color_v = to_byte(face.colors[2].at(dx, dy) * over);
    }
    luma[x] = static_cast<uint8_t>(std::clamp(lit(color_y, 16, light), 0, 255));
    us[x] = static_cast<uint8_t>(std::clamp(lit(color_u, 128, light), 0, 255));
    vs[x] = static_cast<uint8_t>(std::clamp(lit(color_v, 128, light), 0, 255));
  }
}

}  // namespace sightline
