// SPDX-License-Identifier: Apache-2.0
// The stages of ObjectDetector, each by itself: scan, verify, fit, judge.
#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <thread>

#include "made_poses.hpp"
#include "observe/detect/colors/color_silhouettes.hpp"
#include "observe/detect/contour_search.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/judge/contour_belief.hpp"
#include "observe/detect/judge/detection_judge.hpp"
#include "observe/detect/pixels/outline_contrast.hpp"
#include "observe/detect/pixels/sample_edges.hpp"
#include "observe/detect/pixels/sector_contrast.hpp"
#include "observe/detect/plan/search_distances.hpp"
#include "observe/detect/pose_fit.hpp"
#include "observe/detect/pose_scan.hpp"
#include "observe/detect/pose_verification.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "support/lens_camera.hpp"
#include "support/random.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using test::turned;

constexpr ObjectId kObject(3);

DetectorOptions stage_options() {
  DetectorOptions options;
  options.nearest = 0.55;
  options.farthest = 0.9;
  return options;
}

// A truck at rest before three cameras, one frame of each; made once, used by all tests.
struct Scene {
  Scene()
      : rig(test::search_scene(test::make_truck(),
                               test::resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01})))),
        cameras(test::detector_cameras(rig)),
        truth(rig.truth(rig.shots().front().true_capture)),
        bank(test::views_of(test::make_truck())),
        silhouettes(bank),
        distances(search_distances(cameras, bank.model().radius(), stage_options())) {}

  DetectorFrames frames() const {
    DetectorFrames out(cameras, stage_options());
    test::add_first_frames(rig,
                           [&](CameraId id, const Frame& frame) { out.add(id, frame, nullptr); });
    EXPECT_TRUE(out.select(DetectorFrames::Where::kEverywhere));
    return out;
  }

  test::SceneRig rig;
  std::vector<DetectorCamera> cameras;
  Rigid3 truth;
  TemplateBank bank;
  SilhouetteSearch silhouettes;
  SearchDistances distances;
};

const Scene& scene() {
  static const Scene made;
  return made;
}

TEST(SearchDistances, KeepToTheOptions) {
  const SearchDistances distances = search_distances(scene().cameras, 0.05, stage_options());
  ASSERT_EQ(distances.cameras.size(), 3u);
  const CameraDistances& first = distances.cameras[0];
  EXPECT_EQ(first.nearest, 0.55);
  EXPECT_EQ(first.farthest, 0.9);
  ASSERT_EQ(first.scales.size(), 3u) << "a step is at most 1.25";
  EXPECT_TRUE(std::is_sorted(first.scales.rbegin(), first.scales.rend())) << "nearest first";
  const double fx = scene().cameras[0].calibration.model.parameters().fx;
  EXPECT_LT(first.scales.front(), fx / (kMapShrink * 0.55));
  EXPECT_GT(first.scales.back(), fx / (kMapShrink * 0.9));
}

TEST(SearchDistances, ComeFromWhereTheCamerasLook) {
  const SearchDistances distances = search_distances(scene().cameras, 0.05, {});
  for (size_t i = 0; i < distances.cameras.size(); ++i) {
    // The optical axes meet near the origin.
    const double usual = scene().cameras[i].calibration.world_from_camera.translation.norm();
    EXPECT_GT(distances.cameras[i].nearest, 0.4 * usual);
    EXPECT_LT(distances.cameras[i].farthest, 1.8 * usual);
  }
}

TEST(SearchDistances, ComeFromTheVolume) {
  DetectorOptions options;
  options.volume = Box3{{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}};
  const SearchDistances distances = search_distances(scene().cameras, 0.05, options);
  for (size_t i = 0; i < distances.cameras.size(); ++i) {
    const CameraDistances& one = distances.cameras[i];
    const CalibratedCamera& camera = scene().cameras[i].calibration;
    const Eigen::Vector3d& eye = camera.world_from_camera.translation;
    EXPECT_NEAR(one.nearest, options.volume->distance(eye), 1e-9);
    EXPECT_NEAR(one.farthest, options.volume->farthest(eye), 1e-9);
    // Every point of it is in the part of the image that is scanned.
    test::Random random(3);
    for (int k = 0; k < 100; ++k) {
      const Eigen::Vector3d point =
          options.volume->at(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1));
      const auto pixel = camera.model.project(camera.world_from_camera.inverse() * point);
      ASSERT_TRUE(pixel);
      EXPECT_TRUE(one.image.contains(*pixel));
    }
    EXPECT_LT(one.image.sizes().x(), 0.9 * camera.model.width());
  }
  // A camera in the volume may see the object anywhere.
  options.volume = Box3{{-9, -9, -9}, {9, 9, 9}};
  EXPECT_TRUE(search_distances(scene().cameras, 0.05, options).cameras[0].image.isEmpty());
}

TEST(DetectorFrames, LeaveOutWhatIsTooOld) {
  DetectorFrames frames(scene().cameras, stage_options());
  EXPECT_FALSE(frames.select(DetectorFrames::Where::kEverywhere)) << "without a frame";
  const test::SceneRig& rig = scene().rig;
  const auto add_of = [&](int camera, auto shot) {
    for (; shot != rig.shots().end(); ++shot) {
      if (shot->camera != camera) continue;
      frames.add(CameraId(static_cast<uint32_t>(camera)), *rig.shoot(*shot), nullptr);
      return;
    }
  };
  add_of(0, rig.shots().begin());
  add_of(1, rig.shots().begin());
  ASSERT_TRUE(frames.select(DetectorFrames::Where::kEverywhere));
  EXPECT_EQ(frames.size(), 2u);
  EXPECT_TRUE(frames.silhouette_cameras(scene().distances).empty()) << "no background is known";
  const auto later = std::find_if(rig.shots().begin(), rig.shots().end(), [&](const auto& shot) {
    return shot.stamp - rig.shots().front().stamp > std::chrono::milliseconds(150);
  });
  add_of(1, later);
  ASSERT_TRUE(frames.select(DetectorFrames::Where::kEverywhere));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames.camera_index(0), 1u);
  EXPECT_EQ(frames.newest(), frames.info(0).capture);
}

TEST(PoseScan, HitsTheObjectInOneCamera) {
  DetectorFrames frames = scene().frames();
  frames.compute_responses(scene().distances.map_margin, DetectorFrames::Edges::kBorders);
  PoseScan scan(scene().bank, scene().distances, 12000);
  for (const size_t expected : {0u, 1u, 2u, 0u}) {
    EXPECT_EQ(scan.next_camera(frames, DetectorFrames::Where::kEverywhere), expected);
  }
  const ScanResult found = scan.scan(frames, 1, DetectorFrames::Where::kEverywhere);
  EXPECT_EQ(found.camera, 1u);
  EXPECT_LE(found.hits.size(), 12000u);
  const CalibratedCamera& camera = scene().cameras[1].calibration;
  const Rigid3 camera_from_object = camera.world_from_camera.inverse() * scene().truth;
  const bool hit = std::any_of(found.hits.begin(), found.hits.end(), [&](const ScanHit& h) {
    const auto pose =
        scene().bank.full_pose(camera.model, template_pose(h, found.range), kMapShrink);
    return pose && rotation_angle(*pose, camera_from_object) < 0.4 &&
           translation_distance(*pose, camera_from_object) < 0.1;
  });
  EXPECT_TRUE(hit);
}

// The scan reads every other column in one go; one pose at a time is looked up by itself.
TEST(PoseScan, ScoresWhatThePoseHasByItself) {
  DetectorFrames frames = scene().frames();
  frames.compute_responses(scene().distances.map_margin, DetectorFrames::Edges::kBorders);
  const PoseScan scan(scene().bank, scene().distances, 1200);
  const ScanResult found = scan.scan(frames, 0, DetectorFrames::Where::kEverywhere);
  ASSERT_GT(found.hits.size(), 500u);
  const SearchCamera& camera = frames.search_cameras()[0];
  for (size_t i = 0; i < found.hits.size(); i += 7) {
    const ScanHit& hit = found.hits[i];
    const WeakPerspectivePose pose = template_pose(hit, found.range);
    const ResponseMaps& maps =
        camera.far(static_cast<double>(pose.scale), scene().bank.model().radius());
    const auto most =
        static_cast<float>(ResponseMaps::kFullResponse * scene().bank.features(hit.view).count);
    EXPECT_NEAR(scene().bank.score(pose, maps) * most, hit.score, 0.01) << i;
    EXPECT_EQ(hit.x % ResponseMaps::kColumnStep, 0);
  }
}

TEST(PoseScan, KeepsToColumnsNearTheForeground) {
  constexpr int kWidth = 40, kHeight = 20;
  std::vector<uint8_t> mask(kWidth * kHeight, 0);
  mask[10 * kWidth + 12] = mask[10 * kWidth + 15] = 1;
  const auto rows = columns_near(mask, kWidth, kHeight, 2);
  ASSERT_EQ(rows.size(), 10u);
  for (int y = 0; y < 10; ++y) {
    const auto [first, end] = rows[static_cast<size_t>(y)];
    if (y < 3 || y > 7) {
      EXPECT_GE(first, end) << y;
    } else {
      EXPECT_EQ(first, 4) << y;
      EXPECT_EQ(end, 11) << y;
    }
  }
}

TEST(PoseScan, KeepsToAPartOfTheImage) {
  const Eigen::AlignedBox2d image(Eigen::Vector2d(40, 20), Eigen::Vector2d(79, 39));
  const auto rows = columns_within({}, image, 4, 40, 20);
  ASSERT_EQ(rows.size(), 20u);
  for (int y = 0; y < 20; ++y) {
    const auto [first, end] = rows[static_cast<size_t>(y)];
    if (y < 5 - kScanRowStep || y >= 10 + kScanRowStep) {
      EXPECT_GE(first, end) << y;
    } else {
      EXPECT_EQ(first, 10) << y;
      EXPECT_EQ(end, 20) << y;
    }
  }
  const auto fewer =
      columns_within(std::vector<std::array<int, 2>>(20, {15, 17}), image, 4, 40, 20);
  EXPECT_EQ(fewer[7], (std::array{15, 17}));
}

TEST(PoseVerification, FindsWhereAllCamerasAgree) {
  DetectorFrames frames = scene().frames();
  frames.compute_responses(scene().distances.map_margin, DetectorFrames::Edges::kBorders);
  const PoseScan scan(scene().bank, scene().distances, 12000);
  const PoseVerification verification(scene().bank, scene().silhouettes);
  const auto poses =
      verification.by_edges(frames, scan.scan(frames, 0, DetectorFrames::Where::kEverywhere));
  ASSERT_GT(poses.size(), 100u);
  const bool found = std::any_of(poses.begin(), poses.begin() + 100, [&](const JointPose& pose) {
    return translation_distance(pose.world_from_object, scene().truth) < 0.03 &&
           rotation_angle(pose.world_from_object, scene().truth) < 0.3;
  });
  EXPECT_TRUE(found);
  EXPECT_TRUE(verification.by_silhouettes(frames, {}).empty());
}

// Hands the indices out backwards, to two threads.
void run_backwards(size_t count, const std::function<void(size_t)>& body) {
  std::atomic<size_t> left = count;
  const auto take_part = [&] {
    for (size_t i = left--; i > 0 && i <= count; i = left--) body(i - 1);
  };
  std::jthread helper(take_part);
  take_part();
}

TEST(ObjectDetector, TheSameWithAnyExecutor) {
  const auto detect = [](const Executor& executor) {
    const auto views = test::views_of(test::make_truck());
    auto detector =
        ObjectDetector::create(kObject, views, scene().cameras, stage_options(), executor);
    EXPECT_TRUE(detector) << detector.error().message();
    test::add_first_frames(
        scene().rig, [&](CameraId id, const Frame& frame) { (*detector)->add_frame(id, frame); });
    DetectionTrace trace;
    (*detector)->explain(trace);
    return std::pair((*detector)->detect(), trace);
  };
  const auto [one, one_trace] = detect(run_serially);
  const auto [two, two_trace] = detect(run_backwards);
  ASSERT_FALSE(one.poses.empty());
  ASSERT_EQ(two.poses.size(), one.poses.size());
  for (size_t i = 0; i < one.poses.size(); ++i) {
    EXPECT_EQ(two.poses[i].evidence, one.poses[i].evidence);
    EXPECT_EQ(translation_distance(two.poses[i].world_from_object, one.poses[i].world_from_object),
              0);
  }
  ASSERT_EQ(two_trace.stages.size(), one_trace.stages.size());
  for (size_t k = 0; k < one_trace.stages.size(); ++k) {
    const auto &a = one_trace.stages[k].candidates, &b = two_trace.stages[k].candidates;
    ASSERT_EQ(a.size(), b.size()) << one_trace.stages[k].name;
    EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), [](const auto& x, const auto& y) {
      return x.score == y.score;
    })) << one_trace.stages[k].name;
  }
}

TEST(PoseVerification, FollowsFromNearby) {
  DetectorFrames frames = scene().frames();
  frames.compute_responses(scene().distances.map_margin, DetectorFrames::Edges::kBorders);
  const PoseVerification verification(scene().bank, scene().silhouettes);
  const Rigid3 start = scene().truth * turned(0.1, {0, 1, 1}, {0.012, -0.01, 0.008});
  const auto moved = verification.follow(frames, {}, start);
  ASSERT_EQ(moved.size(), 1u) << "no background is known";
  EXPECT_GT(translation_distance(start, scene().truth), 0.017);
  EXPECT_LT(translation_distance(moved[0], scene().truth), 0.013) << "fitting does the rest";
}

TEST(PoseFitter, MovesOntoTheEdges) {
  const DetectorFrames frames = scene().frames();
  const PoseFitter fitter(scene().bank.model());
  const Rigid3 start = scene().truth * turned(0.04, {1, 0, 1}, {0.004, 0.003, -0.004});
  const PoseFit fit = fitter.fit(frames.fit_cameras(), {start, Vector6::Zero()}, kSearchReach);
  EXPECT_LT(translation_distance(fit.motion.world_from_object, scene().truth), 0.003);
  EXPECT_LT(rotation_angle(fit.motion.world_from_object, scene().truth), 0.04);
  ASSERT_EQ(fit.cameras.size(), 3u);
  double evidence = 0;
  for (const CameraFit& camera : fit.cameras) evidence += camera_evidence(camera);
  EXPECT_GT(evidence, stage_options().accept);

  const PoseFit away = fitter.evaluate(
      frames.fit_cameras(), {scene().truth * turned(0, {1, 0, 0}, {0.1, 0, 0}), Vector6::Zero()});
  double elsewhere = 0;
  for (const CameraFit& camera : away.cameras) elsewhere += camera_evidence(camera);
  EXPECT_LT(elsewhere, 0.5 * evidence);
  EXPECT_EQ(fitter.fit_rotated(frames.fit_cameras(), fit.motion).size(), 23u);
}

class Judging : public ::testing::Test {
 protected:
  Judging() : frames(scene().frames()), judge(kObject, stage_options(), {0, 0, 0}, 0.05) {}

  Detection decide(std::vector<JudgedPose> judged) const {
    Detection out;
    judge.decide(frames, judged, out);
    return out;
  }

  DetectorFrames frames;
  DetectionJudge judge;
  Rigid3 here, there{Eigen::Quaterniond::Identity(), {0.2, 0, 0}};
  Rigid3 turned_here = turned(1.57, {0, 0, 1}, {0, 0, 0});
};

TEST_F(Judging, TwoCamerasHaveToAgree) {
  const JudgedPose both = judge.judge(made_fit(here, {0.7, 0.7, 0.2}));
  EXPECT_NEAR(both.evidence, 2 * (0.7 - kClutterEvidence), 1e-12);
  EXPECT_EQ(both.cameras, 2);
  EXPECT_TRUE(judge.acceptable(both, 3));
  EXPECT_FALSE(judge.acceptable(judge.judge(made_fit(here, {1.0, 0.3, 0.3})), 3)) << "one of three";
  EXPECT_TRUE(judge.acceptable(judge.judge(made_fit(here, {1.0})), 1)) << "one of one";
  EXPECT_TRUE(judge.clear(both, 3));
  EXPECT_FALSE(judge.clear(judge.judge(made_fit(here, {0.6, 0.6, 0.3})), 3));
}

TEST_F(Judging, FastMotionCosts) {
  PoseFit moving = made_fit(here, {0.7, 0.7, 0.7});
  moving.motion.twist[5] = 2 * kTwistSigmaLinear;
  const double slow = judge.judge(made_fit(here, {0.7, 0.7, 0.7})).evidence;
  EXPECT_NEAR(slow - judge.judge(moving).evidence, 4 * kTwistPenalty, 1e-12);
}

TEST_F(Judging, OnePoseWithAMarginIsTheAnswer) {
  const Detection found = decide({judge.judge(made_fit(there, {0.6, 0.6, 0.5})),
                                  judge.judge(made_fit(here, {0.9, 0.9, 0.1}))});
  ASSERT_EQ(found.poses.size(), 1u);
  EXPECT_EQ(found.poses[0].world_from_object.matrix(), here.matrix());
  EXPECT_NEAR(found.runner_up, 0.65, 1e-9);
  ASSERT_EQ(found.observations.size(), 2u) << "of the cameras that see it";
  EXPECT_EQ(found.observations[0].object, kObject);
  EXPECT_EQ(found.observations[0].terms[0]->kind(), "detection");
}

TEST_F(Judging, WithoutAMarginBothAreHypotheses) {
  const Detection found = decide({judge.judge(made_fit(here, {0.9, 0.9, 0.9})),
                                  judge.judge(made_fit(turned_here, {0.88, 0.88, 0.88})),
                                  judge.judge(made_fit(here, {0.85, 0.85, 0.85}))});
  ASSERT_EQ(found.poses.size(), 2u) << "the third is the first";
  ASSERT_EQ(found.observations.size(), 3u);
  for (const Observation& observation : found.observations) {
    ASSERT_EQ(observation.hypotheses.size(), 2u);
    EXPECT_EQ(observation.hypotheses[0].cost, observation.hypotheses[1].cost);
  }
}

TEST_F(Judging, AnEqualAtAnotherPlaceRefusesBoth) {
  const Detection found = decide({judge.judge(made_fit(here, {0.9, 0.9, 0.9})),
                                  judge.judge(made_fit(there, {0.88, 0.88, 0.88}))});
  EXPECT_TRUE(found.poses.empty());
  EXPECT_GT(found.runner_up, 1);
}

TEST_F(Judging, ProposalsNeedSomeOutline) {
  ProposedPose proposal;
  proposal.evidence = 0.5;
  proposal.terms.resize(3);
  const JudgedPose seen = judge.judge(made_fit(here, {0.5, 0.2, 0.2}), &proposal);
  EXPECT_NEAR(seen.evidence, 0.5 + seen.outline, 1e-12);
  EXPECT_TRUE(judge.acceptable(seen, 3)) << "one camera is enough";
  const Detection none = decide({judge.judge(made_fit(here, {0.2, 0.2, 0.2}), &proposal)});
  EXPECT_TRUE(none.poses.empty());
  EXPECT_EQ(none.runner_up, 0.5);
  EXPECT_TRUE(decide({}).poses.empty());
}

TEST(ColorSilhouettes, TellTheOrientationAtAPlace) {
  const DetectorFrames frames = scene().frames();
  const Eigen::Vector3d& center = scene().bank.model().center();
  const auto rotated = [&](double angle, const Eigen::Vector3d& axis) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, axis.normalized()));
    return RigMotion{scene().truth * Rigid3(turn, center - turn * center), Vector6::Zero()};
  };
  // Learned at a pose that is not right: most of what is inside is the truck all the same.
  const ColorSilhouettes colors(frames, scene().bank.model(), rotated(0.2, {0, 1, 0}),
                                std::vector{1.0, 1.0, 0.0});
  ASSERT_EQ(colors.cameras().size(), 1u)
      << "of the second the colors say little, the third does not show it";
  const double truth = colors.overlap(scene().silhouettes, rotated(0, {0, 0, 1}));
  EXPECT_GT(truth, 0.6);
  EXPECT_GT(truth, 1.05 * colors.overlap(scene().silhouettes, rotated(1.5, {0, 1, 0})));
  const auto poses = scene().silhouettes.orientations(colors.cameras(), scene().truth * center, 8);
  EXPECT_LE(poses.size(), 8u);
  const bool found = std::any_of(poses.begin(), poses.end(), [&](const JointPose& pose) {
    return rotation_angle(pose.world_from_object, scene().truth) < 0.5;
  });
  EXPECT_TRUE(found);
  EXPECT_TRUE(scene().silhouettes.orientations({}, center, 8).empty());
}

TEST(ContourSearch, TheTruthStandsOutFromItsSurroundings) {
  DetectorFrames frames = scene().frames();
  frames.compute_responses(scene().distances.map_margin, DetectorFrames::Edges::kBorders);
  const PoseFitter fitter(scene().bank.model());
  const ContourSearch contours(scene().bank, scene().silhouettes, fitter);
  const PoseScan scan(scene().bank, scene().distances, 12000);
  DetectionTrace trace;
  const PoseVerification verification(scene().bank, scene().silhouettes);
  const auto verified =
      verification.by_edges(frames, scan.scan(frames, 0, DetectorFrames::Where::kEverywhere));
  const auto poses = contours.search(frames, verified, nullptr, &trace, kMaxPool);
  ASSERT_FALSE(poses.empty());
  const Rigid3& best = poses.front().fit.motion.world_from_object;
  EXPECT_LT(translation_distance(best, scene().truth), 0.006);
  EXPECT_LT(rotation_angle(best, scene().truth), 0.06);
  EXPECT_GT(poses.front().score, kMinContourScore);
  std::vector<std::string> stages;
  for (const auto& stage : trace.stages) stages.push_back(stage.name);
  const std::vector<std::string> expected = {"pool",   "climbed", "screened",
                                             "fitted", "varied",  "final"};
  EXPECT_EQ(stages, expected);
  EXPECT_TRUE(std::is_sorted(poses.rbegin(), poses.rend(),
                             [](const auto& a, const auto& b) { return a.rank < b.rank; }));

  const Rigid3 beside = scene().truth * turned(0, {1, 0, 0}, {0.03, 0, 0});
  const double away = contours.evaluate(frames, {beside, Vector6::Zero()}).score;
  EXPECT_LT(away, 0.6 * poses.front().score);
}

TEST(ContourSearch, OneOfSeveralCamerasIsNotEnoughAndTheWorstOfThreeDoesNotCount) {
  EXPECT_NEAR(joint_rank({0.8}, 3), 0, 1e-12);
  EXPECT_NEAR(joint_rank({0.8}, 1), 0.8, 1e-12);
  EXPECT_NEAR(joint_rank({0.8, 0.6, 0.1}, 3), 0.5, 1e-12) << "among poses, every camera counts";
  EXPECT_NEAR(joint_score({0.8, -1, -1}), 0, 1e-12);
  EXPECT_NEAR(joint_score({0.8, 0.6, -1}), 0.7, 1e-12);
  EXPECT_NEAR(joint_score({0.8, 0.6, 0.1}), 0.7, 1e-12) << "something stands before the third";
  EXPECT_NEAR(joint_score({0.8}), 0.8, 1e-12) << "there is no other";
  EXPECT_EQ(joint_score({}), 0);
}

// A picture that gets lighter from left to right, inside of the outline as much as outside.
TEST(SectorContrast, AsksEachStretchForItsOwnOutside) {
  const CalibratedCamera& camera = scene().cameras[0].calibration;
  const Rigid3 camera_from_object = camera.world_from_camera.inverse() * scene().truth;
  const ViewpointModel& model = scene().bank.model();
  const View view = model.view(model.nearest(camera_from_object));
  const auto inside = model.nearest(camera_from_object);
  HalfSizeImage image;
  image.width = camera.model.width() / 2;
  image.height = camera.model.height() / 2;
  for (auto& plane : image.planes)
    plane.assign(static_cast<size_t>(image.width * image.height), 128);
  // The silhouette, painted by its samples.
  std::vector<uint8_t> mask(image.planes[0].size(), 0);
  for (const ContourSample& sample : model.view(inside).contour) {
    for (float depth = 0; depth < sample.foreground; depth += 0.0005f) {
      const Eigen::Vector3d point = (sample.point - depth * sample.normal).cast<double>();
      const auto pixel = camera.model.project(camera_from_object * point);
      if (!pixel) continue;
      const int x = static_cast<int>(pixel->x() / 2), y = static_cast<int>(pixel->y() / 2);
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      mask[static_cast<size_t>(y * image.width + x)] = 1;
    }
  }
  const auto contrast = [&](int step) {
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const auto i = static_cast<size_t>(y * image.width + x);
        const int light = 40 + x / 2 + (mask[i] != 0 ? step : 0);
        image.planes[0][i] = static_cast<uint8_t>(std::min(255, light));
      }
    }
    return sector_contrast(view, camera.model, camera_from_object, image, 1);
  };
  EXPECT_GT(contrast(40), contrast(0) + 0.3);
  const double global = outline_contrast(view, camera.model, camera_from_object, image, nullptr);
  EXPECT_GT(contrast(40), global + 0.1) << "all colors occur on both sides somewhere";
  // Without color differences luma stands for them: what differs stands out more, what does not
  // stays behind.
  const double colored = contrast(20);
  image.in_color = false;
  EXPECT_GT(contrast(20), colored + 0.1);
  EXPECT_GT(contrast(20), contrast(0) + 0.3);
  EXPECT_LE(contrast(40), 1);
}

TEST_F(Judging, ByContourAPoseNeedsAScoreAndNoRivalElsewhere) {
  const auto decide_by_contour = [&](const std::vector<ContourPose>& poses) {
    Detection out;
    judge.decide_by_contour(frames, poses, kMinContourScore, kMaxContourRival, out);
    return out;
  };
  const Detection found = decide_by_contour(
      {made_contour(here, {0.8, 0.8, 0.1}), made_contour(there, {0.5, 0.5, 0.5})});
  ASSERT_EQ(found.poses.size(), 1u);
  EXPECT_TRUE(found.by_contour);
  EXPECT_NEAR(found.poses[0].evidence, 0.8, 1e-12);
  EXPECT_EQ(found.poses[0].cameras, 2);
  EXPECT_EQ(found.observations.size(), 2u) << "of the cameras that see it";
  EXPECT_NEAR(found.runner_up, 0.5, 1e-12);

  const Detection doubtful = decide_by_contour(
      {made_contour(here, {0.8, 0.8, 0.8}), made_contour(there, {0.7, 0.7, 0.7})});
  EXPECT_TRUE(doubtful.poses.empty()) << "as good elsewhere";
  EXPECT_FALSE(doubtful.by_contour);
  EXPECT_TRUE(decide_by_contour({made_contour(here, {0.5, 0.5, 0.5})}).poses.empty());
  EXPECT_TRUE(decide_by_contour({}).poses.empty());

  const Rigid3 rotated = turned(1.5, {0, 0, 1}, {0, 0, 0});
  const Detection both = decide_by_contour(
      {made_contour(here, {0.8, 0.8, 0.8}), made_contour(rotated, {0.78, 0.78, 0.78})});
  EXPECT_EQ(both.poses.size(), 2u) << "at its own place they are hypotheses";
}

TEST_F(Judging, WhatEdgesFoundIsContradictedWhereColorsAndContoursDo) {
  const TriangleMesh mesh = test::make_colored_carton();
  const test::SceneRig rig(
      test::search_scene(mesh, test::resting(turned(0.7, {1, 3, 2}, {0.01, 0.02, 0}))));
  const auto colors =
      ColorVerifier::create(test::samples_of(mesh), test::detector_cameras(rig)).value();
  test::add_first_frames(
      rig, [&](CameraId camera, const Frame& frame) { colors->add_frame(camera, frame); });
  const ContourBelief belief(scene().bank.model(), judge);
  Detection right, wrong;
  right.time = wrong.time = rig.shots().front().true_capture;
  const Rigid3 truth = rig.truth(right.time);
  right.poses.push_back({truth, Vector6::Zero()});
  wrong.poses.push_back({truth * turned(3.1, {1, 0, 1}, {0.03, 0, 0}), Vector6::Zero()});
  const std::vector<ContourPose> as_good = {made_contour(here, {0.8, 0.8, 0.8}),
                                            made_contour(there, {0.75, 0.75, 0.75})};
  const std::vector<ContourPose> clear = {made_contour(here, {0.8, 0.8, 0.8}),
                                          made_contour(there, {0.5, 0.5, 0.5})};
  const auto contradicted = [&](const Detection& found, const std::vector<ContourPose>& contours,
                                const ColorVerifier* verifier) {
    return belief.contradicts(found, frames, contours, verifier);
  };
  EXPECT_TRUE(contradicted(wrong, as_good, colors.get()));
  EXPECT_FALSE(contradicted(wrong, clear, colors.get())) << "nothing like it elsewhere";
  EXPECT_FALSE(contradicted(right, as_good, colors.get())) << "its colors show";
  EXPECT_FALSE(contradicted(wrong, as_good, nullptr)) << "the mesh has none";
  EXPECT_FALSE(contradicted(wrong, {}, colors.get())) << "contours were not looked at";
  EXPECT_FALSE(contradicted({}, as_good, colors.get()));
}

TEST(SampleEdges, NormalIsWhereAStepAlongItLeads) {
  CalibratedCamera pinhole = test::lens_camera();
  CameraModel::Parameters bent = pinhole.model.parameters();
  bent.lens = LensModel::kFisheye;
  bent.distortion = {0.05, -0.01, 0.002, -0.0005};
  const CameraModel fisheye = CameraModel::create(bent, "test").value();
  test::Random random(5);
  for (const CameraModel& lens : {pinhole.model, fisheye}) {
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d place(random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2),
                                  random.uniform(0.6, 1.2));
      const Eigen::Quaterniond rotation(random.normal<4>().normalized());
      const Rigid3 camera_from_object(rotation, place);
      const Eigen::Vector3d point(random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), 0.03);
      const Eigen::Vector3d normal = random.normal<3>().normalized();
      const auto sample =
          project_sample(lens, Eigen::Isometry3d(camera_from_object.matrix()), point, normal);
      ASSERT_TRUE(sample);
      const auto at = [&](double step) {
        return *lens.project(camera_from_object * (point + step * normal));
      };
      const Eigen::Vector2d along = at(1e-6) - at(-1e-6);
      EXPECT_GT(sample->normal.dot(along.normalized()), 1 - 1e-6);
      EXPECT_LT((2 * sample->pixel + Eigen::Vector2d::Constant(0.5) - at(0)).norm(), 1e-9);
      const Eigen::Vector2d half = sample->jacobian * (camera_from_object.rotation * normal);
      EXPECT_LT((half * 4e-6 - along).norm(), 1e-3 * along.norm());
    }
  }
}

TEST(SampleEdges, ReachAnEdgeAlongTheNormal) {
  constexpr int kWidth = 40, kHeight = 30, kEdge = 20;
  HalfSizeImage image;
  image.width = kWidth;
  image.height = kHeight;
  for (auto& plane : image.planes) plane.assign(kWidth * kHeight, 128);
  ForegroundMap map{kWidth, kHeight, std::vector<uint8_t>(kWidth * kHeight), 0.5};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto i = static_cast<size_t>(y * kWidth + x);
      image.planes[0][i] = x < kEdge ? 60 : 180;
      map.classes[i] = x < kEdge ? ForegroundMap::kForeground : ForegroundMap::kBackground;
    }
  }
  EdgeImage edges;
  edges.compute(image);
  ProjectedSample sample;
  sample.pixel = {kEdge - 4.5, 15};
  sample.normal = {1, 0};
  const auto distance = best_edge(edges, sample, 7);
  ASSERT_TRUE(distance);
  EXPECT_NEAR(*distance, 4, 0.5);
  EXPECT_FALSE(best_edge(edges, sample, 2)) << "too far";
  const auto border = foreground_border(map, sample, 7);
  ASSERT_TRUE(border);
  EXPECT_NEAR(*border, 4, 1);
  EXPECT_TRUE(weak_edge(edges, {kEdge - 0.5, 15}, sample.normal));
  EXPECT_FALSE(weak_edge(edges, {kEdge - 0.5, 15}, {0, 1})) << "along the edge";
}

}  // namespace
}  // namespace sightline::observe
