// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/fiducial/fiducial_observer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <random>
#include <thread>

#include "print_scene.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::Exposure;
using test::FailsWith;
using test::IsOk;
using test::MarkerPrint;
using test::PoseNear;
using test::PrintScene;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kTagSize = 0.08;
const Time kNow = time_from_ns(1'000'000'000);

ObjectDescription tag_object(const std::string& family = "tag36h11", int id = 7,
                             double size = kTagSize) {
  ObjectDescription d;
  d.name = "plate";
  d.fiducials.push_back({family, id, size, Rigid3()});
  return d;
}

ObjectDescription board_object(bool inverted, int rows = 5) {
  ObjectDescription d;
  d.name = "board";
  d.board = CharucoBoard{4, rows, 0.04, 0.03, "4X4_50", inverted};
  return d;
}

std::unique_ptr<FiducialObserver> make_observer(const CalibratedCamera& camera,
                                                std::vector<ObjectDescription> objects,
                                                FiducialOptions options = {}) {
  std::vector<ObservedObject> observed;
  for (size_t i = 0; i < objects.size(); ++i) {
    observed.push_back({ObjectId(static_cast<uint32_t>(i)), std::move(objects[i])});
  }
  auto made = FiducialObserver::create(camera, CameraId(0), std::move(observed), options);
  EXPECT_THAT(made, IsOk());
  return std::move(made).value();
}

/// A pose of a print facing the camera at the world's origin: `tilt` away from frontal about an
/// axis in the print, `turn` in the image.
Rigid3 facing(double tilt, double axis, double turn, const Eigen::Vector3d& at) {
  const Eigen::Quaterniond front(0, 1, 0, 0);  // y up, z towards the camera
  const Eigen::Quaterniond tilted(
      Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(axis), std::sin(axis), 0)));
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  return Rigid3(turned * tilted * front, at);
}

FramePtr shoot_tag(const CalibratedCamera& camera, const MarkerPrint& marker,
                   const Rigid3& world_from_fiducial, const Exposure& exposure = {}) {
  PrintScene scene(camera);
  scene.add(marker.print, world_from_fiducial * marker.plane_from_fiducial.inverse());
  return scene.shoot(kNow, exposure);
}

FramePtr shoot_board(const CalibratedCamera& camera, const CharucoBoard& board, bool marker_first,
                     const Rigid3& world_from_board, uint32_t seed = 1) {
  const test::BoardPrint print = test::charuco_print(board, marker_first);
  PrintScene scene(camera);
  scene.add(print.print, world_from_board * print.plane_from_board.inverse());
  Exposure exposure;
  exposure.seed = seed;
  return scene.shoot(kNow, exposure);
}

/// A board in front of the camera, its middle at `at`.
Rigid3 board_pose(const CharucoBoard& board, double tilt, double turn, const Eigen::Vector3d& at) {
  const Eigen::Quaterniond q(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY()));
  const Eigen::Vector3d middle(board.columns * board.square / 2, board.rows * board.square / 2, 0);
  return Rigid3(q, at - q * middle);
}

Observation look(FiducialObserver& observer, const Frame& frame, PoseTrackPtr track = nullptr) {
  std::vector<Observation> out;
  const std::vector<PoseTrackPtr> tracks = {std::move(track)};
  observer.step(frame, tracks, out);
  EXPECT_EQ(out.size(), 1u);
  return out.empty() ? Observation{} : out.front();
}

const ReprojectionTerm& corners_of(const Observation& observation) {
  return dynamic_cast<const ReprojectionTerm&>(*observation.terms.at(0));
}

PoseTrackPtr track_at(const Rigid3& pose, TrackState state, double sigma_m = 1e-3) {
  PoseEstimate e;
  e.object = ObjectId(0);
  e.time = kNow;
  e.last_measured = kNow;
  e.state = state;
  e.world_from_object = pose;
  e.covariance.setIdentity();
  e.covariance *= sigma_m * sigma_m;
  return std::make_shared<PoseTrack>(ObjectId(0), std::vector<PoseEstimate>{e}, MotionNoise{});
}

/// Statistics of many looks at known poses.
struct Study {
  double radial = 0;  ///< mean of errors away from the marker's center [px]
  double rms = 0;     ///< of one coordinate [px]
  double chi2 = 0;    ///< mean square of normalized residuals
  int corners = 0, seen = 0;
};
Study study_tags(LensModel lens, int looks) {
  const CalibratedCamera camera = test::test_camera(lens);
  const MarkerPrint marker = test::apriltag_print("tag36h11", 7, kTagSize);
  // In these images lens, response and print are perfect: what is left is the pixels' noise,
  // which the scatter of the edge points has to tell.
  FiducialOptions options;
  options.tag_sigma_px = 0.01;
  auto observer = make_observer(camera, {tag_object()}, options);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1, 1);
  Study out;
  for (int i = 0; i < looks; ++i) {
    const double z = 0.75 + 0.25 * u(random);
    const Rigid3 pose = facing((25 + 25 * u(random)) * kDegree, 3 * u(random), 3 * u(random),
                               {0.3 * z * u(random), 0.22 * z * u(random), z});
    Exposure exposure;
    exposure.seed = static_cast<uint32_t>(i);
    const Observation seen = look(*observer, *shoot_tag(camera, marker, pose, exposure));
    if (seen.terms.empty()) continue;
    ++out.seen;
    const auto& matches = corners_of(seen).matches();
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const PointMatch& m : matches) middle += m.pixel / 4;
    for (const PointMatch& m : matches) {
      const Eigen::Vector2d error =
          m.pixel - camera.model.project(pose * m.point_in_object).value();
      out.radial += error.dot((m.pixel - middle).normalized());
      out.rms += error.squaredNorm() / 2;
      out.chi2 += error.squaredNorm() / 2 / (m.sigma_px * m.sigma_px);
      ++out.corners;
    }
  }
  out.radial /= out.corners;
  out.rms = std::sqrt(out.rms / out.corners);
  out.chi2 /= out.corners;
  return out;
}

TEST(FiducialObserver, TagCornersAreUnbiasedWithHonestNoise) {
  for (LensModel lens : {LensModel::kBrownConrady, LensModel::kFisheye}) {
    const Study s = study_tags(lens, 30);
    EXPECT_GE(s.seen, 29);
    EXPECT_NEAR(s.radial, 0, 0.02);
    EXPECT_LT(s.rms, 0.04);
    EXPECT_GT(s.chi2, 0.5);
    EXPECT_LT(s.chi2, 1.6);
  }
}

TEST(FiducialObserver, TheCamerasResponseMatters) {
  const CalibratedCamera camera = test::test_camera();
  const MarkerPrint marker = test::apriltag_print("tag36h11", 7, kTagSize);
  const Rigid3 pose = facing(30 * kDegree, 0.5, 0.2, {0, 0, 0.7});
  Exposure linear;
  linear.gamma = 1;
  const FramePtr frame = shoot_tag(camera, marker, pose, linear);
  const auto error = [&](double gamma) {
    FiducialOptions options;
    options.gamma = gamma;
    auto observer = make_observer(camera, {tag_object()}, options);
    return translation_distance(look(*observer, *frame).hypotheses.at(0).world_from_object, pose);
  };
  EXPECT_LT(error(1.0), 2e-3);
  EXPECT_GT(error(2.2), 4e-3);
}

TEST(FiducialObserver, FindsEveryFamily) {
  const CalibratedCamera camera = test::test_camera();
  const Rigid3 pose = facing(20 * kDegree, 1, 0.3, {0.05, -0.03, 0.6});
  const auto check = [&](const std::string& family, const MarkerPrint& marker, int id) {
    SCOPED_TRACE(family);
    auto observer = make_observer(camera, {tag_object(family, id)});
    const Observation seen = look(*observer, *shoot_tag(camera, marker, pose));
    ASSERT_FALSE(seen.terms.empty());
    for (const PointMatch& m : corners_of(seen).matches()) {
      EXPECT_LT((m.pixel - camera.model.project(pose * m.point_in_object).value()).norm(), 0.25);
    }
    ASSERT_FALSE(seen.hypotheses.empty());
    EXPECT_THAT(seen.hypotheses[0].world_from_object, PoseNear(pose, 2 * kDegree, 0.005));
  };
  for (const std::string family :
       {"tag36h11", "tag25h9", "tag16h5", "tag36h10", "tagCircle21h7", "tagCircle49h12",
        "tagStandard41h12", "tagStandard52h13", "tagCustom48h12"}) {
    check(family, test::apriltag_print(family, 5, kTagSize), 5);
  }
  for (const std::string dictionary :
       {"4X4_50", "4X4_1000", "5X5_100", "6X6_250", "7X7_1000", "ARUCO_ORIGINAL"}) {
    std::string family = dictionary == "ARUCO_ORIGINAL" ? "aruco_original" : "aruco_" + dictionary;
    std::transform(family.begin(), family.end(), family.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    check(family, test::aruco_print(dictionary, 5, kTagSize), 5);
  }
}

TEST(FiducialObserver, BoardsOfBothLayoutsAndInverted) {
  const CalibratedCamera camera = test::test_camera();
  for (const bool inverted : {false, true}) {
    for (const int rows : {4, 5}) {
      for (const bool marker_first : {false, true}) {
        if (rows == 5 && marker_first) continue;  // there is only one layout for odd rows
        SCOPED_TRACE(fmt::format("inverted {} rows {} old {}", inverted, rows, marker_first));
        const ObjectDescription object = board_object(inverted, rows);
        const Rigid3 pose = board_pose(*object.board, 0.5, 0.3, {0.03, 0.02, 0.55});
        auto observer = make_observer(camera, {object});
        const Observation seen =
            look(*observer, *shoot_board(camera, *object.board, marker_first, pose));
        ASSERT_FALSE(seen.terms.empty());
        EXPECT_EQ(corners_of(seen).matches().size(), static_cast<size_t>(3 * (rows - 1)));
        double chi2 = 0;
        for (const PointMatch& m : corners_of(seen).matches()) {
          const Eigen::Vector2d e =
              m.pixel - camera.model.project(pose * m.point_in_object).value();
          EXPECT_LT(e.norm(), 0.3);
          chi2 += e.squaredNorm() / 2 / (m.sigma_px * m.sigma_px);
        }
        EXPECT_LT(chi2 / static_cast<double>(corners_of(seen).matches().size()), 1.5);
        ASSERT_EQ(seen.hypotheses.size(), 1u);
        EXPECT_THAT(seen.hypotheses[0].world_from_object, PoseNear(pose, 0.5 * kDegree, 0.0015));
      }
    }
  }
}

TEST(FiducialObserver, AHiddenPartOfABoardIsLeftOut) {
  const CalibratedCamera camera = test::test_camera();
  const ObjectDescription object = board_object(false);
  const Rigid3 pose = board_pose(*object.board, 0.3, 0.1, {0, 0, 0.5});
  const test::BoardPrint print = test::charuco_print(*object.board, false);
  PrintScene scene(camera);
  scene.add(print.print, pose * print.plane_from_board.inverse());
  // A card over the right half, a little nearer.
  const Rigid3 card(pose.rotation, pose * Eigen::Vector3d(0.095, -0.02, -0.002));
  scene.add(test::blank_print(1, 1, 0.25), card);
  auto observer = make_observer(camera, {object});
  const Observation seen = look(*observer, *scene.shoot(kNow, {}));
  ASSERT_FALSE(seen.terms.empty());
  EXPECT_EQ(corners_of(seen).matches().size(), 8u);
  for (const PointMatch& m : corners_of(seen).matches()) {
    EXPECT_LT(m.point_in_object.x(), 0.095);
    EXPECT_LT((m.pixel - camera.model.project(pose * m.point_in_object).value()).norm(), 0.4);
  }
  EXPECT_THAT(seen.hypotheses.at(0).world_from_object, PoseNear(pose, 1.0 * kDegree, 0.004));
}

TEST(FiducialObserver, ALoneSmallTagMayBeFlippedAndALargeObliqueOneMayNot) {
  const CalibratedCamera camera = test::test_camera();
  const MarkerPrint small = test::apriltag_print("tag36h11", 7, 0.04);
  const Rigid3 far_pose = facing(12 * kDegree, 0.4, 0.1, {0.05, 0, 1.1});
  auto observer = make_observer(camera, {tag_object("tag36h11", 7, 0.04)});
  const Observation doubtful = look(*observer, *shoot_tag(camera, small, far_pose));
  ASSERT_EQ(doubtful.hypotheses.size(), 2u);
  EXPECT_LE(doubtful.hypotheses[0].cost, doubtful.hypotheses[1].cost);
  double best = 10;
  for (const PoseHypothesis& h : doubtful.hypotheses) {
    EXPECT_NEAR(h.cost, doubtful.terms[0]->linearize(h.world_from_object).cost, 1e-9);
    best = std::min(best, rotation_angle(h.world_from_object, far_pose));
  }
  EXPECT_LT(best, 8 * kDegree);
  EXPECT_GT(rotation_angle(doubtful.hypotheses[0].world_from_object,
                           doubtful.hypotheses[1].world_from_object),
            10 * kDegree);

  const Rigid3 near_pose = facing(45 * kDegree, 0.4, 0.1, {0.02, 0, 0.45});
  auto sure_observer = make_observer(camera, {tag_object()});
  const Observation sure = look(
      *sure_observer, *shoot_tag(camera, test::apriltag_print("tag36h11", 7, kTagSize), near_pose));
  ASSERT_EQ(sure.hypotheses.size(), 1u);
  EXPECT_THAT(sure.hypotheses[0].world_from_object, PoseNear(near_pose, 0.7 * kDegree, 0.002));
}

/// Two tags on two faces, as on a carton.
struct Carton {
  ObjectDescription object;
  MarkerPrint front = test::apriltag_print("tag36h11", 7, 0.07);
  MarkerPrint right = test::apriltag_print("tag36h11", 8, 0.06);
  Carton() {
    object.name = "carton";
    object.fiducials.push_back({"tag36h11", 7, 0.07, Rigid3()});
    object.fiducials.push_back(
        {"tag36h11", 8, 0.06,
         Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitY())),
                {0.08, 0, -0.05})});
  }
  FramePtr shoot(const CalibratedCamera& camera, const Rigid3& pose,
                 const Rigid3& right_moved = {}) const {
    PrintScene scene(camera);
    scene.add(front.print, pose * front.plane_from_fiducial.inverse());
    scene.add(right.print, right_moved * pose * object.fiducials[1].object_from_fiducial *
                               right.plane_from_fiducial.inverse());
    return scene.shoot(kNow, {});
  }
};

TEST(FiducialObserver, SeveralFiducialsGiveOnePose) {
  const CalibratedCamera camera = test::test_camera();
  const Carton carton;
  const Rigid3 pose = facing(40 * kDegree, 90 * kDegree, 0.1, {0, 0, 0.6});
  auto observer = make_observer(camera, {carton.object});
  const Observation seen = look(*observer, *carton.shoot(camera, pose));
  ASSERT_EQ(seen.terms.size(), 1u);
  EXPECT_EQ(corners_of(seen).matches().size(), 8u);
  ASSERT_EQ(seen.hypotheses.size(), 1u);
  EXPECT_THAT(seen.hypotheses[0].world_from_object, PoseNear(pose, 0.4 * kDegree, 0.0015));
}

TEST(FiducialObserver, AFiducialThatContradictsTheOthersIsLeftOut) {
  const CalibratedCamera camera = test::test_camera();
  const Carton carton;
  const Rigid3 pose = facing(40 * kDegree, 90 * kDegree, 0.1, {0, 0, 0.6});
  const Rigid3 elsewhere(Eigen::Quaterniond::Identity(), {0.05, 0.06, 0});
  auto observer = make_observer(camera, {carton.object});
  const Observation seen = look(*observer, *carton.shoot(camera, pose, elsewhere));
  ASSERT_EQ(seen.terms.size(), 1u);
  EXPECT_EQ(corners_of(seen).matches().size(), 4u);
  EXPECT_EQ(observer->counters().refused, 1u);
}

TEST(FiducialObserver, SeesNothingInNoiseAndClutter) {
  const CalibratedCamera camera = test::test_camera();
  std::vector<ObjectDescription> objects = {board_object(false)};
  objects.push_back(tag_object("tag16h5", 3));
  objects.push_back(tag_object("tag36h11", 3));
  objects.push_back(tag_object("aruco_4x4_1000", 44));
  objects.back().fiducials[0].family = "aruco_4x4_1000";
  auto observer = make_observer(camera, objects);
  std::mt19937 random(3);
  for (int i = 0; i < 24; ++i) {
    std::vector<uint8_t> gray(640 * 480);
    if (i % 2 == 0) {
      for (uint8_t& g : gray) g = static_cast<uint8_t>(random() % 256);
    } else {
      // Rectangles over rectangles, a world full of quadrilaterals.
      for (int k = 0; k < 600; ++k) {
        const int x0 = static_cast<int>(random() % 640), y0 = static_cast<int>(random() % 480);
        const int w = 4 + static_cast<int>(random() % 60), h = 4 + static_cast<int>(random() % 60);
        const uint8_t level = static_cast<uint8_t>(random() % 256);
        for (int y = y0; y < std::min(480, y0 + h); ++y) {
          for (int x = x0; x < std::min(640, x0 + w); ++x) {
            gray[static_cast<size_t>(y * 640 + x)] = level;
          }
        }
      }
    }
    std::vector<Observation> out;
    observer->step(*test::frame_of(gray, 640, 480, kNow), {}, out);
    ASSERT_EQ(out.size(), 4u);
    for (const Observation& o : out) EXPECT_TRUE(o.terms.empty()) << i;
  }
}

TEST(FiducialObserver, ATrackSaysWhereToLookAndNotWhatIsMeasured) {
  const CalibratedCamera camera = test::test_camera();
  const MarkerPrint marker = test::apriltag_print("tag36h11", 7, kTagSize);
  const Rigid3 pose = facing(30 * kDegree, 0.5, 0.2, {0.1, 0.05, 0.7});
  const FramePtr frame = shoot_tag(camera, marker, pose);
  auto blind = make_observer(camera, {tag_object()});
  const Observation free = look(*blind, *frame);
  auto guided = make_observer(camera, {tag_object()});
  const Rigid3 nearby = pose * Rigid3(Eigen::Quaterniond::Identity(), {0.01, 0, 0.01});
  const Observation led = look(*guided, *frame, track_at(nearby, TrackState::kTracking));
  EXPECT_EQ(blind->counters().full_searches, 1u);
  EXPECT_EQ(guided->counters().full_searches, 0u);
  ASSERT_FALSE(led.terms.empty());
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_LT((corners_of(free).matches()[i].pixel - corners_of(led).matches()[i].pixel).norm(),
              0.03);
  }
}

TEST(FiducialObserver, AWrongTrackDoesNotHideTheObject) {
  const CalibratedCamera camera = test::test_camera();
  const MarkerPrint marker = test::apriltag_print("tag36h11", 7, kTagSize);
  const Rigid3 pose = facing(30 * kDegree, 0.5, 0.2, {-0.15, 0.05, 0.7});
  const Rigid3 wrong = facing(30 * kDegree, 0.5, 0.2, {0.2, 0.05, 0.7});
  const FramePtr frame = shoot_tag(camera, marker, pose);
  auto unsure = make_observer(camera, {tag_object()});
  EXPECT_FALSE(look(*unsure, *frame, track_at(wrong, TrackState::kCoasting)).terms.empty());

  FiducialOptions options;
  auto confident = make_observer(camera, {tag_object()}, options);
  int looks = 1;
  while (look(*confident, *frame, track_at(wrong, TrackState::kTracking)).terms.empty()) {
    ASSERT_LT(++looks, 100);
  }
  EXPECT_EQ(looks, options.full_search_interval);
  EXPECT_EQ(confident->counters().full_searches, 1u);
}

TEST(FiducialObserver, AnObjectOutOfTheImageCostsNoSearch) {
  const CalibratedCamera camera = test::test_camera();
  auto observer = make_observer(camera, {tag_object()});
  const FramePtr frame = PrintScene(camera).shoot(kNow, {});
  const Rigid3 aside = facing(0, 0, 0, {5, 0, 0.7});
  EXPECT_TRUE(look(*observer, *frame, track_at(aside, TrackState::kTracking)).terms.empty());
  EXPECT_EQ(observer->counters().full_searches, 0u);
  EXPECT_EQ(observer->counters().region_searches, 0u);
}

TEST(FiducialObserver, ObservationsCarryTheFramesIdentity) {
  const CalibratedCamera camera = test::test_camera();
  auto made = FiducialObserver::create(camera, CameraId(3), {{ObjectId(5), tag_object()}});
  ASSERT_THAT(made, IsOk());
  FrameInfo info;
  info.camera = CameraId(3);
  info.epoch = 2;
  info.sequence = 77;
  info.capture = kNow;
  info.capture_error = Duration(1000);
  info.width = 640;
  info.height = 480;
  auto image = std::make_shared<Image>(640, 480);
  for (int y = 0; y < 480; ++y) std::fill_n(image->mutable_view().y.row(y), 640, uint8_t{90});
  std::vector<Observation> out;
  (*made)->step(*Frame::decoded(info, image), {}, out);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].object, ObjectId(5));
  EXPECT_EQ(out[0].camera, CameraId(3));
  EXPECT_EQ(out[0].epoch, 2u);
  EXPECT_EQ(out[0].sequence, 77u);
  EXPECT_EQ(out[0].capture, kNow);
  EXPECT_EQ(out[0].capture_error, Duration(1000));
  EXPECT_TRUE(out[0].terms.empty());

  info.status = FrameStatus::kDamaged;
  out.clear();
  (*made)->step(*Frame::decoded(info, image), {}, out);
  EXPECT_TRUE(out.empty());
}

TEST(FiducialObserver, AFrameOfAnotherSizeIsNotLookedAt) {
  auto observer = make_observer(test::test_camera(), {tag_object()});
  const std::vector<uint8_t> gray(320 * 240, 90);
  std::vector<Observation> out;
  observer->step(*test::frame_of(gray, 320, 240, kNow), {}, out);
  EXPECT_TRUE(out.empty());
}

// The cameras of a rig are prepared side by side: cv::setNumThreads() from two threads was a crash.
TEST(FiducialObserver, ManyAreMadeAtATime) {
  const CalibratedCamera camera = test::test_camera();
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 2000; ++k) {
        EXPECT_TRUE(FiducialObserver::create(camera, CameraId(0), {{ObjectId(0), tag_object()}}));
      }
    });
  }
}

// The library keeps the codes of a family once for all detectors.
TEST(FiducialObserver, EveryCameraKnowsTheSameIds) {
  const CalibratedCamera camera = test::test_camera();
  ObjectDescription object = tag_object("tag36h11", 1);
  const Eigen::Vector3d beside(0.2, 0, 0);
  object.fiducials.push_back({"tag36h11", 2, kTagSize, Rigid3({1, 0, 0, 0}, beside)});
  const MarkerPrint second = test::apriltag_print("tag36h11", 2, kTagSize);
  const Rigid3 pose = facing(0.5, 0.3, 0.2, {-0.15, 0.02, 0.7});
  const FramePtr frame = shoot_tag(camera, second, pose * object.fiducials[1].object_from_fiducial);
  for (int i = 0; i < 4; ++i) {  // as many cameras, made one after the other
    auto observer = make_observer(camera, {object});
    const Observation seen = look(*observer, *frame);
    ASSERT_FALSE(seen.hypotheses.empty()) << i;
    EXPECT_THAT(seen.hypotheses.at(0).world_from_object, PoseNear(pose, 3 * kDegree, 0.015)) << i;
  }
}

TEST(FiducialObserver, RefusesWhatCannotBeObserved) {
  const CalibratedCamera camera = test::test_camera();
  const auto create = [&](ObjectDescription a, std::optional<ObjectDescription> b = {}) {
    std::vector<ObservedObject> objects = {{ObjectId(0), std::move(a)}};
    if (b) objects.push_back({ObjectId(1), std::move(*b)});
    return FiducialObserver::create(camera, CameraId(0), std::move(objects));
  };
  EXPECT_THAT(create(tag_object("tag37h11")), FailsWith("tagStandard41h12"));
  EXPECT_THAT(create(tag_object("aruco_4x4_51")), FailsWith("aruco_4x4_50"));
  EXPECT_THAT(create(tag_object("tag36h11", 587)), FailsWith("0 to 586"));
  EXPECT_THAT(create(tag_object("tag36h11", -1)), FailsWith("has no id -1"));
  EXPECT_THAT(create(tag_object("aruco_4x4_50", 50)), FailsWith("0 to 49"));
  EXPECT_THAT(create(tag_object("tag36h11", 7, 0)), FailsWith("must be positive"));
  EXPECT_THAT(create(tag_object(), tag_object()), FailsWith("also on object"));
  ObjectDescription board = board_object(false);
  board.board->dictionary = "4x4_50";
  EXPECT_THAT(create(board), FailsWith("4X4_50"));
  board = board_object(false);
  board.board->columns = 1;
  EXPECT_THAT(create(board), FailsWith("1 x 5"));
  board = board_object(false);
  board.board->marker = 0.05;
  EXPECT_THAT(create(board), FailsWith("smaller than the square"));
  board = board_object(false, 50);
  EXPECT_THAT(create(board), FailsWith("has no id 50"));
  EXPECT_THAT(create(board_object(false), tag_object("aruco_4x4_50", 3)), FailsWith("also on"));
}

TEST(FiducialObserver, LeavesOutObjectsWithoutFiducials) {
  ObjectDescription plain;
  plain.name = "truck";
  auto observer = make_observer(test::test_camera(), {plain, tag_object()});
  ASSERT_EQ(observer->objects().size(), 1u);
  EXPECT_EQ(observer->objects()[0], ObjectId(1));
}

TEST(FiducialObserver, TwoObserversSayTheSameToTheLastBit) {
  const CalibratedCamera camera = test::test_camera();
  const Carton carton;
  const Rigid3 pose = facing(35 * kDegree, 80 * kDegree, 0.1, {0, 0, 0.6});
  const FramePtr frame = carton.shoot(camera, pose);
  auto a = make_observer(camera, {carton.object});
  auto b = make_observer(camera, {carton.object});
  const Observation first = look(*a, *frame);
  const Observation second = look(*b, *frame);
  ASSERT_EQ(corners_of(first).matches().size(), corners_of(second).matches().size());
  for (size_t i = 0; i < corners_of(first).matches().size(); ++i) {
    EXPECT_EQ(corners_of(first).matches()[i].pixel, corners_of(second).matches()[i].pixel);
  }
  ASSERT_FALSE(first.hypotheses.empty());
  EXPECT_EQ(first.hypotheses[0].world_from_object.translation,
            second.hypotheses.at(0).world_from_object.translation);
}

}  // namespace
}  // namespace sightline
