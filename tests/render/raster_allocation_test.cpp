// SPDX-License-Identifier: Apache-2.0
// A program of its own: it replaces the global allocator with one that counts.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "render/render_support.hpp"
#include "sightline/render/raster/raster.hpp"

namespace {

std::atomic<long> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  void* p = nullptr;
  if (posix_memalign(&p, alignment < sizeof(void*) ? sizeof(void*) : alignment,
                     size == 0 ? 1 : size) != 0)
    throw std::bad_alloc();
  return p;
}

}  // namespace

// The compiler does not see that new and delete are replaced together.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"

void* operator new(std::size_t size) { return counted(size, alignof(std::max_align_t)); }
void* operator new[](std::size_t size) { return counted(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t a) {
  return counted(size, static_cast<std::size_t>(a));
}
void* operator new[](std::size_t size, std::align_val_t a) {
  return counted(size, static_cast<std::size_t>(a));
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace sightline {
namespace {

TEST(RasterAllocation, NoneOnceWarm) {
  const CameraModel model = test::camera(test::lens_a());
  const auto rays = RayTable::build(model);
  const RenderMesh torus = make_render_mesh(make_bumpy_torus(2000, 0.1f));
  const RenderMesh box = make_render_mesh(make_box({0.1f, 0.2f, 0.3f}));
  MeshRasterizer rasterizer(rays);
  RasterTile tile;
  std::vector<EdgeSegment> edges;
  edges.reserve(100'000);
  test::Dice dice(1);
  const auto frame = [&](const RenderMesh& mesh, double depth) {
    const Eigen::Vector2d pixel(dice.uniform(0, 1280), dice.uniform(0, 720));
    const Rigid3 pose = test::pose_at(model, pixel, depth, dice.rotation());
    rasterizer.render(mesh, pose, 8, tile);
    edges.clear();
    visible_edges(*rays, mesh, pose, tile, edges);
  };
  frame(torus, 0.01);
  tile.reset(test::whole_frame(*rays));
  const long before = allocations;
  for (int i = 0; i < 100; ++i) frame(i % 2 == 0 ? torus : box, dice.uniform(0.05, 2));
  EXPECT_EQ(allocations - before, 0);
}

}  // namespace
}  // namespace sightline
