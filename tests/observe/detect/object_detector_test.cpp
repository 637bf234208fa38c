// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/detect/object_detector.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <numbers>

#include "observe/detect/kernels/scan_kernel.hpp"
#include "sightline/base/cpu.hpp"
#include "sightline/observe/detect/color_verifier.hpp"
#include "support/random.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::test {
namespace {

using namespace std::chrono_literals;

constexpr ObjectId kObject(3);

std::unique_ptr<ObjectDetector> detector_for(const SceneRig& rig, const TriangleMesh& mesh) {
  DetectorOptions options;
  options.nearest = 0.55;
  options.farthest = 0.9;
  return ObjectDetector::create(kObject, views_of(mesh), detector_cameras(rig), options).value();
}

template <typename Detector>
void add_frames(const SceneRig& rig, Detector& detector) {
  add_first_frames(rig, [&](CameraId id, const Frame& frame) { detector.add_frame(id, frame); });
}

// Every camera is searched once, until something is found.
Detection first_found(const SceneRig& rig, ObjectDetector& detector) {
  Detection found;
  for (size_t i = 0; i < rig.cameras().size() && found.poses.empty(); ++i) {
    found = detector.detect();
  }
  return found;
}

TEST(ObjectDetector, FindsWhatLiesThere) {
  const TriangleMesh mesh = make_truck();
  const SceneRig rig(search_scene(mesh, resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01}))));
  const auto detector = detector_for(rig, mesh);
  add_frames(rig, *detector);
  const Detection found = first_found(rig, *detector);
  ASSERT_EQ(found.poses.size(), 1u);
  const Rigid3 truth = rig.truth(found.time);
  EXPECT_LT(translation_distance(found.poses[0].world_from_object, truth), 0.006);
  EXPECT_LT(rotation_angle(found.poses[0].world_from_object, truth), 0.06);
  EXPECT_LT(found.runner_up, 0.8 * found.poses[0].evidence);
  ASSERT_GE(found.observations.size(), 2u);
  for (const Observation& observation : found.observations) {
    EXPECT_EQ(observation.object, kObject);
    ASSERT_EQ(observation.terms.size(), 1u);
    ASSERT_EQ(observation.hypotheses.size(), 1u);
    const LinearizedTerm term = observation.terms[0]->linearize(truth);
    EXPECT_GT(term.residuals, 0);
    EXPECT_EQ(observation.terms[0]->kind(), "detection");
  }
  // The same frames again: nothing has moved.
  const Detection again = detector->follow(found);
  ASSERT_EQ(again.poses.size(), 1u);
  EXPECT_LT(translation_distance(again.poses[0].world_from_object, truth), 0.006);
}

TEST(ObjectDetector, FindsWhatMovesBetweenFreeRunningCameras) {
  const TriangleMesh mesh = make_truck();
  const ScenePath path = [](Time time) {
    const double t = to_seconds(time - Time{}) - 1.0;
    return turned(0.8 + 1.2 * t, {1, 2, 3}, {0.03 + 0.3 * t, 0.2 * t - 0.04, 0.01});
  };
  SceneRigOptions options = search_scene(mesh, path);
  options.phases = {0, 0.3, 0.7};
  const SceneRig rig(options);
  const auto detector = detector_for(rig, mesh);
  // A search after each round of the cameras, as a replay does.
  Detection found;
  int frames = 0;
  for (const SceneShot& shot : rig.shots()) {
    detector->add_frame(CameraId(static_cast<uint32_t>(shot.camera)), *rig.shoot(shot));
    if (++frames % 3 == 0) found = detector->detect();
    if (!found.poses.empty()) break;
  }
  ASSERT_EQ(found.poses.size(), 1u) << "within " << to_seconds(options.duration) << " s";
  EXPECT_LT(translation_distance(found.poses[0].world_from_object, rig.truth(found.time)), 0.008);
  Time before{};
  for (const Observation& observation : found.observations) {
    EXPECT_GE(observation.capture, before);
    before = observation.capture;
    const Rigid3 truth = rig.truth(observation.capture);
    EXPECT_LT(translation_distance(observation.hypotheses[0].world_from_object, truth), 0.01);
  }
}

TEST(ObjectDetector, ASearchAboutItsPlaceComesToThePoseThatIsThere) {
  const TriangleMesh mesh = make_truck();
  const SceneRig rig(search_scene(mesh, resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01}))));
  const auto detector = detector_for(rig, mesh);
  add_frames(rig, *detector);
  const Time now = rig.info_of(rig.shots().front()).capture;
  const Rigid3 truth = rig.truth(now);
  const PlaceSearch right = detector->search_about(truth, Vector6::Zero(), now);
  EXPECT_TRUE(right.same);
  const OrientationComparison as_it_is =
      detector->compare_orientations(truth, Vector6::Zero(), now);
  EXPECT_LE(as_it_is.rank, as_it_is.fitted_rank);
  EXPECT_LT(right.rank, 1.3 * as_it_is.fitted_rank);

  const Rigid3 wrong = truth * turned(0.9, {1, 1, 0}, {0, 0, 0});
  const PlaceSearch other = detector->search_about(wrong, Vector6::Zero(), now);
  EXPECT_FALSE(other.same);
  EXPECT_NEAR(other.rank, right.rank, 0.1 * right.rank);
  EXPECT_GT(other.rank,
            1.3 * detector->compare_orientations(wrong, Vector6::Zero(), now).fitted_rank);
  const PlaceSearch nowhere =
      detector->search_about(truth * turned(0, {1, 0, 0}, {0, 0, 9}), Vector6::Zero(), now);
  EXPECT_FALSE(nowhere.same);
  EXPECT_EQ(nowhere.rank, 0);
}

TEST(ObjectDetector, LooksInTheVolumeOnly) {
  const TriangleMesh mesh = make_truck();
  const SceneRig rig(search_scene(mesh, resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01}))));
  const Eigen::Vector3d center = views_of(mesh)->center();
  const Eigen::Vector3d place = rig.truth(rig.shots().front().true_capture) * center;
  const auto found_in = [&](const Box3& volume) {
    DetectorOptions options;
    options.volume = volume;
    const auto detector =
        ObjectDetector::create(kObject, views_of(mesh), detector_cameras(rig), options).value();
    add_frames(rig, *detector);
    return first_found(rig, *detector);
  };
  const Eigen::Vector3d half(0.15, 0.15, 0.15), aside(0.4, 0, 0);
  const Detection found = found_in({place - half, place + half});
  ASSERT_EQ(found.poses.size(), 1u);
  EXPECT_LT(translation_distance(found.poses[0].world_from_object, rig.truth(found.time)), 0.006);
  EXPECT_TRUE(found_in({place + aside - half, place + aside + half}).poses.empty());
}

TEST(ObjectDetector, DoesNotSeeWhatIsNotThere) {
  const TriangleMesh mesh = make_truck();
  SceneRigOptions options =
      search_scene(mesh, resting(Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 9})));
  const SceneRig empty(options);
  const auto detector = detector_for(empty, mesh);
  EXPECT_TRUE(detector->detect().poses.empty()) << "without a frame";
  add_frames(empty, *detector);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(detector->detect().poses.empty());
}

TEST(ObjectDetector, DoesNotTakeAnotherThingForIt) {
  const SceneRig rig(search_scene(make_creature(2000), resting(turned(0.4, {1, 0, 2}, {0, 0, 0}))));
  const auto detector = detector_for(rig, make_truck());
  add_frames(rig, *detector);
  for (int i = 0; i < 3; ++i) {
    const Detection found = detector->detect();
    EXPECT_TRUE(found.poses.empty()) << found.poses[0].evidence;
  }
}

TEST(ObjectDetector, ReturnsAllPosesOfASymmetricThing) {
  const TriangleMesh mesh = make_carton();
  const SceneRig rig(search_scene(mesh, resting(turned(0.7, {1, 3, 2}, {0.01, 0.02, 0}))));
  const auto detector = detector_for(rig, mesh);
  add_frames(rig, *detector);
  const Detection found = first_found(rig, *detector);
  ASSERT_EQ(found.poses.size(), 4u) << "a box looks the same after half a turn about each axis";
  const Rigid3 truth = rig.truth(found.time);
  double nearest = std::numbers::pi;
  for (const DetectedPose& pose : found.poses) {
    nearest = std::min(nearest, rotation_angle(pose.world_from_object, truth));
    EXPECT_LT(translation_distance(pose.world_from_object, truth), 0.01);
  }
  EXPECT_LT(nearest, 0.08);
  ASSERT_FALSE(found.observations.empty());
  const Observation& observation = found.observations.front();
  ASSERT_EQ(observation.hypotheses.size(), 4u);
  for (const PoseHypothesis& pose : observation.hypotheses) {
    const LinearizedTerm term = observation.terms[0]->linearize(pose.world_from_object);
    EXPECT_NEAR(term.cost, pose.cost, 1e-6) << "each is a minimum of its own";
  }
}

TEST(ColorVerifier, DecidesBetweenSymmetricPosesByColor) {
  const TriangleMesh mesh = test::make_colored_carton();
  const SceneRig rig(search_scene(mesh, resting(turned(0.7, {1, 3, 2}, {0.01, 0.02, 0}))));
  const auto detector = detector_for(rig, mesh);
  const std::vector<DetectorCamera> cameras = detector_cameras(rig);
  EXPECT_FALSE(ColorVerifier::create({}, cameras));
  const auto colors = ColorVerifier::create(test::samples_of(mesh), cameras).value();
  add_frames(rig, *detector);
  Detection found = first_found(rig, *detector);
  ASSERT_GT(found.poses.size(), 1u);
  const Detection before = found;
  colors->resolve(found);
  EXPECT_EQ(found.poses.size(), before.poses.size()) << "without images nothing is decided";
  add_frames(rig, *colors);
  colors->resolve(found);
  ASSERT_EQ(found.poses.size(), 1u);
  EXPECT_LT(rotation_angle(found.poses[0].world_from_object, rig.truth(found.time)), 0.08);
  for (const Observation& observation : found.observations) {
    ASSERT_EQ(observation.hypotheses.size(), 1u);
    const Rigid3& pose = observation.hypotheses[0].world_from_object;
    EXPECT_GT(colors->correlation(observation, pose), 0.2);
    EXPECT_NEAR(observation.terms[0]->linearize(pose).cost, observation.hypotheses[0].cost, 1e-6);
  }
}

TEST(ObjectDetector, GivesTheSameTwice) {
  const TriangleMesh mesh = make_truck();
  const SceneRig rig(search_scene(mesh, resting(turned(2.0, {3, 1, 1}, {0, 0.03, 0}))));
  const auto one = detector_for(rig, mesh), two = detector_for(rig, mesh);
  add_frames(rig, *one);
  add_frames(rig, *two);
  const Detection a = one->detect(), b = two->detect();
  ASSERT_EQ(a.poses.size(), b.poses.size());
  EXPECT_EQ(a.runner_up, b.runner_up);
  for (size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_EQ(a.poses[i].world_from_object.matrix(), b.poses[i].world_from_object.matrix());
  }
}

TEST(ObjectDetector, RefusesWhatMakesNoSense) {
  const auto views = views_of(make_carton());
  EXPECT_FALSE(ObjectDetector::create(kObject, views, {}));
  SceneRigOptions options = search_scene(make_carton(), resting(Rigid3()));
  options.azimuths_deg = {0};
  const SceneRig rig(options);
  const std::vector<DetectorCamera> cameras = {{CameraId(0), rig.cameras()[0]}};
  const auto refused = [&](auto change) {
    DetectorOptions o;
    change(o);
    const auto made = ObjectDetector::create(kObject, views, cameras, o);
    return !made && made.error().code == ErrorCode::kInvalidInput;
  };
  EXPECT_TRUE(refused([](auto& o) { o.nearest = 2, o.farthest = 1; }));
  EXPECT_TRUE(refused([](auto& o) { o.accept = 0; }));
  EXPECT_TRUE(refused([](auto& o) { o.margin = 1.5; }));
}

TEST(ScanKernel, LeavesOutOnlyWhatCannotReachTheThreshold) {
  Random random(6);
  constexpr int kColumns = 500, kFeatures = 31;
  std::vector<std::vector<uint8_t>> maps(kFeatures, std::vector<uint8_t>(kColumns + 64));
  for (int x = 0; x < kColumns; ++x) {
    const double level = x / 64 % 4 * 2;  // some parts respond to every feature
    for (auto& map : maps) {
      map[static_cast<size_t>(x)] = static_cast<uint8_t>(random.uniform(level / 2, level + 2.99));
    }
  }
  std::vector<const uint8_t*> features;
  for (const auto& map : maps) features.push_back(map.data());
  int left_out = 0, reached = 0;
  for (const uint8_t threshold : std::array<uint8_t, 4>{120, 160, 190, 210}) {
    std::vector<uint8_t> sums(kColumns + 64);
    observe::sum_features(features, 0, kColumns, threshold, sums.data());
    for (size_t x = 0; x < kColumns; ++x) {
      int whole = 0;
      for (const auto& map : maps) whole += map[x];
      left_out += sums[x] != whole;
      reached += whole >= threshold;
      EXPECT_TRUE(sums[x] == whole || (whole < threshold && sums[x] == 0)) << x;
    }
  }
  EXPECT_GT(left_out, 0);
  EXPECT_GT(reached, 0);
}

TEST(ScanKernel, FindsEachSumThatReachesTheThreshold) {
  Random random(6);
  for (const size_t columns : {1u, 15u, 16u, 17u, 80u, 131u}) {
    std::vector<uint8_t> sums(columns + 64, 255);  // what lies behind does not count
    for (size_t i = 0; i < columns; ++i) sums[i] = static_cast<uint8_t>(random.uniform(0, 200));
    for (const uint8_t threshold : std::array<uint8_t, 4>{1, 100, 190, 220}) {
      std::vector<size_t> expected, found;
      for (size_t i = 0; i < columns; ++i) {
        if (sums[i] >= threshold) expected.push_back(i);
      }
      for (size_t i = observe::next_reaching(sums, 0, columns, threshold); i < columns;
           i = observe::next_reaching(sums, i + 1, columns, threshold)) {
        found.push_back(i);
      }
      EXPECT_EQ(found, expected) << columns;
    }
  }
}

TEST(ScanKernel, IsTheSameWithAndWithoutAvx2) {
#ifdef SIGHTLINE_X86_64
  if (!cpu_has_avx2()) GTEST_SKIP() << "this processor has no AVX2";
  Random random(5);
  std::vector<uint8_t> map(4000);
  for (uint8_t& value : map) value = static_cast<uint8_t>(random.uniform(0, 8.99));
  std::vector<const uint8_t*> features;
  for (int i = 0; i < 31; ++i) {
    features.push_back(map.data() + static_cast<size_t>(random.uniform(0, 3000)));
  }
  for (const int columns : {1, 31, 32, 33, 160, 161, 320, 500}) {
    for (const uint8_t threshold : std::array<uint8_t, 6>{1, 120, 160, 190, 210, 249}) {
      std::vector<uint8_t> a(600), b(600);
      EXPECT_EQ(observe::sum_features_scalar(features, 0, columns, threshold, a.data()),
                observe::sum_features_avx2(features, 0, columns, threshold, b.data()));
      EXPECT_EQ(a, b);
    }
  }
#endif
}

}  // namespace
}  // namespace sightline::test
