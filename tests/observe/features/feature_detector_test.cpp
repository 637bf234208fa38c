// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/features/feature_detector.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "sightline/observe/detect/object_detector.hpp"
#include "sightline/observe/features/feature_trainer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/matchers.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::SceneRig;
using test::SceneRigOptions;

constexpr double kDegree = std::numbers::pi / 180;

// A printed carton that tumbles past two cameras.
SceneRigOptions tumbling(uint64_t seed, double turn_deg = 24) {
  SceneRigOptions options;
  options.distance = 0.45;
  options.azimuths_deg = {0, 50};
  options.shape = std::make_shared<const test::RayMesh>(test::make_carton());
  options.paint.kind = test::Paint::Kind::kPrinted;
  options.duration = std::chrono::milliseconds(900);
  options.rate_hz = 10;
  options.seed = seed;
  options.backdrop.seed = static_cast<uint32_t>(seed);
  test::SceneSteps steps;
  steps.half_room = {0.05, 0.05, 0.04};
  steps.step = 0.01;
  steps.turn = turn_deg * kDegree;
  steps.seed = seed;
  options.path = test::smooth_path(steps, options.duration);
  return options;
}

DepthRendererFactory depth_of(const TriangleMesh& mesh) {
  return mesh_depth_renderer_factory(std::make_shared<const RenderMesh>(make_render_mesh(mesh)));
}

FeatureModel trained(const SceneRig& rig, const DepthTile& scene = {}, size_t max = 100) {
  const TriangleMesh& mesh = rig.options().shape->mesh();
  FeatureTrainer trainer(mesh_content(mesh));
  const auto depth = depth_of(mesh)(rig.cameras()[0].model);
  for (const test::SceneShot& shot : rig.shots()) {
    if (max-- == 0) break;
    trainer.train(*rig.shoot(shot), rig.cameras()[static_cast<size_t>(shot.camera)],
                  rig.truth(shot.true_capture), *depth, scene);
  }
  return trainer.model();
}

const std::shared_ptr<const FeatureModel>& carton_model() {
  static const auto model = std::make_shared<const FeatureModel>(trained(SceneRig(tumbling(1))));
  return model;
}

const std::shared_ptr<const ViewpointModel>& carton_views() {
  static const std::shared_ptr<const ViewpointModel> views = [] {
    ViewpointModelOptions options;
    options.subdivisions = 2;
    options.image_px = 240;
    const TriangleMesh mesh = test::make_carton();
    return ViewpointModel::build(mesh, depth_of(mesh), options).value();
  }();
  return views;
}

std::vector<DetectorCamera> cameras_of(const SceneRig& rig) {
  std::vector<DetectorCamera> cameras;
  for (uint32_t i = 0; i < rig.cameras().size(); ++i) {
    cameras.push_back({CameraId(i), rig.cameras()[i]});
  }
  return cameras;
}

struct Found {
  size_t looks = 0, found = 0, several = 0, wrong = 0;
  std::vector<double> squared;  // error over covariance
};

// Every set of frames is looked at by itself.
Found look_for_carton(const SceneRig& rig) {
  Found out;
  auto finder = FeatureDetector::create(carton_model(), cameras_of(rig)).value();
  auto judge = ObjectDetector::create(ObjectId(0), carton_views(), cameras_of(rig)).value();
  for (const auto& shots : rig.sets()) {
    for (const test::SceneShot& shot : shots) {
      const FramePtr frame = rig.shoot(shot);
      finder->add_frame(CameraId(static_cast<uint32_t>(shot.camera)), *frame);
      judge->add_frame(CameraId(static_cast<uint32_t>(shot.camera)), *frame);
    }
    const Detection detection = judge->judge(finder->propose());
    ++out.looks;
    if (detection.poses.size() > 1) ++out.several;
    if (detection.poses.size() != 1) continue;
    ++out.found;
    const Rigid3 truth = rig.truth(shots[0].true_capture);
    const Rigid3& pose = detection.poses[0].world_from_object;
    out.wrong +=
        rotation_angle(pose, truth) > 6 * kDegree || translation_distance(pose, truth) > 0.02;
    Matrix6 information = Matrix6::Zero();
    Vector6 gradient = Vector6::Zero();
    for (const Observation& observation : detection.observations) {
      EXPECT_EQ(observation.terms.size(), 1u);
      EXPECT_EQ(observation.hypotheses.size(), 1u);
      EXPECT_EQ(observation.capture, shots[0].stamp);
      const LinearizedTerm at = observation.terms[0]->linearize(truth);
      information += at.information;
      gradient += at.gradient;
    }
    out.squared.push_back(gradient.dot(information.ldlt().solve(gradient)));
  }
  std::sort(out.squared.begin(), out.squared.end());
  std::printf(
      "found in %zu of %zu looks, several poses in %zu, wrong %zu, chi-square median %.1f\n",
      out.found, out.looks, out.several, out.wrong,
      out.squared.empty() ? 0 : out.squared[out.squared.size() / 2]);
  return out;
}

TEST(FeatureTrainer, PlacesLieOnTheSurface) {
  ASSERT_GT(carton_model()->features.size(), 500u);
  for (const TrainedFeature& feature : carton_model()->features) {
    const Eigen::Array3f out =
        feature.point.array().abs() - Eigen::Array3f(0.055f, 0.035f, 0.0225f);
    ASSERT_LT(std::abs(out.maxCoeff()), 1e-3f);
  }
}

TEST(FeatureTrainer, LearnsNothingOfWhatStandsBeforeTheObject) {
  const SceneRig rig(tumbling(1));
  const CameraModel& camera = rig.cameras()[0].model;
  const auto pixels = static_cast<size_t>(camera.width()) * static_cast<size_t>(camera.height());
  const std::vector<float> wall(pixels, 1 / 0.2f);
  const DepthTile scene{0, 0, camera.width(), camera.height(), camera.width(), wall.data()};
  EXPECT_GT(trained(rig, {}, 1).features.size(), 50u);
  EXPECT_TRUE(trained(rig, scene, 1).features.empty());
}

TEST(FeatureTrainer, LeavesOutImagesOfAnotherSize) {
  const SceneRig rig(tumbling(1));
  SceneRigOptions large = tumbling(1);
  large.lens.width = 800;
  const SceneRig other(large);
  const auto depth = depth_of(rig.options().shape->mesh())(rig.cameras()[0].model);
  FeatureTrainer trainer(1);
  const test::SceneShot shot = other.shots().front();
  EXPECT_EQ(
      trainer.train(*other.shoot(shot), rig.cameras()[0], rig.truth(shot.true_capture), *depth),
      0u);
}

TEST(FeatureDetector, FindsWhatItWasTrainedInAnotherRoom) {
  const Found found = look_for_carton(SceneRig(tumbling(5)));
  EXPECT_GE(found.found, found.looks * 3 / 4);
  EXPECT_EQ(found.wrong, 0u);
  EXPECT_LT(found.squared[found.squared.size() / 2], 9.0);  // 5.3 expected
}

TEST(FeatureDetector, OneCameraIsEnough) {
  SceneRigOptions options = tumbling(6);
  options.azimuths_deg = {20};
  const Found found = look_for_carton(SceneRig(options));
  EXPECT_GE(found.found + found.several, found.looks / 2);
  EXPECT_EQ(found.wrong, 0u);
}

TEST(FeatureDetector, CamerasThatRunFreely) {
  SceneRigOptions options = tumbling(7, 8);
  options.phases = {0, 0.35};
  const SceneRig rig(options);
  auto finder = FeatureDetector::create(carton_model(), cameras_of(rig)).value();
  auto judge = ObjectDetector::create(ObjectId(0), carton_views(), cameras_of(rig)).value();
  size_t found = 0, looks = 0;
  for (const test::SceneShot& shot : rig.shots()) {
    const FramePtr frame = rig.shoot(shot);
    finder->add_frame(CameraId(static_cast<uint32_t>(shot.camera)), *frame);
    judge->add_frame(CameraId(static_cast<uint32_t>(shot.camera)), *frame);
    if (shot.camera != 1) continue;
    ++looks;
    const Detection detection = judge->judge(finder->propose());
    if (detection.poses.size() != 1) continue;
    ++found;
    EXPECT_EQ(detection.time, shot.stamp);
    const Rigid3& pose = detection.poses[0].world_from_object;
    EXPECT_LT(rotation_angle(pose, rig.truth(shot.true_capture)), 6 * kDegree);
    EXPECT_LT(translation_distance(pose, rig.truth(shot.true_capture)), 0.02);
  }
  EXPECT_GE(found, looks / 3);
}

TEST(FeatureDetector, FindsNothingWhereThereIsNothing) {
  SceneRigOptions other = tumbling(8);
  other.shape = std::make_shared<const test::RayMesh>(test::make_creature(1000));
  other.paint.seed = 12;
  const Found found = look_for_carton(SceneRig(other));
  EXPECT_EQ(found.found + found.several, 0u);
}

TEST(FeatureDetector, GivesTheSameHoweverItsWorkIsSharedOut) {
  const SceneRig rig(tumbling(5));
  const auto backwards = [](size_t count, const std::function<void(size_t)>& body) {
    for (size_t i = count; i-- > 0;) body(i);
  };
  auto one = FeatureDetector::create(carton_model(), cameras_of(rig)).value();
  auto other = FeatureDetector::create(carton_model(), cameras_of(rig), {}, backwards).value();
  for (size_t i = 0; i < 2; ++i) {
    const FramePtr frame = rig.shoot(rig.shots()[i]);
    const CameraId camera(static_cast<uint32_t>(rig.shots()[i].camera));
    one->add_frame(camera, *frame);
    other->add_frame(camera, *frame);
  }
  const PoseProposals a = one->propose(), b = other->propose();
  ASSERT_FALSE(a.poses.empty());
  ASSERT_EQ(a.poses.size(), b.poses.size());
  for (size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_EQ(a.poses[i].world_from_object.matrix(), b.poses[i].world_from_object.matrix());
    EXPECT_EQ(a.poses[i].matches, b.poses[i].matches);
  }
}

TEST(FeatureDetector, LooksAtEveryFrameOnceAndLeavesOutDamagedOnes) {
  const SceneRig rig(tumbling(5));
  auto finder = FeatureDetector::create(carton_model(), cameras_of(rig)).value();
  EXPECT_TRUE(finder->propose().poses.empty());
  for (size_t i = 0; i < 2; ++i) {
    finder->add_frame(CameraId(static_cast<uint32_t>(rig.shots()[i].camera)),
                      *rig.shoot(rig.shots()[i]));
  }
  const PoseProposals first = finder->propose();
  EXPECT_FALSE(first.poses.empty());
  EXPECT_EQ(first.time, rig.shots()[1].stamp);
  EXPECT_TRUE(finder->propose().poses.empty());  // nothing new
  FrameInfo damaged = rig.info_of(rig.shots()[2]);
  damaged.status = FrameStatus::kDamaged;
  const auto image = std::make_shared<Image>(damaged.width, damaged.height);
  finder->add_frame(CameraId(0), *Frame::decoded(damaged, image));
  EXPECT_TRUE(finder->propose().poses.empty());
}

// What was found a frame ago is found again where it must be, and nothing is where it was not.
TEST(FeatureDetector, FollowsWhatItFound) {
  const SceneRig rig(tumbling(5, 8));
  auto finder = FeatureDetector::create(carton_model(), cameras_of(rig)).value();
  const auto sets = rig.sets();
  const auto add = [&](size_t set) {
    for (const test::SceneShot& shot : sets[set]) {
      finder->add_frame(CameraId(static_cast<uint32_t>(shot.camera)), *rig.shoot(shot));
    }
    return rig.truth(sets[set][0].true_capture);
  };
  const Rigid3 before = add(0);
  EXPECT_TRUE(finder->propose_near({}).poses.empty());
  const PoseProposals first = finder->propose();
  ASSERT_FALSE(first.poses.empty());
  Detection found;
  found.time = first.time;
  found.poses.push_back({before, Vector6::Zero(), 1, 2});
  const Rigid3 after = add(1);
  const PoseProposals next = finder->propose_near(found);
  ASSERT_FALSE(next.poses.empty());
  EXPECT_LT(rotation_angle(next.poses[0].world_from_object, after), 3 * kDegree);
  EXPECT_LT(translation_distance(next.poses[0].world_from_object, after), 0.01);
  found.poses[0].world_from_object.translation += Eigen::Vector3d(0.25, -0.25, 0.2);
  add(2);
  EXPECT_TRUE(finder->propose_near(found).poses.empty());
}

// A pose that the features do not determine, or that no outline agrees with, is no answer.
TEST(ObjectDetector, ProposalsAreJudgedByTheOutlineToo) {
  const SceneRig rig(tumbling(5));
  auto finder = FeatureDetector::create(carton_model(), cameras_of(rig)).value();
  auto judge = ObjectDetector::create(ObjectId(0), carton_views(), cameras_of(rig)).value();
  for (size_t i = 0; i < 2; ++i) {
    const FramePtr frame = rig.shoot(rig.shots()[i]);
    finder->add_frame(CameraId(static_cast<uint32_t>(rig.shots()[i].camera)), *frame);
    judge->add_frame(CameraId(static_cast<uint32_t>(rig.shots()[i].camera)), *frame);
  }
  PoseProposals proposals = finder->propose();
  ASSERT_FALSE(proposals.poses.empty());
  EXPECT_EQ(judge->judge(proposals).poses.size(), 1u);
  EXPECT_TRUE(judge->judge({}).poses.empty());
  // As sure of itself, but somewhere else.
  PoseProposals wrong = proposals;
  wrong.poses.resize(1);
  wrong.poses[0].world_from_object.translation += Eigen::Vector3d(0.1, 0.1, 0.05);
  EXPECT_TRUE(judge->judge(wrong).poses.empty());
  // A rival that is as sure leaves nothing certain, though no outline speaks for it, if it is sure
  // enough; the outline's word outweighs it otherwise.
  wrong.poses.push_back(proposals.poses[0]);
  wrong.poses[0].evidence = 10 * proposals.poses[0].evidence;
  EXPECT_TRUE(judge->judge(wrong).poses.empty());
}

TEST(FeatureDetector, RefusesWhatCannotBe) {
  const SceneRig rig(tumbling(1));
  auto model = std::make_shared<FeatureModel>();
  EXPECT_THAT(FeatureDetector::create(model, cameras_of(rig)),
              FailsWith("has no trained features"));
  model->features.resize(3);
  EXPECT_THAT(FeatureDetector::create(model, {}), FailsWith("has no camera"));
  FeatureDetectorOptions wrong;
  wrong.match.per_image = 1;
  EXPECT_THAT(FeatureDetector::create(model, cameras_of(rig), wrong), FailsWith("out of range"));
}

}  // namespace
}  // namespace sightline
