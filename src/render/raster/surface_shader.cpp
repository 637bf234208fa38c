// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/surface_shader.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>

#include "sightline/base/check.hpp"
#include "sightline/render/raster/backend.hpp"

namespace sightline {
namespace {

using Texel = SurfaceTexture::Texel;
using Level = SurfaceTexture::Level;

constexpr int kMaxProbes = 4;

/// The three colors of a texel in 16 bits each, so that one product serves all.
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

/// What is no number is nothing.
uint8_t to_byte(float value) {
  return static_cast<uint8_t>(value > 0 ? std::min(value, 255.0f) + 0.5f : 0.0f);
}

/// As the tile compositor lights a plain color.
uint8_t lit(Texel value, int rest, int light) {
  const int lit = rest + (((static_cast<int>(value) - rest) * light + 128) >> 8);
  return static_cast<uint8_t>(std::clamp(lit, 0, 255));
}

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
  while (probes < kMaxProbes &&
         longest >= static_cast<float>((probes + 1) * (probes + 1)) * shortest)
    ++probes;
  constexpr std::array<float, kMaxProbes> kShares = {1.0f, 1 / 4.0f, 1 / 9.0f, 1 / 16.0f};
  // The square's logarithm is twice the length's.
  const float depth =
      std::clamp(0.5f * rough_log2(longest * kShares[static_cast<size_t>(probes - 1)]), 0.0f,
                 static_cast<float>(levels.size() - 1));
  // Half of the way from one level to the next shows one of them alone, which costs half.
  auto level = static_cast<size_t>(depth);
  const float between = std::clamp(2 * (depth - static_cast<float>(level)) - 0.5f, 0.0f, 1.0f);
  auto share = static_cast<uint32_t>(between * 256.0f);
  if (share == 256) ++level, share = 0;
  constexpr std::array<float, kMaxProbes> kHalfSteps = {1 / 2.0f, 1 / 4.0f, 1 / 6.0f, 1 / 8.0f};
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
  Eigen::Vector3f light;  ///< object's frame
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
                  (rotation.transpose() * Eigen::Vector3d(kLightX, kLightY, kLightZ)).cast<float>(),
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
  const double over = 1 / (total != 0 ? total : 1);
  std::array<Eigen::Vector3f, 3> share;
  for (size_t i = 0; i < 3; ++i) share[i] = (over * weight[i]).cast<float>();
  const auto sum = [&](float p, float q, float r) {
    const Eigen::Vector3f s = p * share[0] + q * share[1] + r * share[2];
    return Linear{s.x(), s.y(), s.z()};
  };
  face.number = number;
  face.origin_x = ray_x;
  face.origin_y = ray_y;
  face.weight = sum(1, 1, 1);
  face.luminance = mesh.luminance[number];
  const float side = volume > 0 ? -1.0f : 1.0f;  // seen from behind, as in FacePlanes
  const Eigen::Vector3f own(mesh.normal_x[number], mesh.normal_y[number], mesh.normal_z[number]);
  face.flat = std::max(0.0f, side * own.dot(view.light));
  if (view.smooth) {
    std::array<Eigen::Vector3f, 3> n;
    for (size_t i = 0; i < 3; ++i)
      n[i] = side * mesh.corner_normals[mesh.face_corner_normals[number][i]];
    for (int k = 0; k < 3; ++k)
      face.normal[static_cast<size_t>(k)] = sum(n[0][k], n[1][k], n[2][k]);
    face.towards = sum(n[0].dot(view.light), n[1].dot(view.light), n[2].dot(view.light));
  }
  if (!view.textured) return;
  const FacePaint& paint = mesh.paint[number];
  const auto& [p, q, r] = paint.places;
  const auto& [a, b, c] = paint.colors;
  face.texture =
      paint.texture < 0 ? nullptr : mesh.textures[static_cast<size_t>(paint.texture)].get();
  if (face.texture != nullptr) {
    face.colors = {sum(p.x(), q.x(), r.x()), sum(p.y(), q.y(), r.y()), {}};
  } else {
    face.colors = {sum(a.y, b.y, c.y), sum(a.u, b.u, c.u), sum(a.v, b.v, c.v)};
  }
}

/// Cosine between the surface and the light, 0 where it looks away.
float SurfaceShader::lambert_at(const Face& face, bool smooth, float dx, float dy) {
  if (!smooth) return face.flat;
  float square = 0;
  for (const Linear& axis : face.normal) {
    const float n = axis.at(dx, dy);
    square += n * n;
  }
  // Normals that cancel one another say nothing.
  if (!(square > 1e-12f)) return face.flat;
  return std::min(std::max(0.0f, face.towards.at(dx, dy) / std::sqrt(square)), 1.0f);
}

/// The mesh's own color. `right` and `down`: the rays of the pixels beside this one, from it.
Texel SurfaceShader::color_at(const Face& face, float dx, float dy, const Eigen::Vector2f& right,
                              const Eigen::Vector2f& down) {
  const float weight = face.weight.at(dx, dy);
  const float over = weight > 1e-6f ? 1 / weight : 1.0f;
  const float x = face.colors[0].at(dx, dy) * over;
  const float y = face.colors[1].at(dx, dy) * over;
  if (face.texture == nullptr) {
    const float z = face.colors[2].at(dx, dy) * over;
    return Texel{to_byte(x)} | Texel{to_byte(y)} << 8 | Texel{to_byte(z)} << 16;
  }
  constexpr float kFarthest = 1e6f;
  if (!(std::abs(x) < kFarthest && std::abs(y) < kFarthest))
    return sample_texture(*face.texture, {0, 0}, {0, 0}, {0, 0});
  // d(place) / d(ray) = (numerator' - place * weight') / weight.
  const auto moved = [&](const Eigen::Vector2f& step) -> Eigen::Vector2f {
    if (!(std::abs(step.x()) + std::abs(step.y()) < 1)) return Eigen::Vector2f::Zero();
    const float less = face.weight.a * step.x() + face.weight.b * step.y();
    return {(face.colors[0].a * step.x() + face.colors[0].b * step.y() - x * less) * over,
            (face.colors[1].a * step.x() + face.colors[1].b * step.y() - y * less) * over};
  };
  return sample_texture(*face.texture, {x, y}, moved(right), moved(down));
}

void SurfaceShader::shade_row(const View& view, int y, RasterTile& tile) {
  const uint32_t* const numbers = tile.face(y);
  uint8_t* const shades = tile.shade(y);
  const int frame_y = tile.rect().y + y;
  const auto ray = [&](int row_of_frame, int x) -> Eigen::Vector2f {
    return {rays_->x_row(row_of_frame)[tile.rect().x + x],
            rays_->y_row(row_of_frame)[tile.rect().x + x]};
  };
  // In the last row the one above tells the size of a pixel: beyond the image there are no rays.
  const int next = frame_y + 1 < rays_->height() ? frame_y + 1 : std::max(frame_y - 1, 0);
  const auto ambient = static_cast<float>(kAmbient);
  for (int x = 0; x < tile.width(); ++x) {
    const uint32_t number = numbers[x];
    if (number == RasterTile::kNoFace) continue;
    const Eigen::Vector2f here = ray(frame_y, x);
    Face& face = faces_[number % kKept];
    if (face.number != number) set_up(view, number, here.x(), here.y(), face);
    const float dx = here.x() - face.origin_x, dy = here.y() - face.origin_y;
    const float level = ambient + (1 - ambient) * lambert_at(face, view.smooth, dx, dy);
    if (!view.textured) {
      shades[x] = static_cast<uint8_t>(255.0f * level * face.luminance + 0.5f);
      continue;
    }
    shades[x] = static_cast<uint8_t>(255.0f * level + 0.5f);
    const int light = light_of(shades[x]);
    const Texel color = color_at(face, dx, dy, ray(frame_y, x + 1) - here, ray(next, x) - here);
    const size_t at = row(y) + static_cast<size_t>(x);
    planes_[0][at] = lit(color & 255u, kUnlit[0], light);
    planes_[1][at] = lit(color >> 8 & 255u, kUnlit[1], light);
    planes_[2][at] = lit(color >> 16 & 255u, kUnlit[2], light);
  }
}

}  // namespace sightline
