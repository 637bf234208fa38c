// SPDX-License-Identifier: Apache-2.0
// Smooth shading and textures: the mesh's paint, the tile's faces, the shader of both.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "render/overlay_scene.hpp"
#include "render/random_scenes.hpp"
#include "render/raster/face_planes.hpp"
#include "render/test_images.hpp"
#include "sightline/render/mesh/level_of_detail.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"
#include "sightline/render/raster/raster.hpp"
#include "sightline/render/raster/surface_shader.hpp"

namespace sightline {
namespace {

using test::Dice;

/// An image whose pixels are made by a function of x and y.
template <typename Make>
std::shared_ptr<const SurfaceTexture> texture(int width, int height, const Make& make) {
  Image image(width, height);
  const MutableI420View view = image.mutable_view();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Yuv c = make(x, y);
      view.y.row(y)[x] = c.y;
      view.u.row(y / 2)[x / 2] = c.u;
      view.v.row(y / 2)[x / 2] = c.v;
    }
  }
  return std::make_shared<const SurfaceTexture>(as_const(view));
}

/// A square of side 2 `half` in the plane z = 0, seen from -z, in one texture.
RenderMesh textured_square(float half, std::shared_ptr<const SurfaceTexture> of,
                           float repeats = 1) {
  TriangleMesh mesh;
  mesh.vertices = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
  mesh.faces = {{0, 2, 1}, {0, 3, 2}};
  RenderMesh out = make_render_mesh(finish_mesh(std::move(mesh), "square").value());
  MeshSurface surface;
  for (const auto& f : out.faces) {
    SurfaceTriangle triangle;
    for (size_t k = 0; k < 3; ++k) {
      triangle.corners[k] = out.vertex(f[k]).cast<float>();
      triangle.places[k] =
          repeats * (triangle.corners[k].head<2>() / (2 * half) + Eigen::Vector2f::Constant(0.5f));
      // Place y counts upwards in mesh files: image rows grow with the square's y.
      triangle.places[k].y() = 1 - triangle.places[k].y();
    }
    triangle.corner_colors.fill({0.5f, 0.5f, 0.5f});
    triangle.texture = 0;
    surface.triangles.push_back(triangle);
  }
  paint_mesh(surface, {std::move(of)}, out);
  return out;
}

/// One mesh in a tile of its own, faces numbered and shaded.
struct Shaded {
  RasterTile tile;
  SurfaceShader shader;

  Shaded(const std::shared_ptr<const RayTable>& rays, const RenderMesh& mesh, const Rigid3& pose,
         Shading shading, bool textured, RasterKernel kernel = RasterKernel::kAuto)
      : shader(rays) {
    MeshRasterizer rasterizer(rays, kernel);
    tile.reset(rasterizer.bounds(mesh, pose, 4), true);
    EXPECT_TRUE(rasterizer.draw(mesh, pose, tile).has_value());
    shader.run(mesh, pose, shading, textured, tile);
  }
  template <typename Visit>
  void for_each_pixel(const Visit& visit) const {
    for (int y = 0; y < tile.height(); ++y) {
      for (int x = 0; x < tile.width(); ++x) {
        if (tile.face(y)[x] != RasterTile::kNoFace) visit(x, y);
      }
    }
  }
};

/// Where a pixel's ray meets the plane of its face: weights of the corners, in double precision.
Eigen::Vector3d true_weights(const RayTable& rays, const RenderMesh& mesh, const Rigid3& pose,
                             uint32_t face, int px, int py) {
  const Eigen::Vector2d ray = rays.exact_ray(px, py).value();
  Eigen::Matrix3d corners;
  for (int k = 0; k < 3; ++k)
    corners.col(k) = pose * mesh.vertex(mesh.faces[face][static_cast<size_t>(k)]);
  const Eigen::Vector3d weights = corners.inverse() * ray.homogeneous();
  return weights / weights.sum();
}

TEST(RasterTileFaces, AreTheSameInBothKernelsAndBesideTheSameDepth) {
  Dice dice(31);
  size_t shown = 0;
  for (int i = 0; i < 25; ++i) {
    const auto rays = RayTable::build(test::random_lens(dice));
    const std::vector<RenderMesh> meshes = test::random_meshes(dice);
    const RenderMesh& mesh = meshes[static_cast<size_t>(i) % meshes.size()];
    const Rigid3 pose = test::random_pose(dice, rays->model(), mesh);
    RasterTile plain;
    MeshRasterizer(rays).render(mesh, pose, 4, plain);
    const Shaded fast(rays, mesh, pose, Shading::kFlat, false);
    const Shaded scalar(rays, mesh, pose, Shading::kFlat, false, RasterKernel::kScalar);
    size_t covered = 0;
    for (int y = 0; y < plain.height(); ++y) {
      for (int x = 0; x < plain.width(); ++x) {
        ASSERT_EQ(plain.inverse_depth(y)[x], fast.tile.inverse_depth(y)[x]);
        ASSERT_EQ(plain.inverse_depth(y)[x] > 0, fast.tile.face(y)[x] != RasterTile::kNoFace);
        ASSERT_EQ(scalar.tile.face(y)[x], fast.tile.face(y)[x]);
        if (plain.inverse_depth(y)[x] > 0) ++covered;
        // Flat shading comes to the same, whoever does it.
        ASSERT_NEAR(plain.shade(y)[x], fast.tile.shade(y)[x], 1) << "scene " << i;
      }
    }
    shown += covered;
  }
  EXPECT_GT(shown, 25u * 2000);
}

TEST(SurfaceShader, SmoothShadeIsThatOfADoublePrecisionRay) {
  Dice dice(17);
  size_t pixels = 0, wrong = 0;
  for (int i = 0; i < 18; ++i) {
    const auto rays = RayTable::build(test::random_lens(dice));
    const RenderMesh mesh =
        i % 3 == 0 ? make_render_mesh(test::make_open_box())
                   : make_render_mesh(make_bumpy_torus(i % 3 == 1 ? 300 : 5000, 0.15f));
    const Rigid3 pose = test::random_pose(dice, rays->model(), mesh);
    const Shaded shaded(rays, mesh, pose, Shading::kSmooth, false);
    const Eigen::Vector3d light =
        pose.rotation.conjugate() * Eigen::Vector3d(kLightX, kLightY, kLightZ);
    shaded.for_each_pixel([&](int x, int y) {
      if ((x + y) % 7 != 0) return;
      const uint32_t face = shaded.tile.face(y)[x];
      const Eigen::Vector3d w =
          true_weights(*rays, mesh, pose, face, shaded.tile.rect().x + x, shaded.tile.rect().y + y);
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        const uint32_t at = mesh.face_corner_normals[face][static_cast<size_t>(k)];
        normal += w[k] * mesh.corner_normals[at].cast<double>();
      }
      const FacePlanes planes =
          make_face_planes(mesh, pose.rotation_matrix(), pose.translation, face);
      const double side = planes.turned ? -1 : 1;
      const double level =
          kAmbient + (1 - kAmbient) * std::max(0.0, side * normal.normalized().dot(light));
      const double wanted = 255 * level * double{mesh.luminance[face]};
      ++pixels;
      if (std::abs(wanted - shaded.tile.shade(y)[x]) > 1) ++wrong;
    });
  }
  EXPECT_GT(pixels, 12'000u);
  // Slivers beside the camera know their corners less well.
  EXPECT_LE(wrong, pixels / 2000) << wrong << " of " << pixels;
}

TEST(SurfaceShader, CreasesStaySharpAndRoundSurfacesAreRound) {
  const auto rays = RayTable::build(test::camera(test::lens_a()));
  const Rigid3 pose(Dice(2).rotation(), {0, 0, 0.6});
  const RenderMesh box = make_render_mesh(make_box({0.2f, 0.2f, 0.2f}));
  std::map<uint32_t, std::pair<int, int>> of_face;  // least and most shade
  const Shaded sharp(rays, box, pose, Shading::kSmooth, false);
  const Shaded flat(rays, box, pose, Shading::kFlat, false);
  sharp.for_each_pixel(
      [&](int x, int y) { EXPECT_NEAR(sharp.tile.shade(y)[x], flat.tile.shade(y)[x], 1); });
  // A tube of sixteen sides, 22.5 degrees at each edge.
  const auto tube = [](float crease_angle) {
    TriangleMesh mesh;
    for (int i = 0; i < 16; ++i) {
      const double a = 2 * std::numbers::pi * i / 16;
      for (const float z : {-0.1f, 0.1f})
        mesh.vertices.emplace_back(static_cast<float>(0.1 * std::cos(a)),
                                   static_cast<float>(0.1 * std::sin(a)), z);
    }
    for (uint32_t i = 0; i < 16; ++i) {
      const uint32_t a = 2 * i, b = 2 * ((i + 1) % 16);
      mesh.faces.push_back({a, b, b + 1});
      mesh.faces.push_back({a, b + 1, a + 1});
    }
    MeshOptions options;
    options.crease_angle = crease_angle;
    return make_render_mesh(finish_mesh(std::move(mesh), "tube", options).value());
  };
  const auto shades_inside_a_face = [&](const RenderMesh& mesh) {
    of_face.clear();
    const Shaded shaded(rays, mesh, pose, Shading::kSmooth, false);
    shaded.for_each_pixel([&](int x, int y) {
      const auto at = of_face.try_emplace(shaded.tile.face(y)[x], 255, 0).first;
      at->second.first = std::min<int>(at->second.first, shaded.tile.shade(y)[x]);
      at->second.second = std::max<int>(at->second.second, shaded.tile.shade(y)[x]);
    });
    int max = 0;
    for (const auto& [face, range] : of_face) max = std::max(max, range.second - range.first);
    return max;
  };
  EXPECT_GT(shades_inside_a_face(tube(0.6f)), 15);
  EXPECT_LE(shades_inside_a_face(tube(0.3f)), 1);
}

/// Luma says x and u says y of the texture's place; seen at a slant through a strong lens, the
/// color of every pixel is that of the place where its ray meets the square.
TEST(SurfaceShader, TexturesAreInPerspectiveThroughTheLens) {
  const auto ramp = texture(256, 256, [](int x, int y) {
    return Yuv{static_cast<uint8_t>(x), static_cast<uint8_t>(y & ~1), 128};
  });
  const RenderMesh square = textured_square(0.2f, ramp);
  for (const CameraModel::Parameters& lens : {test::lens_a(), test::lens_rational()}) {
    const auto rays = RayTable::build(test::camera(lens));
    const Rigid3 pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitY()) *
                                         Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX())),
                      {0.02, 0.01, 0.55});
    const Shaded shaded(rays, square, pose, Shading::kFlat, true);
    size_t compared = 0;
    shaded.for_each_pixel([&](int x, int y) {
      const uint32_t face = shaded.tile.face(y)[x];
      const Eigen::Vector3d w = true_weights(*rays, square, pose, face, shaded.tile.rect().x + x,
                                             shaded.tile.rect().y + y);
      Eigen::Vector3d at = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k)
        at += w[k] * square.vertex(square.faces[face][static_cast<size_t>(k)]);
      // Texels are pixels of 1/256 with their color in the middle.
      const double wanted_x = (at.x() / 0.4 + 0.5) * 256 - 0.5;
      const double wanted_y = (at.y() / 0.4 + 0.5) * 256 - 1;
      if (wanted_x < 8 || wanted_x > 247 || wanted_y < 8 || wanted_y > 246) return;
      const int light = 80 + (175 * shaded.tile.shade(y)[x] >> 8);
      EXPECT_NEAR(shaded.shader.luma(y)[x], 16 + (wanted_x - 16) * light / 256, 2);
      EXPECT_NEAR(shaded.shader.u(y)[x], 128 + (wanted_y - 128) * light / 256, 2.5);
      EXPECT_NEAR(shaded.shader.v(y)[x], 128, 1);
      ++compared;
    });
    EXPECT_GT(compared, 20'000u);
  }
}

/// A chequered texture of single texels, far away: every pixel is the mean of many, whatever the
/// pose. Without the smaller copies a pixel would be black or white.
TEST(SurfaceShader, FineTexturesDoNotShimmer) {
  const auto chequered = texture(512, 512, [](int x, int y) {
    return Yuv{static_cast<uint8_t>((x + y) % 2 == 0 ? 16 : 235), 128, 128};
  });
  const RenderMesh square = textured_square(0.2f, chequered, 4);
  const auto rays = RayTable::build(test::camera(test::lens_a()));
  int min = 255, max = 0;
  for (int step = 0; step < 8; ++step) {
    const Rigid3 pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY())),
                      {2e-4 * step, 1e-4 * step, 1.0});
    const Shaded shaded(rays, square, pose, Shading::kFlat, true);
    shaded.for_each_pixel([&](int x, int y) {
      min = std::min<int>(min, shaded.shader.luma(y)[x]);
      max = std::max<int>(max, shaded.shader.luma(y)[x]);
    });
  }
  EXPECT_LE(max - min, 12);
  EXPECT_GT(min, 60);
}

TEST(SurfaceTexture, SmallerCopiesKeepTheMean) {
  for (const auto& [width, height] : {std::pair{64, 32}, {37, 53}, {2, 2}, {301, 4}}) {
    const auto made = texture(width, height, [&](int x, int y) {
      return Yuv{static_cast<uint8_t>(16 + 219 * ((x * 7 + y * 3) % 11) / 10), 90,
                 static_cast<uint8_t>(x < width / 2 ? 90 : 160)};
    });
    const auto mean = [](const SurfaceTexture::Level& level) {
      double sum = 0;
      for (const SurfaceTexture::Texel t : level.texels) sum += t & 255u;
      return sum / static_cast<double>(level.texels.size());
    };
    const double whole = mean(made->levels().front());
    for (const auto& level : made->levels()) {
      EXPECT_EQ(level.texels.size(), static_cast<size_t>(level.width * level.height));
      EXPECT_NEAR(mean(level), whole, 1.6) << width << "x" << height << " at " << level.width;
    }
    EXPECT_EQ(made->levels().back().texels.size(), 1u);
  }
  const auto large = texture(4100, 6, [](int, int) { return Yuv{77, 100, 150}; });
  EXPECT_LE(large->levels().front().width, SurfaceTexture::kMaxPixels);
  for (const SurfaceTexture::Texel t : large->levels().front().texels)
    ASSERT_EQ(t, 77u | 100u << 8 | 150u << 16);
}

TEST(SurfaceTexture, Repeats) {
  Dice dice(5);
  const auto noise = texture(32, 16, [&](int, int) {
    return Yuv{static_cast<uint8_t>(dice.uniform(16, 235)), 128, 128};
  });
  const Eigen::Vector2f right(1 / 64.0f, 0), down(0, 1 / 32.0f);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2f place(static_cast<float>(dice.uniform(0, 1)),
                                static_cast<float>(dice.uniform(0, 1)));
    const Eigen::Vector2f further = place + Eigen::Vector2f(-3, 2);
    const auto a = static_cast<int>(sample_texture(*noise, place, right, down) & 255u);
    const auto b = static_cast<int>(sample_texture(*noise, further, right, down) & 255u);
    EXPECT_NEAR(a, b, 1);
    // A pixel that shows all of it sees the mean.
    const auto all = sample_texture(*noise, place, {1, 0}, {0, 1}) & 255u;
    EXPECT_NEAR(static_cast<int>(all), 125, 12);
  }
}

TEST(PaintMesh, FacesTakeTheColorsOfTheirPlace) {
  RenderMesh mesh = make_render_mesh(make_box({0.2f, 0.2f, 0.2f}));
  MeshSurface surface;
  // In another order and turned around.
  for (size_t f = mesh.faces.size(); f-- > 0;) {
    SurfaceTriangle t;
    for (size_t k = 0; k < 3; ++k) {
      t.corners[k] = mesh.vertex(mesh.faces[f][(k + 1) % 3]).cast<float>();
      t.corner_colors[k] = 0.5f * Eigen::Vector3f::Ones() + 4 * t.corners[k];
      t.places[k].setZero();
    }
    surface.triangles.push_back(t);
  }
  paint_mesh(surface, {}, mesh);
  ASSERT_EQ(mesh.paint.size(), mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d rgb =
          255 * (0.5 * Eigen::Vector3d::Ones() + 4 * mesh.vertex(mesh.faces[f][k]))
                    .cwiseMax(0.0)
                    .cwiseMin(1.0);
      const Yuv wanted = to_yuv({static_cast<uint8_t>(std::lround(rgb.x())),
                                 static_cast<uint8_t>(std::lround(rgb.y())),
                                 static_cast<uint8_t>(std::lround(rgb.z()))});
      EXPECT_NEAR(mesh.paint[f].colors[k].y, wanted.y, 1);
      EXPECT_NEAR(mesh.paint[f].colors[k].u, wanted.u, 1);
      EXPECT_EQ(mesh.paint[f].texture, -1);
    }
  }
  paint_mesh({}, {}, mesh);
  EXPECT_TRUE(mesh.paint.empty());
}

/// What lies on a face keeps its color to itself: the middle of the large triangle is as near to
/// the back of the label as to the triangle's own paint.
TEST(PaintMesh, ALabelDoesNotPaintWhatItLiesOn) {
  const auto triangle = [](float size, float z, bool back) {
    std::array<Eigen::Vector3f, 3> corners = {Eigen::Vector3f{-size, -size, z},
                                              Eigen::Vector3f{size, -size, z},
                                              Eigen::Vector3f{0, size, z}};
    if (back) std::swap(corners[1], corners[2]);
    return corners;
  };
  TriangleMesh shapes;
  MeshSurface surface;
  const auto add = [&](const std::array<Eigen::Vector3f, 3>& corners, float red) {
    const auto first = static_cast<uint32_t>(shapes.vertices.size());
    shapes.vertices.insert(shapes.vertices.end(), corners.begin(), corners.end());
    shapes.faces.push_back({first, first + 1, first + 2});
    SurfaceTriangle t;
    t.corners = corners;
    t.corner_colors.fill({red, 0, 0});
    for (auto& place : t.places) place.setZero();
    surface.triangles.push_back(t);
  };
  add(triangle(0.02f, 0, true), 1);  // the label's back and front
  add(triangle(0.02f, 0.001f, false), 1);
  add(triangle(0.1f, 0, false), 0);
  RenderMesh mesh = make_render_mesh(shapes);
  paint_mesh(surface, {}, mesh);
  ASSERT_EQ(mesh.paint.size(), 3u);
  for (size_t f = 0; f < 3; ++f) {
    const bool large = std::abs(mesh.vertex(mesh.faces[f][0]).x()) > 0.05;
    const Yuv wanted = to_yuv({static_cast<uint8_t>(large ? 0 : 255), 0, 0});
    EXPECT_EQ(mesh.paint[f].colors[0].v, wanted.v) << f;
  }
}

/// A torus in a texture that says where on the ring a place is; it is cut at angle 0, where the
/// coarser copies must not smear one end over the other.
TEST(PaintMesh, CoarserLevelsKeepTheTexture) {
  const auto ramp = texture(256, 4, [](int x, int) {
    return Yuv{static_cast<uint8_t>(x), 128, 128};
  });
  RenderMesh torus = make_render_mesh(make_bumpy_torus(10'000, 0.1f));
  MeshSurface surface;
  for (const auto& f : torus.faces) {
    SurfaceTriangle t;
    float max = 0;
    for (size_t k = 0; k < 3; ++k) {
      t.corners[k] = torus.vertex(f[k]).cast<float>();
      const float turn =
          std::atan2(t.corners[k].y(), t.corners[k].x()) / (2 * std::numbers::pi_v<float>);
      // Vertices on the cut are at either end, by the face.
      t.places[k] = {turn < -1e-4f ? turn + 1 : std::max(turn, 0.0f), 0.5f};
      max = std::max(max, t.places[k].x());
    }
    for (auto& place : t.places) {
      if (max > 0.5f && place.x() < 1e-4f) place.x() = 1;
    }
    t.corner_colors.fill({0.5f, 0.5f, 0.5f});
    t.texture = 0;
    surface.triangles.push_back(t);
  }
  paint_mesh(surface, {ramp}, torus);
  const LevelOfDetail levels(std::make_shared<const RenderMesh>(torus));
  ASSERT_GE(levels.levels().size(), 4u);
  const auto rays = RayTable::build(test::camera(test::lens_a()));
  const Rigid3 pose(Dice(9).rotation(), {0, 0, 0.5});
  const Shaded full(rays, torus, pose, Shading::kSmooth, true);
  for (const auto& level : levels.levels()) {
    ASSERT_EQ(level.mesh->paint.size(), level.mesh->faces.size());
    for (const FacePaint& paint : level.mesh->paint) {
      ASSERT_EQ(paint.texture, 0);
      float low = 1, high = 0;
      for (const auto& place : paint.places) {
        low = std::min(low, place.x());
        high = std::max(high, place.x());
      }
      EXPECT_LT(high - low, 0.2f);
    }
    RasterTile tile;
    tile.reset(full.tile.rect(), true);
    MeshRasterizer rasterizer(rays);
    ASSERT_TRUE(rasterizer.draw(*level.mesh, pose, tile).has_value());
    SurfaceShader shader(rays);
    shader.run(*level.mesh, pose, Shading::kSmooth, true, tile);
    double off = 0;
    size_t both = 0;
    full.for_each_pixel([&](int x, int y) {
      if (tile.face(y)[x] == RasterTile::kNoFace) return;
      off += std::abs(int{shader.luma(y)[x]} - int{full.shader.luma(y)[x]});
      ++both;
    });
    ASSERT_GT(both, 5000u);
    EXPECT_LT(off / static_cast<double>(both), 4) << level.mesh->faces.size() << " faces";
  }
}

/// A red and a blue half, drawn opaque: the image shows them, behind the wall it does not.
TEST(CameraRenderer, TexturedFillShowsTheMeshsOwnColors) {
  const Yuv red = to_yuv({230, 40, 40}), blue = to_yuv({40, 60, 230});
  const auto halves = texture(64, 64, [&](int x, int) { return x < 32 ? red : blue; });
  test::OverlayScene scene(322, 241);
  scene.mesh = std::make_shared<const RenderMesh>(textured_square(0.12f, halves));
  OverlayStyle style = test::only({"fill", "outline"});
  style.fill_kind = FillKind::kTextured;
  style.fill_opacity = 1;
  const Rigid3 pose(Eigen::Quaterniond::Identity(), {0, 0, 0.8});
  const PoseTrackPtr track = test::track_of({test::estimate_at(pose, TrackState::kTracking)});
  test::GrayImage image(322, 241, 128);
  test::Nv12Image other(322, 241, 128);
  std::vector<PoseAt> poses;
  const auto draw = [&] {
    (*scene.try_renderer(style))
        ->draw(image.mutable_view(), time_from_ns(test::kCapture), std::span(&track, 1), poses);
    (*scene.try_renderer(style))
        ->draw(other.mutable_view(), time_from_ns(test::kCapture), std::span(&track, 1), poses);
  };
  draw();
  EXPECT_TRUE(test::same_pixels(image.view(), other.view()));
  const auto chroma_at = [&](double x, double y) {
    const auto pixel = scene.camera.model.project(pose * Eigen::Vector3d(x, y, 0)).value();
    const int column = static_cast<int>(pixel.x()) / 2, row = static_cast<int>(pixel.y()) / 2;
    return std::pair{int{image.view().u.row(row)[column]}, int{image.view().v.row(row)[column]}};
  };
  // Under the light, so paler by at most its share.
  EXPECT_LT(chroma_at(-0.06, 0).first, 122);
  EXPECT_GT(chroma_at(-0.06, 0).second, 170);
  EXPECT_GT(chroma_at(0.06, 0).first, 170);
  EXPECT_LT(chroma_at(0.06, 0).second, 125);
  scene.build_wall({0.3, 0, 0.5}, {0.6f, 1.0f, 0.01f});
  image.clear(128);
  draw();
  const Yuv hidden = to_yuv(style.xray_color);
  EXPECT_GT(chroma_at(-0.06, 0).second, 170);
  EXPECT_NEAR(chroma_at(0.06, 0).first, 128 + 0.4 * (hidden.u - 128), 25);
  EXPECT_GT(chroma_at(0.06, 0).second, 132);
}

/// Out of the image on every side of a frame of odd size: nothing is read beside it.
TEST(CameraRenderer, TexturedFillAtTheFramesEdges) {
  const auto plain = texture(8, 8, [](int, int) { return Yuv{120, 90, 170}; });
  test::OverlayScene scene(161, 121);
  scene.mesh = std::make_shared<const RenderMesh>(textured_square(0.12f, plain));
  OverlayStyle style = test::only({"fill"});
  style.fill_kind = FillKind::kTextured;
  style.shading = Shading::kSmooth;
  style.fill_opacity = 1;
  for (const double x : {-0.3, 0.0, 0.3}) {
    for (const double y : {-0.25, 0.0, 0.25}) {
      const PoseTrackPtr track = test::track_of({test::estimate_at(
          {Eigen::Quaterniond::Identity(), {x, y, 0.5}}, TrackState::kTracking)});
      test::GrayImage image(161, 121, 128);
      std::vector<PoseAt> poses;
      (*scene.try_renderer(style))
          ->draw(image.mutable_view(), time_from_ns(test::kCapture), std::span(&track, 1), poses);
      size_t covered = 0;
      for (int row = 0; row < image.view().u.height; ++row) {
        for (int column = 0; column < image.view().u.width; ++column) {
          const int u = image.view().u.row(row)[column];
          ASSERT_LE(u, 129);
          ASSERT_GE(u, 88);
          if (u < 110) ++covered;
        }
      }
      EXPECT_GT(covered, 30u) << x << ", " << y;
    }
  }
}

}  // namespace
}  // namespace sightline
