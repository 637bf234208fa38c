// SPDX-License-Identifier: Apache-2.0
//
// What `calibrate axes` refuses, each by its message.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "sightline/calibrate/solve_axes.hpp"
#include "support/matchers.hpp"
#include "synthetic_head.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::make_head;
using test::SyntheticHead;

constexpr double kDegree = std::numbers::pi / 180;

double time_of(Time stamp) { return to_seconds(stamp - test::kHeadStart); }

Result<AxesSolution> solve(const SyntheticHead& head, const AxesOptions& options = {}) {
  return solve_axes(head.sights, head.calibration(), options);
}

TEST(AxesRefusals, NoAngles) {
  SyntheticHead head = make_head({});
  head.sights.recordings[0].readings.clear();
  EXPECT_THAT(solve(head), FailsWith("has no angles of it (axes.csv)"));
}

TEST(AxesRefusals, AnglesThatNeverChange) {
  SyntheticHead head = make_head({});
  for (AxisReading& r : head.sights.recordings[0].readings) r.pan = r.tilt = 0.1;
  EXPECT_THAT(solve(head), FailsWith("its angles never change"));
}

TEST(AxesRefusals, TooFewSettings) {
  EXPECT_THAT(solve(make_head({.settings = 5, .moving_s = 0})),
              FailsWith("is seen at 5 settings of the head at rest, 8 are needed"));
}

TEST(AxesRefusals, OneAxisAlone) {
  EXPECT_THAT(
      solve(make_head({.tilt_range_deg = 0.5})),
      FailsWith(
          "tilt is between -0.45 and 0.35 degrees at all settings: only one axis was turned"));
  EXPECT_THAT(solve(make_head({.pan_range_deg = 1})), FailsWith("pan is between"));
}

TEST(AxesRefusals, TheTargetIsHardlyEverSeen) {
  SyntheticHead head = make_head({});
  std::erase_if(head.sights.recordings[0].images, [](const HeadImage& image) {
    return image.camera == 0 && time_of(image.capture) > 4;
  });
  EXPECT_THAT(solve(head), FailsWith("is seen at 3 settings"));
}

TEST(AxesRefusals, ReadingsThatDoNotRestWhileThePictureDoes) {
  SyntheticHead head = make_head({});
  test::Random random(3);
  for (AxisReading& r : head.sights.recordings[0].readings) {
    r.pan += std::sin(9 * time_of(r.stamp)) * 4 * kDegree;
  }
  EXPECT_THAT(solve(head), FailsWith("at which the readings do not rest"));
}

TEST(AxesRefusals, ACameraThatIsNotInTheCalibration) {
  const SyntheticHead head = make_head({});
  auto calibration = head.calibration();
  calibration.erase(calibration.begin());
  EXPECT_THAT(solve_axes(head.sights, calibration, {}),
              FailsWith("camera head: is not in the calibration"));
}

TEST(AxesRefusals, ImagesOfAnotherSize) {
  SyntheticHead head = make_head({});
  head.sights.cameras[0].width = 640;
  EXPECT_THAT(solve(head),
              FailsWith("its images are 640x720, its lens is calibrated for 1280x720"));
}

TEST(AxesRefusals, ABodyThatACameraSeesMove) {
  SyntheticHead head = make_head({});
  for (HeadImage& image : head.sights.recordings[0].images) {
    if (image.camera == 0 || time_of(image.capture) < 9) continue;
    for (TargetCorner& c : image.sights[0].corners) c.pixel.x() += 3;
  }
  EXPECT_THAT(solve(head), FailsWith("camera fixed1: sees the board 3.0 px from where it was"));
}

/// The board of the second recording is the first one's, carried elsewhere in between.
SyntheticHead carried(double mm, uint64_t seed) {
  SyntheticHead head = make_head({.fixed_cameras = 0, .seed = seed});
  const CalibratedCamera& camera = head.truth[0];
  const Rigid3 moved =
      head.world_from_body[0] * Rigid3({1, 0, 0, 0}, Eigen::Vector3d(0.6, 0.5, 0.6) * mm * 1e-3);
  test::Random random(seed);
  // The way is what the readings say, less the latency: rests are long enough for that.
  for (HeadImage& image : head.sights.recordings[0].images) {
    if (time_of(image.capture) < 10.2) continue;
    const Rigid3 shift = moved * head.world_from_body[0].inverse();
    // Each corner goes where the moved board would show it: through the true camera of that image.
    const auto& readings = head.sights.recordings[0].readings;
    const auto at = std::ranges::find_if(readings, [&](const AxisReading& r) {
      return r.stamp >= image.capture + from_seconds(0.04);
    });
    const Rigid3 place = camera.axes->world_from_camera(at->pan, at->tilt);
    for (TargetCorner& c : image.sights[0].corners) {
      const Eigen::Vector3d point = head.world_from_body[0] * head.sights.bodies[0].point(c.id);
      const auto before = camera.model.project(place.inverse() * point);
      const auto after = camera.model.project(place.inverse() * (shift * point));
      c.pixel += *after - *before;
    }
  }
  return head;
}

TEST(AxesRefusals, ABodyThatWasMovedBetweenTwoSettings) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    EXPECT_THAT(solve(carried(20, seed), {.world_of_target = true}),
                FailsWith("the board of recording 1 was moved between the settings at"));
    EXPECT_THAT(solve(carried(0, seed), {.world_of_target = true}), IsOk());
  }
}

TEST(AxesRefusals, AZoomThatChangesOrDoesNot) {
  const SyntheticHead zoomed = make_head({.settings = 12, .moving_s = 0, .zooms = {0, 400}});
  EXPECT_THAT(solve(zoomed), FailsWith("its zoom changes from 0 to 400 between settings"));
  EXPECT_THAT(solve(make_head({}), {.zoom = true}),
              FailsWith("a zoom table is asked for, and the zoom stands at 0 all the time"));
  SyntheticHead few = make_head({.settings = 12, .moving_s = 0});
  for (AxisReading& r : few.sights.recordings[0].readings) {
    if (time_of(r.stamp) < 2.5) r.zoom = 100;
  }
  EXPECT_THAT(solve(few, {.zoom = true}), FailsWith("a row of the table takes 4"));
}

TEST(AxesRefusals, FrozenAngles) {
  SyntheticHead head = make_head({.fixed_cameras = 0});
  auto& readings = head.sights.recordings[0].readings;
  AxisReading last{};
  for (AxisReading& r : readings) {
    if (time_of(r.stamp) < 12) {
      last = r;
    } else {
      r.pan = last.pan;
      r.tilt = last.tilt;
    }
  }
  EXPECT_THAT(solve(head), FailsWith("the angles are frozen while the picture turns"));
}

TEST(AxesRefusals, NumbersThatAreNotFinite) {
  SyntheticHead head = make_head({});
  head.sights.recordings[0].readings[50].tilt = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(solve(head), FailsWith("is not finite"));
  head = make_head({});
  head.sights.recordings[0].images[7].sights[0].corners[3].pixel.x() =
      std::numeric_limits<double>::infinity();
  EXPECT_THAT(solve(head), FailsWith("is not finite"));
}

TEST(AxesRefusals, NothingThatTiesItToTheOthers) {
  SyntheticHead head = make_head({});
  std::erase_if(head.sights.recordings[0].images,
                [](const HeadImage& image) { return image.camera != 0; });
  EXPECT_THAT(solve(head), FailsWith("nothing ties the head to the world of the other cameras"));
  EXPECT_THAT(solve(head, {.world_of_target = true}), IsOk());
}

TEST(AxesRefusals, ReadingsThatComeTooEarly) {
  SyntheticHead head = make_head({.latency_s = 0});
  for (AxisReading& r : head.sights.recordings[0].readings) r.stamp -= from_seconds(0.05);
  EXPECT_THAT(solve(head), FailsWith("give the camera time_offset_s = -0.05"));
}

TEST(AxesRefusals, ReadingsOfAnotherHead) {
  const SyntheticHead head = make_head({.fixed_cameras = 0, .seed = 1});
  SyntheticHead mixed = make_head({.fixed_cameras = 0, .seed = 2});
  mixed.sights.recordings[0].readings = head.sights.recordings[0].readings;
  EXPECT_THAT(solve(mixed, {.world_of_target = true}), FailsWith("camera head: "));
}

}  // namespace
}  // namespace sightline
