// SPDX-License-Identifier: Apache-2.0
// What leads a search besides edges: borders of regions, and the colors of the mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "observe/detect/colors/mesh_colors.hpp"
#include "observe/detect/colors/pose_pool.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/pixels/region_borders.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using test::turned;

HalfSizeImage flat_image(uint8_t level) {
  HalfSizeImage image;
  image.width = 64;
  image.height = 48;
  for (auto& plane : image.planes) plane.assign(64 * 48, 128);
  std::fill(image.planes[0].begin(), image.planes[0].end(), level);
  return image;
}

void paint_columns(HalfSizeImage& image, size_t plane, int begin, int end, uint8_t level) {
  for (int y = 0; y < image.height; ++y) {
    uint8_t* row = image.planes[plane].data() + y * image.width;
    std::fill(row + begin, row + end, level);
  }
}

struct Edges {
  explicit Edges(const HalfSizeImage& image) {
    edges.compute(image);
    borders.compute(image, edges);
  }
  // Edge pixels of the rows in the middle, away from the ends of the image.
  static size_t count(const std::vector<uint8_t>& bins) {
    return static_cast<size_t>(std::count_if(bins.begin() + 64 * 12, bins.begin() + 64 * 36,
                                             [](int bin) { return bin != 0; }));
  }
  EdgeImage edges;
  RegionBorders borders;
};

TEST(RegionBorders, AStepIsOneAndALineIsNone) {
  HalfSizeImage step = flat_image(90);
  paint_columns(step, 0, 32, 64, 150);
  const Edges at_step(step);
  EXPECT_GT(Edges::count(at_step.edges.bins()), 20u);
  EXPECT_EQ(Edges::count(at_step.borders.bins()), Edges::count(at_step.edges.bins()));

  HalfSizeImage line = flat_image(90);
  paint_columns(line, 0, 31, 33, 150);
  const Edges at_line(line);
  EXPECT_GT(Edges::count(at_line.edges.bins()), 20u);
  EXPECT_EQ(Edges::count(at_line.borders.bins()), 0u)
      << "both sides are the same, a little farther";
}

TEST(RegionBorders, ColorAloneIsEnough) {
  HalfSizeImage color = flat_image(90);
  paint_columns(color, 2, 32, 64, 150);
  const Edges at_color(color);
  EXPECT_GT(Edges::count(at_color.borders.bins()), 20u);
}

TEST(RegionBorders, WhatReachesOverTheBorderOfTheImageCounts) {
  HalfSizeImage image = flat_image(90);
  paint_columns(image, 0, 0, 3, 150);
  const Edges edges(image);
  EXPECT_GT(Edges::count(edges.edges.bins()), 20u);
  EXPECT_EQ(edges.borders.bins(), edges.edges.bins());
}

struct Search {
  Search()
      : mesh(test::make_truck()),
        rig(test::search_scene(mesh, test::resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01})))),
        truth(rig.truth(rig.shots().front().true_capture)),
        bank(test::views_of(mesh)),
        frames(test::detector_cameras(rig), {}),
        templates(bank, test::samples_of(mesh)) {
    test::add_first_frames(
        rig, [&](CameraId id, const Frame& frame) { frames.add(id, frame, nullptr); });
    EXPECT_TRUE(frames.select(DetectorFrames::Where::kEverywhere));
    std::vector<const HalfSizeImage*> images;
    for (const FitCamera& camera : frames.fit_cameras()) images.push_back(camera.image);
    colors = std::make_unique<const MeshColors>(bank, templates, frames.search_cameras(), images,
                                                run_serially);
  }
  Rigid3 rotated(double angle, const Eigen::Vector3d& axis) const {
    const Eigen::Vector3d center = bank.model().center();
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, axis.normalized()));
    return truth * Rigid3(turn, center - turn * center);
  }

  const TriangleMesh mesh;
  test::SceneRig rig;
  Rigid3 truth;
  TemplateBank bank;
  DetectorFrames frames;
  ColorTemplates templates;
  std::unique_ptr<const MeshColors> colors;
};

TEST(MeshColors, AgreeAtTheTruthAndNotElsewhere) {
  const Search search;
  const double here = search.colors->agreement(search.truth);
  EXPECT_GT(here, 0.12) << "few spots of it tell colors apart, and count for less";
  EXPECT_LT(search.colors->agreement(search.rotated(3.1, {0, 0, 1})), here - 0.1);
  EXPECT_LT(search.colors->agreement(search.truth * turned(0, {1, 0, 0}, {0.15, 0, 0})),
            here - 0.1);
  EXPECT_GT(search.colors->agreement(search.rotated(0.12, {1, 1, 0})), 0.5 * here)
      << "as far off as a template may be";
  const Rigid3 behind(Eigen::Quaterniond::Identity(), {0, 0, 500});
  EXPECT_EQ(search.colors->agreement(behind), 0) << "no camera shows it";
}

TEST(MeshColors, AreTheSameInAnotherLight) {
  const Search search;
  const SearchCamera& camera = search.frames.search_cameras()[0];
  const auto flat = search.bank.weak_perspective(
      camera.camera->model, camera.camera_from_world * search.truth, camera.shrink);
  ASSERT_TRUE(flat);
  HalfSizeImage image = *search.frames.fit_cameras()[0].image;
  ColorMap map;
  map.compute(image);
  const float before = search.templates.correlation(*flat, map);
  for (uint8_t& level : image.planes[0]) level = static_cast<uint8_t>(level / 2 + 10);
  for (size_t plane : {1, 2}) {
    for (uint8_t& level : image.planes[plane]) level = static_cast<uint8_t>(64 + level / 2);
  }
  map.compute(image);
  EXPECT_NEAR(search.templates.correlation(*flat, map), before, 0.02);
  for (auto& plane : image.planes) std::fill(plane.begin(), plane.end(), uint8_t{90});
  map.compute(image);
  EXPECT_EQ(search.templates.correlation(*flat, map), 0) << "nothing to compare with";
}

std::vector<JointPose> row_of_poses(size_t count) {
  std::vector<JointPose> poses;
  for (size_t i = 0; i < count; ++i) {
    poses.push_back(
        {turned(0, {0, 0, 1}, {static_cast<double>(i), 0, 0}), static_cast<double>(count - i), 0});
  }
  return poses;
}

TEST(PosePool, HalfOfThePlacesGoToWhatTheColorsAgreeWith) {
  std::vector<JointPose> poses = row_of_poses(10);
  poses = keep_best(std::move(poses), 4);
  ASSERT_EQ(poses.size(), 4u);
  EXPECT_EQ(poses.back().score, 7) << "without colors the best by score";

  poses = row_of_poses(10);
  poses[7].colors = 0.9;
  poses[8].colors = 0.1;
  poses[9].colors = -0.5;
  poses = keep_best(std::move(poses), 4);
  std::vector<double> scores;
  for (const JointPose& pose : poses) scores.push_back(pose.score);
  EXPECT_EQ(scores, (std::vector<double>{10, 9, 3, 2}));
}

TEST(PosePool, TheBestHalvesKeepTheirOrder) {
  const std::vector<float> colored = {0, 0, 0.1f, 0, 0.7f, 0.3f};
  EXPECT_EQ(best_halves(colored, 4), (std::vector<size_t>{0, 1, 4, 5}));
  EXPECT_EQ(best_halves(std::vector<float>(6), 4), (std::vector<size_t>{0, 1, 2, 3}));
  EXPECT_EQ(best_halves(colored, 9).size(), 6u);
}

TEST(PosePool, ACellIsTakenOnceByEachOrder) {
  std::vector<JointPose> poses = row_of_poses(4);
  for (JointPose& pose : poses) pose.world_from_object.translation *= 1e-3;
  poses[3].colors = 0.5;
  const auto best = best_of_cells(poses, Eigen::Vector3d::Zero(), 1, 0.2, 6);
  ASSERT_EQ(best.size(), 2u);
  EXPECT_EQ(best[0].score, 4);
  EXPECT_EQ(best[1].colors, 0.5);
  poses[3].colors = 0;
  EXPECT_EQ(best_of_cells(poses, Eigen::Vector3d::Zero(), 1, 0.2, 6).size(), 1u);
}

TEST(PosePool, EachDistanceHasItsShare) {
  // Ten poses at 1 m, the best, three at 2 m and one at 4 m.
  std::vector<JointPose> poses = row_of_poses(14);
  for (size_t i = 0; i < poses.size(); ++i) {
    poses[i].world_from_object.translation = {0, 0, i < 10 ? 1.0 : i < 13 ? 2.0 : 4.0};
  }
  const auto kept = [&](size_t max) {
    std::vector<double> scores;
    for (const JointPose& pose : keep_of_each_distance(poses, Eigen::Vector3d::Zero(),
                                                       Eigen::Vector3d::Zero(), max, keep_best)) {
      scores.push_back(pose.score);
    }
    std::ranges::sort(scores, std::greater<>());
    return scores;
  };
  EXPECT_EQ(kept(3), (std::vector<double>{14, 4, 1}));
  // What the farthest does not need the others have.
  EXPECT_EQ(kept(7), (std::vector<double>{14, 13, 12, 4, 3, 2, 1}));
  EXPECT_EQ(kept(20).size(), 14u);
}

}  // namespace
}  // namespace sightline::observe
