// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/viewpoint_model.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "sightline/base/files.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/random.hpp"
#include "support/ray_mesh.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::test {
namespace {

namespace fs = std::filesystem;

ViewpointModelOptions quick_options() {
  ViewpointModelOptions options;
  options.subdivisions = 1;
  options.image_px = 240;
  return options;
}

DepthRendererFactory factory_of(const TriangleMesh& mesh) {
  return mesh_depth_renderer_factory(std::make_shared<const RenderMesh>(make_render_mesh(mesh)));
}

std::shared_ptr<const ViewpointModel> model_of(const TriangleMesh& mesh,
                                               const ViewpointModelOptions& options) {
  return ViewpointModel::build(mesh, factory_of(mesh), options).value();
}

// What a ray from the view's camera through a point meets, by the renderer of the tests.
bool silhouette_at(const RayMesh& mesh, const View& view, const Eigen::Vector3f& point) {
  const Eigen::Vector3f camera = view.camera_from_object.inverse().translation.cast<float>();
  return mesh.cast(camera, point - camera).has_value();
}

// Share of the outline samples that lie on creases.
double crease_share(const TriangleMesh& mesh) {
  const auto model = model_of(mesh, quick_options());
  size_t samples = 0, creases = 0;
  for (size_t i = 0; i < model->size(); ++i) {
    for (const ContourSample& sample : model->view(i).contour) {
      ++samples;
      creases += sample.crease;
    }
  }
  return static_cast<double>(creases) / static_cast<double>(samples);
}

TEST(Creases, AreTheOutlineOfABoxAndNotOfASmoothBody) {
  EXPECT_GT(crease_share(make_box({0.1f, 0.06f, 0.2f})), 0.97);
  // There are creases where its limbs meet.
  EXPECT_LT(crease_share(make_creature(15'000)), 0.10);
}

class Outlines : public ::testing::TestWithParam<int> {
 protected:
  static TriangleMesh shape() {
    switch (GetParam()) {
      case 0:
        return make_carton();
      case 1:
        return make_creature(3000);
      case 2:
        return make_truck();
      default:
        return make_bumpy_torus(2000, 0.06f);
    }
  }
};

TEST_P(Outlines, LieOnTheMeshAndOnTheEdgeOfItsSilhouette) {
  const TriangleMesh mesh = shape();
  const RayMesh rays(mesh);
  const auto model = model_of(mesh, quick_options());
  // A pixel of the rendering, in the object.
  const float pixel = 2 * mesh.radius / 0.94f / 240;
  size_t samples = 0, good = 0;
  for (size_t i = 0; i < model->size(); i += 5) {
    const View view = model->view(i);
    ASSERT_GE(view.contour.size(), 100u);
    for (const ContourSample& sample : view.contour) {
      ++samples;
      ASSERT_NEAR(sample.normal.norm(), 1, 1e-3);
      const bool in = silhouette_at(rays, view, sample.point - 1.5f * pixel * sample.normal);
      const bool out = !silhouette_at(rays, view, sample.point + 1.5f * pixel * sample.normal);
      good += in && out ? 1 : 0;
    }
  }
  // The rest are at corners and tips, where there is no such thing as a normal.
  EXPECT_GT(static_cast<double>(good), 0.96 * static_cast<double>(samples));
}

TEST_P(Outlines, AreFreeAsFarAsTheySay) {
  const TriangleMesh mesh = shape();
  const RayMesh rays(mesh);
  const auto model = model_of(mesh, quick_options());
  const float pixel = 2 * mesh.radius / 0.94f / 240;
  size_t samples = 0, good = 0;
  for (size_t i = 2; i < model->size(); i += 7) {
    const View view = model->view(i);
    for (const ContourSample& s : view.contour) {
      ++samples;
      bool right = true;
      for (int k = 1; k < 6; ++k) {
        const float in = std::max(0.0f, s.foreground - 3 * pixel) * static_cast<float>(k) / 6;
        const float out = std::max(0.0f, s.background - 3 * pixel) * static_cast<float>(k) / 6;
        if (in > 2 * pixel) right &= silhouette_at(rays, view, s.point - in * s.normal);
        if (out > 2 * pixel) right &= !silhouette_at(rays, view, s.point + out * s.normal);
      }
      good += right ? 1 : 0;
    }
  }
  EXPECT_GT(static_cast<double>(good), 0.95 * static_cast<double>(samples));
}

TEST_P(Outlines, AreaAgreesWithTheMask) {
  const TriangleMesh mesh = shape();
  const auto model = model_of(mesh, quick_options());
  for (size_t i = 0; i < model->size(); ++i) {
    int cells = 0;
    for (const uint32_t row : model->mask(i)) cells += __builtin_popcount(row);
    const double cell = 2 * model->radius() / ViewpointModel::kMaskSize;
    EXPECT_NEAR(cells * cell * cell, model->view(i).area, 0.15 * model->view(i).area);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, Outlines, ::testing::Range(0, 4));

TEST(InnerEdges, OfABoxAreItsVisibleEdges) {
  const Eigen::Vector3f half(0.05f, 0.035f, 0.02f);
  const TriangleMesh mesh = make_box(2 * half);
  const auto model = model_of(mesh, quick_options());
  size_t edges = 0;
  for (size_t i = 0; i < model->size(); ++i) {
    const View view = model->view(i);
    const Eigen::Vector3f camera = view.camera_from_object.inverse().translation.cast<float>();
    for (const InnerEdgeSample& edge : view.edges) {
      if (edge.crease == 0) continue;  // what the rasterizer sees of a corner
      ++edges;
      int faces = 0, visible = 0;
      for (int axis = 0; axis < 3; ++axis) {
        if (std::abs(std::abs(edge.point[axis]) - half[axis]) > 1e-5f) continue;
        ++faces;
        const float side = edge.point[axis] > 0 ? 1.0f : -1.0f;
        visible += side * camera[axis] > half[axis] ? 1 : 0;
      }
      EXPECT_GE(faces, 2);
      EXPECT_GE(visible, 2) << "an edge inside the silhouette of a box has both faces in sight";
      EXPECT_NEAR(edge.tangent.cwiseAbs().maxCoeff(), 1, 1e-5);
    }
  }
  EXPECT_GT(edges, model->size() * 20);
}

TEST(NearestView, IsTheNearest) {
  ViewpointModelOptions options = quick_options();
  options.subdivisions = 2;
  options.contour_samples = 20;
  const auto model = model_of(make_carton(), options);
  Random random(7);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d direction = random.normal<3>().normalized();
    double best = -2;
    for (size_t k = 0; k < model->size(); ++k) {
      best = std::max(best, direction.dot(model->view(k).direction.cast<double>()));
    }
    const size_t found = model->nearest(direction);
    EXPECT_NEAR(direction.dot(model->view(found).direction.cast<double>()), best, 1e-6);
  }
  const View view = model->view(33);
  EXPECT_EQ(model->nearest(view.camera_from_object), 33u);
}

TEST(Neighbors, AreFiveOrSixAndMutual) {
  const auto model = model_of(make_carton(), quick_options());
  int fives = 0;
  for (size_t i = 0; i < model->size(); ++i) {
    const auto next = model->neighbors(i);
    fives += next.size() == 5 ? 1 : 0;
    for (const uint16_t k : next) {
      const auto back = model->neighbors(k);
      EXPECT_NE(std::find(back.begin(), back.end(), i), back.end());
    }
  }
  EXPECT_EQ(fives, 12);
}

TEST(Options, OutOfRangeAreRefusedByName) {
  const TriangleMesh mesh = make_carton();
  const auto refused = [&](auto change, const char* name) {
    ViewpointModelOptions options = quick_options();
    change(options);
    const auto made = ViewpointModel::build(mesh, factory_of(mesh), options);
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(made.error().text.find(name), std::string::npos) << made.error().text;
  };
  refused([](auto& o) { o.subdivisions = 5; }, "subdivisions");
  refused([](auto& o) { o.contour_samples = 3; }, "contour_samples");
  refused([](auto& o) { o.edge_samples = -1; }, "edge_samples");
  refused([](auto& o) { o.image_px = 10; }, "image_px");
  refused([](auto& o) { o.distance_radii = 1; }, "distance_radii");
  refused([](auto& o) { o.crease_angle = 0; }, "crease_angle");
  refused([](auto& o) { o.depth_jump = std::nan(""); }, "depth_jump");
}

class Cache : public ::testing::Test {
 protected:
  Cache() : folder_(fs::temp_directory_path() / ("views-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    options_.subdivisions = 0;
    options_.contour_samples = 30;
  }
  ~Cache() override { fs::remove_all(folder_); }

  std::shared_ptr<const ViewpointModel> load() {
    return ViewpointModel::load_or_build(mesh_, factory_of(mesh_), options_, folder_).value();
  }
  fs::path file() const {
    return folder_ / ViewpointModel::cache_name(ViewpointModel::key(mesh_, options_));
  }
  void write(const std::string& content) { ASSERT_TRUE(write_file_atomically(file(), content)); }

  fs::path folder_;
  TriangleMesh mesh_ = make_bracket();
  ViewpointModelOptions options_;
};

TEST_F(Cache, KeepsEveryByte) {
  const std::string made = load()->serialize();
  EXPECT_EQ(read_file(file()).value(), made);
  EXPECT_EQ(load()->serialize(), made);
  EXPECT_EQ(model_of(mesh_, options_)->serialize(), made);
}

TEST_F(Cache, IsMadeAnewWhenDamagedAnywhere) {
  const std::string made = load()->serialize();
  const uint64_t key = ViewpointModel::key(mesh_, options_);
  for (size_t at = 0; at < made.size(); at += at < 200 ? 1 : 997) {
    std::string damaged = made;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_FALSE(ViewpointModel::parse(damaged, key, "test")) << "byte " << at;
  }
  for (size_t length = 0; length < made.size(); length += 501) {
    EXPECT_FALSE(ViewpointModel::parse(made.substr(0, length), key, "test"));
  }
  EXPECT_FALSE(ViewpointModel::parse(made + "x", key, "test"));
  write(made.substr(0, made.size() / 2));
  EXPECT_EQ(load()->serialize(), made);
  EXPECT_EQ(read_file(file()).value(), made) << "the good one takes its place";
}

TEST_F(Cache, OfAnotherObjectIsNotBelieved) {
  TriangleMesh other = mesh_;
  for (auto& vertex : other.vertices) vertex *= 1.5f;
  other = finish_mesh(other, "test").value();
  const std::string foreign = model_of(other, options_)->serialize();
  fs::create_directories(folder_);
  write(foreign);
  const auto model = load();
  EXPECT_NEAR(model->radius(), static_cast<double>(mesh_.radius), 1e-9);
}

TEST_F(Cache, KeyDependsOnMeshAndOptions) {
  const uint64_t key = ViewpointModel::key(mesh_, options_);
  ViewpointModelOptions finer = options_;
  finer.crease_angle = 0.4;
  EXPECT_NE(ViewpointModel::key(mesh_, finer), key);
  TriangleMesh moved = mesh_;
  moved.vertices.front().x() += 1e-4f;
  EXPECT_NE(ViewpointModel::key(moved, options_), key);
}

TEST_F(Cache, IsNotNeeded) {
  std::ofstream(folder_) << "a file where the folder should be";
  EXPECT_EQ(load()->size(), 12u);
  folder_.clear();
  EXPECT_EQ(load()->size(), 12u);
}

}  // namespace
}  // namespace sightline::test
