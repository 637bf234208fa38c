// SPDX-License-Identifier: Apache-2.0
// The CPU rasterizer alone: a bumpy torus about as large as the tile, camera A of the tests.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <cmath>

#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline {
namespace {

CameraModel camera() {
  CameraModel::Parameters p;
  p.width = 1280;
  p.height = 720;
  p.fx = p.fy = 900;
  p.cx = 640;
  p.cy = 360;
  p.distortion = {-0.35, 0.12, 3e-4, -2e-4};
  return CameraModel::create(p, "bench").value();
}

const std::shared_ptr<const RayTable>& rays() {
  static const auto table = RayTable::build(camera());
  return table;
}

Rigid3 pose(double object_px, double radius, int step) {
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(0.05 * step, Eigen::Vector3d(1, 2, 3).normalized()));
  const double depth = 900 * 2 * radius / object_px;
  return {turn, Eigen::Vector3d(-0.1, 0.05, 1) * depth};
}

/// Tile of the given size around the object, cleared and drawn.
void draw_torus(benchmark::State& state, RasterKernel kernel) {
  const auto faces = static_cast<size_t>(state.range(0));
  const int size = static_cast<int>(state.range(1));
  const RenderMesh mesh = make_render_mesh(make_bumpy_torus(faces, 0.1f));
  MeshRasterizer rasterizer(rays(), kernel);
  RasterTile tile;
  int step = 0;
  size_t exact = 0;
  for (auto _ : state) {
    const Rigid3 camera_from_object = pose(0.9 * size, 0.1, ++step);
    const Eigen::Vector2d at = camera().project(camera_from_object.translation).value();
    const int x = std::max(0, static_cast<int>(at.x()) - size / 2) & ~1;
    const int y = std::max(0, static_cast<int>(at.y()) - size / 2) & ~1;
    tile.reset({x, y, size, size});
    benchmark::DoNotOptimize(rasterizer.draw(mesh, camera_from_object, tile));
    benchmark::ClobberMemory();
    exact += rasterizer.exact_pixels();
  }
  state.counters["faces"] = static_cast<double>(mesh.faces.size());
  state.counters["exact_px"] =
      benchmark::Counter(static_cast<double>(exact), benchmark::Counter::kAvgIterations);
}
void BM_Torus(benchmark::State& state) { draw_torus(state, RasterKernel::kAuto); }
void BM_TorusScalar(benchmark::State& state) { draw_torus(state, RasterKernel::kScalar); }
BENCHMARK(BM_Torus)
    ->ArgsProduct({{1000, 10000, 100000, 1000000}, {128, 256, 512}})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_TorusScalar)
    ->ArgsProduct({{1000, 10000, 100000}, {256}})
    ->Unit(benchmark::kMicrosecond);

/// A box of 12 triangles that fills most of a 400 px tile, with its tile found first.
void BM_Box(benchmark::State& state) {
  const RenderMesh mesh = make_render_mesh(make_box({0.1f, 0.12f, 0.14f}));
  MeshRasterizer rasterizer(rays());
  RasterTile tile;
  int step = 0;
  for (auto _ : state) {
    rasterizer.render(mesh, pose(400, 0.1, ++step), 8, tile);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(BM_Box)->Unit(benchmark::kMicrosecond);

void BM_Bounds(benchmark::State& state) {
  const RenderMesh mesh = make_render_mesh(make_box({0.1f, 0.12f, 0.14f}));
  const MeshRasterizer rasterizer(rays());
  int step = 0;
  for (auto _ : state) benchmark::DoNotOptimize(rasterizer.bounds(mesh, pose(256, 0.1, ++step), 8));
}
BENCHMARK(BM_Bounds)->Unit(benchmark::kMicrosecond);

void BM_BoxEdges(benchmark::State& state) {
  const RenderMesh mesh = make_render_mesh(make_box({0.1f, 0.12f, 0.14f}));
  MeshRasterizer rasterizer(rays());
  RasterTile tile;
  const Rigid3 camera_from_object = pose(256, 0.1, 7);
  rasterizer.render(mesh, camera_from_object, 8, tile);
  std::vector<EdgeSegment> edges;
  for (auto _ : state) {
    edges.clear();
    visible_edges(*rays(), mesh, camera_from_object, tile, edges);
    benchmark::DoNotOptimize(edges.data());
  }
  state.counters["pieces"] = static_cast<double>(edges.size());
}
BENCHMARK(BM_BoxEdges)->Unit(benchmark::kMicrosecond);

void BM_RayTable(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(RayTable::build(camera()));
}
BENCHMARK(BM_RayTable)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sightline
