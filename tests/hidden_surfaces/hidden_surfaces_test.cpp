// SPDX-License-Identifier: Apache-2.0
// The methods that the bench compares, on cases small enough to try every face for every pixel.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <string>

#include "hidden_surfaces/exact.hpp"
#include "hidden_surfaces/method.hpp"

namespace sightline::hidden_surfaces {
namespace {

Picture truth_of(const Scene& scene) {
  Picture truth(scene.tile());
  const Tile& tile = truth.tile;
  for (int y = tile.y; y < tile.y + tile.height; ++y) {
    for (int x = tile.x; x < tile.x + tile.width; ++x) truth.at(x, y) = nearest_face(scene, x, y);
  }
  return truth;
}

size_t seen_of(const Scene& scene, const Picture& picture, int owner) {
  return static_cast<size_t>(std::ranges::count_if(picture.face, [&](int32_t face) {
    return face >= 0 && scene.faces[static_cast<size_t>(face)].owner == owner;
  }));
}

size_t wrong_of(Method& method, const Scene& scene, Picture& truth) {
  Picture drawn(scene.tile());
  method.prepare(scene);
  method.draw(scene, drawn);
  EXPECT_GT(method.bytes(), 0u) << method.name();
  return wrong_pixels(scene, drawn, truth);
}

// All but the painter's, whose order is right for some scenes only.
void expect_exact(const Scene& scene) {
  Picture truth = truth_of(scene);
  ASSERT_GT(seen_of(scene, truth, 0), 100u) << scene.name;
  ASSERT_GT(seen_of(scene, truth, 1), 100u) << scene.name;
  for (const auto& method : all_methods()) {
    if (method->name() == "painter's") continue;
    EXPECT_EQ(wrong_of(*method, scene, truth), 0u) << method->name() << ", " << scene.name;
  }
}

TEST(HiddenSurfaces, AgreeOnTheBarn) { expect_exact(make_scene("barn", SIGHTLINE_MESHES)); }

TEST(HiddenSurfaces, AgreeOnATorusWithABarThroughItsHole) {
  expect_exact(make_torus_scene("torus", 400, 128));
}

TEST(HiddenSurfaces, AgreeOnBoxesThatPierceEachOther) { expect_exact(make_pierced_scene()); }

TEST(HiddenSurfaces, AgreeOnTrianglesAnywhere) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-0.3, 0.3), depth(0.9, 1.5);
  for (int turn = 0; turn < 5; ++turn) {
    Scene scene{"triangles " + std::to_string(turn), {320, 240, 250}, {}};
    for (int i = 0; i < 40; ++i) {
      Face face;
      face.owner = i % 2;
      for (auto& corner : face.corner) corner = {place(random), place(random), depth(random)};
      if (!face.seen_from_front()) std::swap(face.corner[0], face.corner[1]);
      scene.faces.push_back(face);
    }
    expect_exact(scene);
  }
}

TEST(HiddenSurfaces, ThePainterIsRightForWhatHasAnOrderAndWrongForWhatHasNone) {
  const auto painter = make_painter();
  Scene apart{"one before the other", {320, 240, 250}, {}};
  for (const int owner : {0, 1}) {
    const double z = owner == 0 ? 2 : 1, side = owner == 0 ? 0.5 : 0.1;
    Face face;
    face.owner = owner;
    face.corner = {Eigen::Vector3d(-side, -0.71 * side, z), Eigen::Vector3d(-side, 0.63 * side, z),
                   Eigen::Vector3d(side, -0.57 * side, z)};  // no pixel center on an edge
    apart.faces.push_back(face);
  }
  Picture truth = truth_of(apart);
  EXPECT_EQ(wrong_of(*painter, apart, truth), 0u);
  const Scene pierced = make_pierced_scene();
  truth = truth_of(pierced);
  EXPECT_GT(wrong_of(*painter, pierced, truth), 100u);
}

TEST(HiddenSurfaces, TheReferenceSeesWhatTryingEveryFaceSees) {
  const Scene scene = make_torus_scene("torus", 400, 96);
  Picture exact = exact_picture(scene);
  EXPECT_EQ(wrong_pixels(scene, truth_of(scene), exact), 0u);
}

TEST(HiddenSurfaces, WrongPixelsAreFound) {
  const Scene scene = make_pierced_scene();
  Picture truth = truth_of(scene);
  Picture nothing(scene.tile());
  EXPECT_EQ(wrong_pixels(scene, nothing, truth),
            seen_of(scene, truth, 0) + seen_of(scene, truth, 1));
}

}  // namespace
}  // namespace sightline::hidden_surfaces
