// SPDX-License-Identifier: Apache-2.0
// What is large in an image is scanned on maps of half the size.
#include "observe/detect/coarse_maps.hpp"

#include <gtest/gtest.h>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pose_scan.hpp"
#include "sized_scene.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

constexpr double kDistance = 0.7;  // [m]

// A truck before three cameras, about 100 pixels large in their images.
const SizedScene& scene() {
  static const SizedScene made(
      SizedScene::options(test::make_truck(), {0.03, -0.02, 0.01}, kDistance));
  return made;
}

struct Scanned {
  uint64_t places = 0;
  bool hit = false;  // about where the object is
};

// Where the object may be from `nearest` to `farthest` [m]; `width`: see PoseScan.
Scanned scanned(double nearest, double farthest, double width) {
  DetectorOptions range;
  range.nearest = nearest;
  range.farthest = farthest;
  const TemplateBank bank(scene().views);
  const SearchDistances distances =
      search_distances(scene().cameras, scene().views->radius(), range);
  DetectorFrames frames = scene().frames(range);
  frames.compute_responses(distances.map_margin, DetectorFrames::Edges::kBorders);
  PoseScan scan(bank, distances, 4000, run_serially, width);
  const ScanResult found = scan.scan(frames, 1, DetectorFrames::Where::kEverywhere);
  Scanned out{bank.work().sum().places, false};
  for (const auto& candidate : scan.poses(frames, found)) {
    out.hit |= rotation_angle(candidate.world_from_object, scene().truth) < 0.4 &&
               translation_distance(candidate.world_from_object, scene().truth) < 0.1;
  }
  return out;
}

TEST(CoarseScan, FindsWhatIsLargeInAQuarterOfThePlaces) {
  const double width = scene().fitter.width();
  ASSERT_GT(scene().cameras[1].calibration.model.parameters().fx * width, kCoarseScanPx * kDistance)
      << "too small for this test";
  // One distance, at which it is large.
  const Scanned all = scanned(0.95 * kDistance, 1.05 * kDistance, 0);
  const Scanned coarse = scanned(0.95 * kDistance, 1.05 * kDistance, width);
  EXPECT_TRUE(all.hit);
  EXPECT_TRUE(coarse.hit);
  EXPECT_NEAR(static_cast<double>(coarse.places), 0.25 * static_cast<double>(all.places),
              0.02 * static_cast<double>(all.places));
}

TEST(CoarseScan, LeavesOtherDistancesAsTheyAre) {
  const double width = scene().fitter.width();
  const double far =
      2 * scene().cameras[1].calibration.model.parameters().fx * width / kCoarseScanPx;
  EXPECT_EQ(scanned(far, 1.1 * far, 0).places, scanned(far, 1.1 * far, width).places);
  // Some of several.
  const uint64_t all = scanned(0.5 * kDistance, far, 0).places;
  const uint64_t some = scanned(0.5 * kDistance, far, width).places;
  EXPECT_LT(some, all);
  EXPECT_GT(some, all / 4);
}

TEST(CoarseScan, KeepsToEdgesThatCount) {
  const DetectorFrames frames = scene().frames({});
  const HalfSizeImage& image = frames.image(0);
  std::vector<uint8_t> mask(image.planes[0].size(), 0);
  CoarseMaps maps;
  maps.show(image, {}, 8);
  const auto sum = [&] {
    const ResponseMaps& far = maps.far(40, 0.1);
    uint64_t out = 0;
    for (int y = 0; y < far.height(); ++y) {
      for (int x = 0; x < far.width(); ++x) {
        for (int bin = 0; bin < kEdgeBins; ++bin) out += static_cast<uint64_t>(far.at(bin, x, y));
      }
    }
    return out;
  };
  EXPECT_GT(sum(), 0u);
  EXPECT_EQ(maps.height(), image.height / 4);
  EXPECT_EQ(maps.far(40, 0.1).height(), maps.height());
  maps.show(image, mask, 8);
  EXPECT_EQ(sum(), 0u);
}

TEST(CoarseScan, RowsAreThoseThatEitherOfTwoHas) {
  EXPECT_TRUE(coarse_rows({}, 3).empty());
  const auto rows = coarse_rows({{4, 9}, {2, 6}, {5, 5}, {0, 0}, {7, 3}, {3, 8}}, 3);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0], (std::array{1, 5}));
  EXPECT_GE(rows[1][0], rows[1][1]) << "none";
  EXPECT_EQ(rows[2], (std::array{1, 4}));
}

}  // namespace
}  // namespace sightline::observe
