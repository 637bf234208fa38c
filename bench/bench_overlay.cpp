// SPDX-License-Identifier: Apache-2.0
// One camera's overlay, everything included: pose lookup, tile raster, comparison with the static
// scene, outline, fill, oriented box, label, blend into I420 in place. The object is a bumpy torus
// about 256 px wide, its left half behind a wall. Figures: docs/performance.md.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <memory>
#include <vector>

#include "sightline/geometry/mesh.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/image.hpp"
#include "sightline/render/mesh/level_of_detail.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline {
namespace {

constexpr double kRadius = 0.1;
constexpr double kObjectPx = 256;

CalibratedCamera camera(int height) {
  CameraModel::Parameters p;
  p.width = height * 16 / 9;
  p.height = height;
  p.fx = p.fy = 900;  // the same at both sizes, so that the object's image is the same
  p.cx = 0.5 * p.width;
  p.cy = 0.5 * p.height;
  p.distortion = {-0.10, 0.05, 3e-4, -2e-4};
  return {"bench", CameraModel::create(p, "bench").value(), Rigid3(), 0.3};
}

/// Rays and the wall's depth of one image size.
struct Rig {
  CalibratedCamera calibrated;
  std::shared_ptr<const RayTable> rays;
  std::shared_ptr<const StaticDepth> depth;

  explicit Rig(int height) : calibrated(camera(height)), rays(RayTable::build(calibrated.model)) {
    const RenderMesh wall = make_render_mesh(make_box({0.5f, 1.0f, 0.01f}));
    const SceneMesh placed{&wall,
                           Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.25, 0, 0.4))};
    depth = StaticDepth::build(rays, Rigid3(), std::span(&placed, 1));
  }
};

const Rig& rig(int height) {
  static const Rig hd(720);
  static const Rig full_hd(1080);
  return height == 720 ? hd : full_hd;
}

/// The object at step k, in the middle of the image, turning.
PoseTrackPtr track(int k) {
  PoseEstimate estimate;
  estimate.time = time_from_ns(k);
  estimate.last_measured = estimate.time;
  estimate.state = TrackState::kTracking;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.05 * k, Eigen::Vector3d(1, 2, 3).normalized()));
  estimate.world_from_object =
      Rigid3(turn, Eigen::Vector3d(0.01 * std::sin(0.1 * k), 0, 900 * 2 * kRadius / kObjectPx));
  estimate.covariance.diagonal().setConstant(1e-6);
  return std::make_shared<PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{});
}

/// A texture of 1024 x 1024 with print on it.
std::shared_ptr<const SurfaceTexture> stripes() {
  Image image(1024, 1024);
  const MutableI420View to = image.mutable_view();
  for (int y = 0; y < 1024; ++y) {
    for (int x = 0; x < 1024; ++x) to.y.row(y)[x] = (x / 8 + y / 16) % 2 == 0 ? 60 : 200;
  }
  for (int y = 0; y < 512; ++y) {
    for (int x = 0; x < 512; ++x) to.u.row(y)[x] = to.v.row(y)[x] = x % 64 < 32 ? 100 : 150;
  }
  return std::make_shared<const SurfaceTexture>(image.view());
}

/// The mesh printed from above.
MeshSurface printed(const RenderMesh& mesh) {
  MeshSurface surface;
  for (const auto& f : mesh.faces) {
    SurfaceTriangle triangle;
    for (size_t k = 0; k < 3; ++k) {
      triangle.corners[k] = mesh.vertex(f[k]).cast<float>();
      triangle.places[k] = triangle.corners[k].head<2>() / static_cast<float>(2 * kRadius) +
                           Eigen::Vector2f::Constant(0.5f);
    }
    triangle.corner_colors.fill(Eigen::Vector3f::Constant(0.5f));
    triangle.texture = 0;
    surface.triangles.push_back(triangle);
  }
  return surface;
}

/// Made once a size: a benchmark runs its function several times.
const std::shared_ptr<const RenderMesh>& torus(size_t faces) {
  static std::map<size_t, std::shared_ptr<const RenderMesh>> made;
  auto& mesh = made[faces];
  if (mesh == nullptr) {
    RenderMesh prepared = make_render_mesh(make_bumpy_torus(faces, static_cast<float>(kRadius)));
    paint_mesh(printed(prepared), {stripes()}, prepared);
    mesh = std::make_shared<const RenderMesh>(std::move(prepared));
  }
  return mesh;
}

std::shared_ptr<const LevelOfDetail> levels_of(const std::shared_ptr<const RenderMesh>& mesh) {
  static std::map<const RenderMesh*, std::shared_ptr<const LevelOfDetail>> made;
  auto& levels = made[mesh.get()];
  if (levels == nullptr) levels = std::make_shared<const LevelOfDetail>(mesh);
  return levels;
}

OverlayStyle full_style() {
  OverlayStyle style;
  style.circle = false;
  style.box3d = true;
  return style;
}

double thread_cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

/// Frames per iteration set: medians need single frames, so each iteration is one frame.
void overlay(benchmark::State& state, const OverlayStyle& style, bool copy,
             RasterChoice backend = RasterChoice::kCpu, bool simplified = true) {
  const int height = static_cast<int>(state.range(0));
  const auto faces = static_cast<size_t>(state.range(1));
  const Rig& at = rig(height);
  const std::shared_ptr<const RenderMesh> mesh = torus(faces);
  RenderOptions options;
  options.backend = backend;
  const auto levels = simplified ? levels_of(mesh) : nullptr;
  auto created = CameraRenderer::create(at.calibrated, CameraId(0),
                                        {{ObjectId(0), "torus", mesh, style, levels}}, at.rays,
                                        at.depth, options);
  if (!created) {
    state.SkipWithError(created.error().message().c_str());
    return;
  }
  const auto renderer = *std::move(created);
  Image frame(at.calibrated.model.width(), height);
  Image out(at.calibrated.model.width(), height);
  std::vector<PoseTrackPtr> tracks;
  for (int k = 0; k < 128; ++k) tracks.push_back(track(k));
  std::vector<PoseAt> poses;
  std::vector<double> times;
  int k = 0;
  for (auto _ : state) {
    const double start = thread_cpu_ms();
    if (copy) copy_i420(frame.view(), out.mutable_view());
    renderer->draw(out.mutable_view(), time_from_ns(k),
                   std::span(&tracks[static_cast<size_t>(k)], 1), poses);
    times.push_back(thread_cpu_ms() - start);
    k = (k + 1) % 128;
  }
  std::ranges::sort(times);
  state.counters["min_ms"] = times.front();
  state.counters["median_ms"] = times[times.size() / 2];
  state.counters["p99_ms"] = times[times.size() * 99 / 100];
  state.counters["faces"] = static_cast<double>(mesh->faces.size());
  if (levels != nullptr) {
    const PoseAt& pose = poses.front();
    state.counters["drawn"] = static_cast<double>(
        levels->choose(at.rays->model(), pose.estimate.world_from_object, options.detail_px)
            .faces.size());
  }
}

void everything(benchmark::State& state) { overlay(state, full_style(), false); }
void everything_and_frame_copy(benchmark::State& state) { overlay(state, full_style(), true); }
/// Every style that exists, at once.
void every_style(benchmark::State& state) {
  OverlayStyle style;
  for (const std::string_view name : style_names()) *style_flag(style, name) = true;
  overlay(state, style, false);
}
void everything_full_mesh(benchmark::State& state) {
  overlay(state, full_style(), false, RasterChoice::kCpu, false);
}
void everything_on_egl(benchmark::State& state) {
  overlay(state, full_style(), false, RasterChoice::kEgl);
}
void smooth(benchmark::State& state) {
  OverlayStyle style = full_style();
  style.shading = Shading::kSmooth;
  overlay(state, style, false);
}
void textured(benchmark::State& state) {
  OverlayStyle style = full_style();
  style.shading = Shading::kSmooth;
  style.fill_kind = FillKind::kTextured;
  overlay(state, style, false);
}
void default_style(benchmark::State& state) { overlay(state, OverlayStyle{}, false); }

/// One style alone, at 720p and 10k triangles.
void style_alone(benchmark::State& state, const char* name) {
  OverlayStyle style = bare_style();
  *style_flag(style, name) = true;
  overlay(state, style, false);
}

BENCHMARK(everything)
    ->ArgNames({"height", "faces"})
    ->ArgsProduct({{720, 1080}, {1000, 10000, 100000, 1000000}});
BENCHMARK(every_style)
    ->ArgNames({"height", "faces"})
    ->ArgsProduct({{720, 1080}, {1000, 10000, 100000}});
BENCHMARK(everything_full_mesh)
    ->ArgNames({"height", "faces"})
    ->ArgsProduct({{720, 1080}, {1000, 10000, 100000, 1000000}});
BENCHMARK(everything_and_frame_copy)
    ->ArgNames({"height", "faces"})
    ->ArgsProduct({{720, 1080}, {1000, 10000, 100000}});
BENCHMARK(everything_on_egl)
    ->ArgNames({"height", "faces"})
    ->ArgsProduct({{720, 1080}, {1000, 10000, 100000}});
BENCHMARK(smooth)->ArgNames({"height", "faces"})->ArgsProduct({{720, 1080}, {1000, 10000, 100000}});
BENCHMARK(textured)
    ->ArgNames({"height", "faces"})
    ->ArgsProduct({{720, 1080}, {1000, 10000, 100000}});
BENCHMARK(default_style)->ArgNames({"height", "faces"})->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, circle, "circle")->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, box2d, "box2d")->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, box3d, "box3d")->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, outline, "outline")->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, fill, "fill")->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, wireframe, "wireframe")->Args({720, 10000});
BENCHMARK_CAPTURE(style_alone, label, "label")->Args({720, 10000});

}  // namespace
}  // namespace sightline
