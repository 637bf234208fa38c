// SPDX-License-Identifier: Apache-2.0
// What a calibration is refused for, each with its message.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "../support/matchers.hpp"
#include "sightline/calibrate/solve.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "synthetic_views.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::make_rig;
using test::SyntheticRig;

SyntheticRig good() { return make_rig({.cameras = 3, .sets = 36}); }

SolveOptions known_lenses(const SyntheticRig& rig) {
  SolveOptions options;
  for (const CalibratedCamera& c : rig.truth) {
    options.cameras.push_back({c.model.parameters().lens, c.model});
  }
  return options;
}

TEST(Refusals, TheGoodRigIsNone) { EXPECT_THAT(solve_rig(good().views, {}), IsOk()); }

TEST(Refusals, MirroredBoard) {
  SyntheticRig rig = good();
  for (TargetView& view : rig.views.views) {
    if (view.camera != 1) continue;
    for (TargetCorner& corner : view.corners) corner.pixel.x() = 1279 - corner.pixel.x();
  }
  const auto result = solve_rig(rig.views, {});
  EXPECT_THAT(result, FailsWith("camera cam1: mirrored"));
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidInput);
}

TEST(Refusals, CornersThatAreNotOfTheBoard) {
  SyntheticRig rig = good();
  rig.views.target.columns = 7;
  rig.views.target.rows = 4;
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("is not one of the 18 of a chessboard of 7x4"));
}

// The corners' ids as a detector gives them that believes in another number of columns.
TEST(Refusals, WrongBoardSize) {
  SyntheticRig rig = good();
  rig.views.target.columns = 7;
  rig.views.target.rows = 10;
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("do not fit a flat chessboard of 7x10 squares"));
}

TEST(Refusals, ChessboardThatLooksTheSameUpsideDown) {
  SyntheticRig rig = good();
  rig.views.target.rows = 8;
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("looks the same after half a turn"));
}

TEST(Refusals, TooFewViews) {
  SyntheticRig rig = good();
  size_t kept = 0;
  std::erase_if(rig.views.views,
                [&](const TargetView& view) { return view.camera == 2 && kept++ >= 3; });
  EXPECT_THAT(solve_rig(rig.views, {}),
              FailsWith("camera cam2: too few views: the target was found in 3 of 36 images"));
}

TEST(Refusals, NoTilt) {
  const SyntheticRig rig = make_rig({.cameras = 1, .sets = 20, .tilt_deg = 2});
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("camera cam0: no tilt"));
}

TEST(Refusals, NoChangeOfDistance) {
  const SyntheticRig rig = make_rig({.cameras = 1,
                                     .sets = 20,
                                     .square = 0.012,
                                     .tilt_deg = 30,
                                     .nearest = 1.2,
                                     .farthest = 1.21});
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("camera cam0: no change of distance"));
}

TEST(Refusals, NoChangeOfDistanceIsFineWithAKnownLens) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 20, .nearest = 1, .farthest = 1.01});
  EXPECT_THAT(solve_rig(rig.views, known_lenses(rig)), IsOk());
}

TEST(Refusals, UnlinkedCamera) {
  SyntheticRig rig = good();
  // The last camera keeps the sets that nobody else saw: new ones.
  const size_t sets = rig.views.sets;
  for (TargetView& view : rig.views.views) {
    if (view.camera == 2) view.set += sets;
  }
  rig.views.sets = 2 * sets;
  const auto result = solve_rig(rig.views, {});
  EXPECT_THAT(result, FailsWith("camera cam2: not linked"));
  EXPECT_THAT(result, FailsWith("show the target to cam2 and"));
}

TEST(Refusals, ImageSizeIsNotTheCameras) {
  SyntheticRig rig = good();
  const SolveOptions options = known_lenses(rig);
  rig.views.cameras[1].width = 1920;
  rig.views.cameras[1].height = 1080;
  EXPECT_THAT(
      solve_rig(rig.views, options),
      FailsWith("camera cam1: its images are 1920x1080, but its known lens is for 1280x720"));
}

TEST(Refusals, CornersOutsideTheImage) {
  SyntheticRig rig = good();
  for (ViewedCamera& camera : rig.views.cameras) camera.width = 640;
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("lies outside the image of 640x720"));
}

TEST(Refusals, MovingBoardWithoutTimeOffset) {
  const SyntheticRig late = make_rig({.cameras = 3, .sets = 40, .offset_s = 0.03, .speed = 0.4});
  const auto result = solve_rig(late.views, {});
  EXPECT_THAT(result, FailsWith("the target was in motion"));
  EXPECT_THAT(result, FailsWith("ms +- "));
  EXPECT_THAT(result, FailsWith("later than they are stamped, compared with cam0"));
  EXPECT_THAT(result, FailsWith("(--time-offsets)"));
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidInput);
  // What moves before cameras that are on time is none, nor what stands before late ones.
  const SyntheticRig on_time = make_rig({.cameras = 3, .sets = 40, .speed = 0.4});
  EXPECT_THAT(solve_rig(on_time.views, {}), IsOk());
  const SyntheticRig still = make_rig({.cameras = 3, .sets = 40, .offset_s = 0.03});
  EXPECT_THAT(solve_rig(still.views, {}), IsOk());
}

TEST(Refusals, NotANumber) {
  SyntheticRig rig = good();
  rig.views.views[4].corners[3].pixel.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(solve_rig(rig.views, {}), FailsWith("is not a finite number (NaN or infinite)"));
  const std::string text = format_views(rig.views);
  EXPECT_THAT(parse_views(text, "corners.csv"), FailsWith("is not a finite number"));
}

TEST(Refusals, CamerasExchanged) {
  SyntheticRig rig = make_rig({.cameras = 2, .sets = 20});
  SolveOptions options = known_lenses(rig);
  // A second lens that is another one for sure.
  CameraModel::Parameters p = rig.truth[1].model.parameters();
  p.fx *= 1.5;
  p.fy *= 1.5;
  const CameraModel other = *CameraModel::create(p, "test");
  for (TargetView& view : rig.views.views) {
    if (view.camera != 1) continue;
    std::vector<TargetCorner> kept;
    for (TargetCorner corner : view.corners) {
      const auto ray = rig.truth[1].model.unproject(corner.pixel);
      corner.pixel = *other.project(*ray);
      if (other.contains(corner.pixel)) kept.push_back(corner);
    }
    view.corners = kept;
  }
  options.cameras[1].known = other;
  ASSERT_THAT(solve_rig(rig.views, options), IsOk());
  std::swap(options.cameras[0].known, options.cameras[1].known);
  EXPECT_THAT(solve_rig(rig.views, options), FailsWith("fit the lens of camera cam"));
  EXPECT_THAT(solve_rig(rig.views, options), FailsWith("have the two been exchanged"));
}

TEST(ViewsFile, RoundTrip) {
  const SyntheticRig rig = good();
  const auto back = parse_views(format_views(rig.views), "corners.csv");
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->target, rig.views.target);
  EXPECT_EQ(back->cameras, rig.views.cameras);
  EXPECT_EQ(format_views(*back), format_views(rig.views));
}

TEST(ViewsFile, NamesFileAndLine) {
  const std::string text = format_views(good().views);
  EXPECT_THAT(parse_views(text + "0,nobody,0,1,2,3,0,0,0,0\n", "corners.csv"),
              FailsWith("no camera 'nobody'"));
  EXPECT_THAT(parse_views(text + "0,cam0,0,1,2\n", "corners.csv"), FailsWith("corners.csv:"));
  EXPECT_THAT(parse_views(text + "0,cam0,0,1,2,3,0,0\n", "corners.csv"),
              FailsWith("du,dv,ddu,ddv"));
  EXPECT_THAT(parse_views("x,y\n1,2\n", "corners.csv"), FailsWith("corners.csv:1: not a file of"));
}

TEST(ViewsFile, OfEarlierVersionsSaysNothingOfAccelerations) {
  const SyntheticRig rig = make_rig({.cameras = 2, .sets = 3, .speed = 0.4});
  std::string text = format_views(rig.views);
  text.replace(text.find(",ddu,ddv"), 8, "");
  for (size_t at = text.find(",0,0\n"); at != std::string::npos; at = text.find(",0,0\n", at)) {
    text.erase(at, 4);
  }
  const auto views = parse_views(text, "corners.csv");
  ASSERT_THAT(views, IsOk());
  EXPECT_EQ(format_views(*views), format_views(rig.views));
}

TEST(TargetFile, APlaceInTheWorldIsOfWhatIsFixed) {
  CalibrationTarget target = test::test_target();
  target.fixed = true;
  target.world_from_target = Rigid3({1, 0, 0, 0}, {0.5, -1.25, 2});
  const auto back = parse_target(format_target(target), "target.toml");
  ASSERT_THAT(back, test::IsOk());
  EXPECT_EQ(*back, target);
  std::string loose = format_target(target);
  loose.erase(loose.find("fixed = true\n"), 13);
  EXPECT_THAT(parse_target(loose, "target.toml"), FailsWith("so it must not be moved: fixed"));
  std::string wrong = format_target(target);
  wrong.replace(wrong.find("world_from_target = [1.0"), 24, "world_from_target = [2.0");
  EXPECT_THAT(parse_target(wrong, "target.toml"), FailsWith("target.toml:"));
}

TEST(TargetFile, RoundTripAndRefusals) {
  CalibrationTarget target;
  target.columns = 8;
  target.rows = 6;
  target.square = 0.06;
  target.marker = 0.045;
  target.dictionary = "5X5_100";
  target.layout = CharucoLayout::kDarkFirst;
  const auto back = parse_target(format_target(target), "target.toml");
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(*back, target);
  target.marker = 0.07;
  EXPECT_THAT(parse_target(format_target(target), "target.toml"),
              FailsWith("does not fit into a square"));
  EXPECT_THAT(parse_target("type = \"charuco\"\ncolums = 8\n", "target.toml"),
              FailsWith("target.toml:2:1: unknown key 'colums'"));
  EXPECT_THAT(parse_target("type = \"chessboard\"\ncolumns = 8\nrows = 6\nsquare = nan\n", "t"),
              FailsWith("a length in meters"));
}

}  // namespace
}  // namespace sightline
