// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/raster.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "render/raster/face_planes.hpp"
#include "render/raster/raster_kernels.hpp"
#include "render/raster/space_box.hpp"
#include "sightline/base/check.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline {
namespace {

using raster::DrawJob;
using raster::Kernels;
using raster::ProjectedVertex;
using raster::Target;
using raster::Triangle;

const Kernels& choose(RasterKernel requested) {
  if (requested == RasterKernel::kScalar) return raster::scalar_kernels();
  const Kernels* const fast = raster::avx2_kernels();
  const bool possible = fast != nullptr && cpu_has_avx2();
  SL_CHECK(requested != RasterKernel::kAvx2 || possible, "AVX2 asked of a processor without it");
  return possible && requested != RasterKernel::kVector ? *fast : raster::vector_kernels();
}

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr RayTable::RayBounds kNoRays{kInf, -kInf, kInf, -kInf};

void grow(RayTable::RayBounds& all, const RayTable::RayBounds& b) {
  if (b.empty()) return;
  all = {std::min(all.min_x, b.min_x), std::max(all.max_x, b.max_x), std::min(all.min_y, b.min_y),
         std::max(all.max_y, b.max_y)};
}

/// Bounds of the rays under a rectangle, rounded out to whole blocks.
RayTable::RayBounds ray_bounds(const RayTable& rays, const TileRect& rect) {
  constexpr int kBlock = RayTable::kBlock;
  RayTable::RayBounds all = kNoRays;
  for (int row = rect.y / kBlock; row <= (rect.y + rect.height - 1) / kBlock; ++row) {
    for (int column = rect.x / kBlock; column <= (rect.x + rect.width - 1) / kBlock; ++column)
      grow(all, rays.block(column, row));
  }
  return all;
}

}  // namespace

struct MeshRasterizer::Scratch {
  explicit Scratch(const Kernels& k) : kernels(k) {}

  const Kernels& kernels;
  const raster::PixelKernels* pixels = nullptr;
  std::vector<ProjectedVertex> vertices;
  std::vector<uint32_t> front, deferred;

  // Of the draw() under way.
  const RayTable* rays = nullptr;
  const RenderMesh* mesh = nullptr;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  TileRect rect;
  RayTable::RayBounds bounds{};
  Target target{};
  size_t exact_pixels = 0;

  bool decide(uint32_t face, int x, int y);
  void draw_carefully(uint32_t face, const DrawJob& job);
  bool careful_box(uint32_t face, bool clipped, TileRect& box) const;
  void draw_blocks(const FacePlanes& planes, bool near, const TileRect& box,
                   const Triangle& paint) const;
};

bool MeshRasterizer::Scratch::decide(uint32_t face, int x, int y) {
  ++exact_pixels;
  const int px = rect.x + x;
  const int py = rect.y + y;
  if (px >= rays->width() || py >= rays->height()) return false;
  const auto ray = rays->exact_ray(px, py);
  if (!ray) return false;
  const FacePlanes planes = make_face_planes(*mesh, rotation, translation, face);
  if (!planes.valid || (planes.turned && mesh->cull_back_faces)) return false;
  return planes.hit_by(*ray);
}

/// Tile pixels that the face can touch. Not `clipped`: all corners are in front and inside the
/// lens, so the box is that of their pixels grown by how far the lens can bend an edge. Otherwise
/// the whole tile, unless the face's rays miss it altogether.
bool MeshRasterizer::Scratch::careful_box(uint32_t face, bool clipped, TileRect& box) const {
  std::array<const ProjectedVertex*, 3> v{};
  for (size_t k = 0; k < 3; ++k) v[k] = &vertices[mesh->faces[face][k]];
  const auto [x_min, x_max] = std::minmax({v[0]->x, v[1]->x, v[2]->x});
  const auto [y_min, y_max] = std::minmax({v[0]->y, v[1]->y, v[2]->y});
  box = {0, 0, rect.width, rect.height};
  const bool behind = ((v[0]->flags | v[1]->flags | v[2]->flags) & raster::kBehind) != 0;
  if (!behind && (x_min > double{bounds.max_x} || x_max < double{bounds.min_x} ||
                  y_min > double{bounds.max_y} || y_max < double{bounds.min_y}))
    return false;
  if (clipped) return true;
  const double length2 = (x_max - x_min) * (x_max - x_min) + (y_max - y_min) * (y_max - y_min);
  double r_min = std::numeric_limits<double>::max();
  double r_max = 0;
  for (const ProjectedVertex* p : v) {
    const double r = std::hypot(p->x, p->y);
    r_min = std::min(r_min, r);
    r_max = std::max(r_max, r);
  }
  r_min = std::max(0.0, r_min - std::sqrt(length2));
  const double margin =
      double{rays->lookup().error_px} + 0.01 + rays->curvature_bound(r_min, r_max) * length2 / 6;
  const auto [u0, u1] = std::minmax({v[0]->u, v[1]->u, v[2]->u});
  const auto [v0, v1] = std::minmax({v[0]->v, v[1]->v, v[2]->v});
  const double left = std::max(0.0, std::ceil(double{u0} - margin));
  const double top = std::max(0.0, std::ceil(double{v0} - margin));
  const double right = std::min(rect.width - 1.0, std::floor(double{u1} + margin));
  const double bottom = std::min(rect.height - 1.0, std::floor(double{v1} + margin));
  if (!(left <= right && top <= bottom)) return false;
  box = {static_cast<int>(left), static_cast<int>(top), static_cast<int>(right - left) + 1,
         static_cast<int>(bottom - top) + 1};
  return true;
}

/// Row of blocks by row of blocks, from the first to the last block that the face can touch, in
/// pieces that have an origin of their own: near it float is precise, however steep the face.
void MeshRasterizer::Scratch::draw_blocks(const FacePlanes& planes, bool near, const TileRect& box,
                                          const Triangle& paint) const {
  constexpr int kBlock = RayTable::kBlock;
  constexpr int kPiece = 4;
  const int left = rect.x + box.x, right = left + box.width - 1;
  const int top = rect.y + box.y, bottom = top + box.height - 1;
  for (int row = top / kBlock; row <= bottom / kBlock; ++row) {
    int first = left / kBlock;
    int last = right / kBlock;
    while (first <= last && planes.misses(rays->block(first, row), near)) ++first;
    while (last > first && planes.misses(rays->block(last, row), near)) --last;
    const int y0 = std::max(row * kBlock, top) - rect.y;
    const int y1 = std::min(row * kBlock + kBlock - 1, bottom) - rect.y;
    for (int piece = first; piece <= last; piece += kPiece) {
      const int end = std::min(piece + kPiece - 1, last);
      RayTable::RayBounds under = kNoRays;
      for (int column = piece; column <= end; ++column) grow(under, rays->block(column, row));
      if (under.empty()) continue;
      Triangle t = make_triangle(planes, under, near);
      t.shade = paint.shade;
      t.face = paint.face;
      t.decide = paint.decide;
      t.context = paint.context;
      const int x0 = std::max(piece * kBlock, left) - rect.x;
      const int x1 = std::min(end * kBlock + kBlock - 1, right) - rect.x;
      (near ? pixels->rows_near : pixels->rows)(target, t, x0, y0, x1, y1);
    }
  }
}

/// Faces that are large in the image, cut by the near plane, or that reach beyond the lens.
void MeshRasterizer::Scratch::draw_carefully(uint32_t face, const DrawJob& job) {
  uint32_t flags = 0;
  for (const uint32_t v : mesh->faces[face]) flags |= vertices[v].flags;
  TileRect box;
  if (!careful_box(face, flags != 0, box)) return;
  const FacePlanes planes = make_face_planes(*mesh, rotation, translation, face);
  if (!planes.valid || (planes.turned && mesh->cull_back_faces)) return;
  const Eigen::Vector3d light(double{job.light_x}, double{job.light_y}, double{job.light_z});
  const double lambert = (planes.turned ? -1 : 1) * mesh->normal(face).dot(light);
  const double level = kAmbient + (1 - kAmbient) * std::max(0.0, lambert);
  Triangle paint{};
  paint.shade = static_cast<uint8_t>(255.0 * level * double{mesh->luminance[face]} + 0.5);
  paint.face = face;
  paint.decide = job.decide;
  paint.context = job.context;
  draw_blocks(planes, (flags & raster::kBehind) != 0, box, paint);
}

MeshRasterizer::MeshRasterizer(std::shared_ptr<const RayTable> rays, RasterKernel kernel)
    : rays_(std::move(rays)), scratch_(std::make_unique<Scratch>(choose(kernel))) {}

MeshRasterizer::~MeshRasterizer() = default;

TileRect MeshRasterizer::bounds(const RenderMesh& mesh, const Rigid3& camera_from_object,
                                int margin_px) const {
  return project_box(*rays_, mesh.min_corner.cast<double>(), mesh.max_corner.cast<double>(),
                     camera_from_object, margin_px);
}

void MeshRasterizer::render(const RenderMesh& mesh, const Rigid3& camera_from_object, int margin_px,
                            RasterTile& tile) {
  tile.reset(bounds(mesh, camera_from_object, margin_px));
  const Status drawn = draw(mesh, camera_from_object, tile);
  SL_CHECK(drawn.has_value(), "the CPU rasterizer does not fail");
}

Status MeshRasterizer::draw(const RenderMesh& mesh, const Rigid3& camera_from_object,
                            RasterTile& tile) {
  Scratch& s = *scratch_;
  exact_pixels_ = 0;
  const TileRect& rect = tile.rect();
  if (rect.empty() || mesh.faces.empty()) return {};
  SL_CHECK(rect.x >= 0 && rect.y >= 0 && rect.x + rect.width <= rays_->even_width() &&
               rect.y + rect.height <= rays_->even_height(),
           "the tile lies inside the frame");
  s.rays = rays_.get();
  s.mesh = &mesh;
  s.rotation = camera_from_object.rotation_matrix();
  s.translation = camera_from_object.translation;
  s.rect = rect;
  s.bounds = ray_bounds(*rays_, rect);
  if (s.bounds.empty()) return {};
  s.exact_pixels = 0;
  s.pixels = tile.has_faces() ? &s.kernels.faces : &s.kernels.shades;
  s.target = {.depth = tile.inverse_depth(0),
              .shade = tile.shade(0),
              .stride = tile.stride(),
              .face = tile.has_faces() ? tile.face(0) : nullptr,
              .ray_x = rays_->x_row(rect.y) + rect.x,
              .ray_y = rays_->y_row(rect.y) + rect.x,
              .ray_stride = rays_->stride(),
              .width = rect.width,
              .height = rect.height};
  if (s.vertices.size() < mesh.vertex_count()) s.vertices.resize(mesh.vertex_count());
  if (s.front.size() < mesh.faces.size()) {
    s.front.resize(mesh.faces.size());
    s.deferred.resize(mesh.faces.size());
  }
  project_vertices();
  DrawJob job = draw_job();
  job.count = list_faces();
  s.pixels->draw(job);
  for (size_t i = 0; i < job.deferred_count; ++i) s.draw_carefully(s.deferred[i], job);
  exact_pixels_ = s.exact_pixels;
  return {};
}

void MeshRasterizer::project_vertices() {
  Scratch& s = *scratch_;
  const RayTable::RadialLookup& lookup = rays_->lookup();
  raster::ProjectJob job{};
  job.x = s.mesh->x.data();
  job.y = s.mesh->y.data();
  job.z = s.mesh->z.data();
  job.count = s.mesh->vertex_count();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) job.rotation[3 * r + c] = s.rotation(r, c);
    job.translation[r] = s.translation[r];
  }
  job.near_z = kNearPlane;
  job.max_radius_squared =
      static_cast<float>(rays_->project_limit() * rays_->project_limit() * (1 - 1e-6));
  job.value = lookup.value.data();
  job.step = lookup.step.data();
  job.scale = lookup.scale;
  job.last_cell = static_cast<float>(RayTable::RadialLookup::kCells);
  job.p1 = lookup.p1;
  job.p2 = lookup.p2;
  job.fx = lookup.fx;
  job.fy = lookup.fy;
  job.cx = lookup.cx - static_cast<float>(s.rect.x);
  job.cy = lookup.cy - static_cast<float>(s.rect.y);
  job.out = s.vertices.data();
  s.kernels.project(job);
}

/// Faces that are not surely seen from behind; returns how many.
size_t MeshRasterizer::list_faces() {
  Scratch& s = *scratch_;
  const size_t count = s.mesh->faces.size();
  if (!s.mesh->cull_back_faces) {
    for (size_t i = 0; i < count; ++i) s.front[i] = static_cast<uint32_t>(i);
    return count;
  }
  const Eigen::Vector3d eye = -(s.rotation.transpose() * s.translation);
  const double extent = s.mesh->min_corner.cwiseAbs().cwiseMax(s.mesh->max_corner.cwiseAbs()).sum();
  raster::CullJob job{};
  job.normal_x = s.mesh->normal_x.data();
  job.normal_y = s.mesh->normal_y.data();
  job.normal_z = s.mesh->normal_z.data();
  job.offset = s.mesh->offset.data();
  job.count = count;
  job.eye_x = static_cast<float>(eye.x());
  job.eye_y = static_cast<float>(eye.y());
  job.eye_z = static_cast<float>(eye.z());
  job.tolerance = static_cast<float>(1e-6 * (eye.lpNorm<1>() + extent));
  job.out = s.front.data();
  return s.kernels.cull(job);
}

raster::DrawJob MeshRasterizer::draw_job() {
  Scratch& s = *scratch_;
  static_assert(sizeof(std::array<uint32_t, 3>) == sizeof(uint32_t[3]));
  DrawJob job{};
  job.target = s.target;
  job.vertices = s.vertices.data();
  job.faces = reinterpret_cast<const uint32_t(*)[3]>(s.mesh->faces.data());
  job.list = s.front.data();
  job.normal_x = s.mesh->normal_x.data();
  job.normal_y = s.mesh->normal_y.data();
  job.normal_z = s.mesh->normal_z.data();
  job.luminance = s.mesh->luminance.data();
  const Eigen::Vector3d light = s.rotation.transpose() * Eigen::Vector3d(kLightX, kLightY, kLightZ);
  job.light_x = static_cast<float>(light.x());
  job.light_y = static_cast<float>(light.y());
  job.light_z = static_cast<float>(light.z());
  job.ambient = static_cast<float>(kAmbient);
  job.cull = s.mesh->cull_back_faces;
  job.box_margin = rays_->lookup().error_px + 0.01f;
  job.bulge = static_cast<float>(rays_->curvature_bound(0, std::numeric_limits<double>::max()) / 6);
  job.reach_x = s.bounds.max_x - s.bounds.min_x;
  job.reach_y = s.bounds.max_y - s.bounds.min_y;
  job.largest_ray = std::max(std::max(std::abs(s.bounds.min_x), std::abs(s.bounds.max_x)),
                             std::max(std::abs(s.bounds.min_y), std::abs(s.bounds.max_y)));
  job.decide = [](void* context, uint32_t face, int x, int y) {
    return static_cast<Scratch*>(context)->decide(face, x, y);
  };
  job.context = &s;
  job.deferred = s.deferred.data();
  return job;
}

}  // namespace sightline
