// SPDX-License-Identifier: Apache-2.0
// The rasterizer against an independent ray cast: Embree, which knows nothing of tiles, edge
// functions or lenses but the rays that CameraModel::unproject() gives it.
#include <embree3/rtcore.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "render/random_scenes.hpp"
#include "render/ray_cast.hpp"

namespace sightline {
namespace {

using test::Dice;

/// One mesh at one pose. Embree computes in single precision; seen from the middle of the tile
/// (space sheared so that its ray points straight ahead) its rounding is far below a pixel.
class EmbreeScene {
 public:
  EmbreeScene(const RenderMesh& mesh, const Rigid3& pose, const Eigen::Vector2d& middle)
      : middle_(middle), device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.vertex_count()));
    for (uint32_t i = 0; i < mesh.vertex_count(); ++i) {
      const Eigen::Vector3d p = pose * mesh.vertex(i);
      const std::array<double, 3> sheared = {p.x() - middle.x() * p.z(), p.y() - middle.y() * p.z(),
                                             p.z()};
      for (size_t k = 0; k < 3; ++k) points[3 * i + k] = static_cast<float>(sheared[k]);
    }
    auto* corners = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(uint32_t), mesh.faces.size()));
    for (const auto& face : mesh.faces) corners = std::copy(face.begin(), face.end(), corners);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
    rtcInitIntersectContext(&context_);
    if (mesh.cull_back_faces) context_.filter = drop_back_faces;
  }
  ~EmbreeScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  /// 1/z of the nearest surface beyond the near plane; 0: none.
  double cast(const Eigen::Vector3d& ray) {
    const Eigen::Vector2d r = ray.head<2>() / ray.z() - middle_;
    RTCRayHit hit{};
    hit.ray.dir_x = static_cast<float>(r.x());
    hit.ray.dir_y = static_cast<float>(r.y());
    hit.ray.dir_z = 1;  // lengths along the ray are depths
    hit.ray.tnear = static_cast<float>(kNearPlane);
    hit.ray.tfar = std::numeric_limits<float>::infinity();
    hit.ray.mask = ~0u;
    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context_, &hit);
    return hit.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 0.0 : 1 / double{hit.ray.tfar};
  }

 private:
  /// Embree's normal is (v1 - v0) x (v2 - v0): along the ray means seen from behind.
  static void drop_back_faces(const RTCFilterFunctionNArguments* args) {
    for (unsigned i = 0; i < args->N; ++i) {
      if (args->valid[i] == 0) continue;
      const float along =
          RTCRayN_dir_x(args->ray, args->N, i) * RTCHitN_Ng_x(args->hit, args->N, i) +
          RTCRayN_dir_y(args->ray, args->N, i) * RTCHitN_Ng_y(args->hit, args->N, i) +
          RTCRayN_dir_z(args->ray, args->N, i) * RTCHitN_Ng_z(args->hit, args->N, i);
      if (along > 0) args->valid[i] = 0;
    }
  }

  Eigen::Vector2d middle_;
  RTCDevice device_;
  RTCScene scene_;
  RTCIntersectContext context_{};
};

struct Count {
  size_t covered = 0, mask = 0, depth = 0;
};

std::optional<Eigen::Vector3d> ray_of(const CameraModel& model, int x, int y) {
  auto ray = model.unproject({x, y});
  if (ray && ray->z() < std::cos(89.0 * std::numbers::pi / 180)) ray.reset();
  return ray;
}

/// Compares every second pixel in x and y of large tiles, every pixel of small ones.
void compare(const CameraModel& model, const RenderMesh& mesh, const Rigid3& pose,
             const RasterTile& tile, Count& sum) {
  const TileRect& t = tile.rect();
  if (t.empty()) return;
  const auto middle = ray_of(model, t.x + t.width / 2, t.y + t.height / 2);
  EmbreeScene scene(
      mesh, pose,
      middle ? Eigen::Vector2d(middle->head<2>() / middle->z()) : Eigen::Vector2d::Zero());
  const int step = t.width * t.height > 60'000 ? 2 : 1;
  for (int y = t.y; y < std::min(t.y + t.height, model.height()); y += step) {
    for (int x = t.x; x < std::min(t.x + t.width, model.width()); x += step) {
      const auto ray = ray_of(model, x, y);
      const double cast = ray ? scene.cast(*ray) : 0;
      const auto drawn = double{tile.inverse_depth(y - t.y)[x - t.x]};
      if (cast > 0) ++sum.covered;
      if ((drawn > 0) != (cast > 0)) {
        ++sum.mask;
      } else if (std::abs(drawn - cast) > 1e-3 * cast) {
        ++sum.depth;
      }
    }
  }
}

class EmbreeTest : public testing::TestWithParam<int> {
 protected:
  EmbreeTest() : model_(test::camera(parameters())), rasterizer_(RayTable::build(model_)) {}

  static CameraModel::Parameters parameters() {
    const std::array<CameraModel::Parameters, 6> all = {
        test::lens_a(),       test::lens_b(),        test::lens_c(),
        test::lens_fisheye(), test::lens_rational(), test::lens_folding()};
    return all[static_cast<size_t>(GetParam())];
  }
  Rigid3 somewhere(Dice& dice, const RenderMesh& mesh) const {
    const Eigen::Vector2d pixel(dice.uniform(0, model_.width()), dice.uniform(0, model_.height()));
    const double depth =
        2 * double{mesh.radius} * model_.parameters().fx / dice.uniform(60, 0.5 * model_.width());
    return test::pose_at(model_, pixel, depth, dice.rotation());
  }
  void check(const RenderMesh& mesh, const Rigid3& pose) {
    rasterizer_.render(mesh, pose, 2, tile_);
    compare(model_, mesh, pose, tile_, sum_);
  }
  /// At most one pixel of 10,000, in mask and in depth.
  void expect_agreement(const char* what, size_t min_covered) {
    std::printf("%s: %zu pixels, mask of %zu and depth of %zu differ\n", what, sum_.covered,
                sum_.mask, sum_.depth);
    EXPECT_GE(sum_.covered, min_covered);
    EXPECT_LE(sum_.mask, sum_.covered / 10'000);
    EXPECT_LE(sum_.depth, sum_.covered / 10'000);
  }

  CameraModel model_;
  MeshRasterizer rasterizer_;
  RasterTile tile_;
  Count sum_;
};

INSTANTIATE_TEST_SUITE_P(Lenses, EmbreeTest, testing::Range(0, 6),
                         [](const auto& lens) { return std::string(1, "ABCFRN"[lens.param]); });

TEST_P(EmbreeTest, BoxesAgreeInEveryPixel) {
  Dice dice(31);
  for (int i = 0; i < 16; ++i) {
    const auto side = [&] { return static_cast<float>(dice.uniform(0.05, 0.4)); };
    const RenderMesh mesh = make_render_mesh(make_box({side(), side(), side()}));
    check(mesh, somewhere(dice, mesh));
  }
  std::printf("boxes: %zu pixels\n", sum_.covered);
  EXPECT_GE(sum_.covered, 50'000u);
  EXPECT_EQ(sum_.mask, 0u);
  EXPECT_EQ(sum_.depth, 0u);
}

TEST_P(EmbreeTest, ConcaveMeshesAgree) {
  Dice dice(32);
  for (const size_t faces : {300u, 3000u, 30'000u}) {
    const RenderMesh mesh = make_render_mesh(make_bumpy_torus(faces, 0.15f));
    for (int i = 0; i < 3; ++i) check(mesh, somewhere(dice, mesh));
  }
  expect_agreement("concave", 30'000);
}

TEST_P(EmbreeTest, MeshesThatCutOneAnotherAgree) {
  Dice dice(33);
  for (int i = 0; i < 8; ++i) {
    const RenderMesh mesh = make_render_mesh(test::make_crossing_boxes(dice));
    check(mesh, somewhere(dice, mesh));
  }
  expect_agreement("cutting one another", 30'000);
}

TEST_P(EmbreeTest, MeshesCutByTheNearPlaneAgree) {
  Dice dice(34);
  const RenderMesh box = make_render_mesh(make_box({0.5f, 0.3f, 0.2f}));
  const RenderMesh torus = make_render_mesh(make_bumpy_torus(2000, 0.2f));
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d place(dice.uniform(-0.3, 0.3), dice.uniform(-0.3, 0.3),
                                dice.uniform(-0.1, 0.15));
    check(i % 2 == 0 ? box : torus, Rigid3(dice.rotation(), place));
  }
  expect_agreement("cut by the near plane", 20'000);
}

TEST_P(EmbreeTest, TheBarnAgrees) {
  Dice dice(35);
  const std::filesystem::path file =
      std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "tests/geometry/meshes/barn.3vn";
  const auto barn = read_mesh(file);
  ASSERT_TRUE(barn.has_value()) << barn.error().message();
  const RenderMesh mesh = make_render_mesh(*barn);
  for (int i = 0; i < 10; ++i) check(mesh, somewhere(dice, mesh));
  expect_agreement("barn", 20'000);
}

}  // namespace
}  // namespace sightline
