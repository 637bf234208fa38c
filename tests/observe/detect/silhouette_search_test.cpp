// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/silhouette_search.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "observe/detect/pixels/mask_overlap.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "sightline/observe/scene/background_model.hpp"
#include "support/random.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::test {
namespace {

using namespace observe;

using namespace std::chrono_literals;

constexpr ObjectId kObject(3);

constexpr Duration kAlone = 700ms;  ///< the room before the object comes

SceneRigOptions scene(const TriangleMesh& shape, const Rigid3& place) {
  SceneRigOptions options;
  options.azimuths_deg = {0, 70, 150};
  options.rate_hz = 20;
  options.duration = kAlone + 100ms;
  options.shape = std::make_shared<const RayMesh>(shape);
  options.path = [place](Time time) {
    const bool here = time - Time{} >= kAlone;
    return here ? place : Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -9});
  };
  return options;
}

// The backgrounds of a rig's cameras and what is new in its last frames.
struct Learned {
  explicit Learned(const SceneRig& rig, Duration until = kAlone) {
    for (const CalibratedCamera& camera : rig.cameras()) {
      models.push_back(BackgroundModel::create(camera).value());
    }
    maps.resize(models.size());
    frames.resize(models.size());
    for (const SceneShot& shot : rig.shots()) {
      const auto camera = static_cast<size_t>(shot.camera);
      frames[camera] = rig.shoot(shot);
      if (shot.stamp - rig.options().start < until) models[camera]->learn(*frames[camera], {});
    }
    for (size_t i = 0; i < models.size(); ++i) {
      EXPECT_TRUE(models[i]->foreground(*frames[i], {}, maps[i])) << i;
    }
  }
  std::vector<std::unique_ptr<BackgroundModel>> models;
  std::vector<ForegroundMap> maps;
  std::vector<FramePtr> frames;
};

std::vector<SilhouetteCamera> cameras_of(const SceneRig& rig, const Learned& learned) {
  std::vector<SilhouetteCamera> cameras;
  for (size_t i = 0; i < rig.cameras().size(); ++i) {
    const CalibratedCamera& camera = rig.cameras()[i];
    cameras.push_back(
        {&camera, camera.world_from_camera.inverse(), &learned.maps[i], 0.4, 1.1, {}, {}});
    cameras.back().sum_up();
  }
  return cameras;
}

struct Near {
  double mm = 1e9, deg = 1e9;
};

// Of the poses within 25 degrees the nearest one.
Near nearest_of(const std::vector<JointPose>& poses, const Rigid3& truth) {
  Near best;
  for (const JointPose& pose : poses) {
    const double deg = rotation_angle(pose.world_from_object, truth) * 57.3;
    const double mm = 1e3 * translation_distance(pose.world_from_object, truth);
    if (deg < 25 && mm < best.mm) best = {mm, deg};
  }
  return best;
}

TEST(SilhouetteSearch, FindsWhatIsNew) {
  const TriangleMesh mesh = make_creature(3000);
  const SceneRig rig(scene(mesh, turned(0.8, {1, 2, 3}, {0.04, -0.03, 0.02})));
  const Learned learned(rig);
  const TemplateBank bank(views_of(mesh));
  const SilhouetteSearch search(bank);
  auto cameras = cameras_of(rig, learned);
  const Rigid3 truth = rig.truth(learned.frames[0]->info().capture);
  for (const SilhouetteCamera& camera : cameras) {
    EXPECT_GT(search.overlap(camera, truth, 1), 0.7);
    EXPECT_NEAR(search.overlap(camera, truth, 2), search.overlap(camera, truth, 1), 0.1);
    const Rigid3 beside(truth.rotation, truth.translation + Eigen::Vector3d(0.05, 0.05, 0));
    EXPECT_LT(search.overlap(camera, beside, 1), 0.5);
  }
  EXPECT_LT(nearest_of(search.search(cameras, 12), truth).mm, 18);
  // Hidden in one camera: that one adds nothing and forbids nothing.
  ForegroundMap empty = learned.maps[0];
  std::fill(empty.classes.begin(), empty.classes.end(), uint8_t{ForegroundMap::kBackground});
  cameras[0].map = &empty;
  cameras[0].sum_up();
  EXPECT_LT(nearest_of(search.search(cameras, 16), truth).mm, 18);
}

TEST(SilhouetteSearch, JudgesCutSilhouettesByWhatIsLeft) {
  const TriangleMesh mesh = make_creature(3000);
  const SceneRig rig(scene(mesh, turned(0.8, {1, 2, 3}, {0.04, -0.03, 0.02})));
  const Learned learned(rig);
  const TemplateBank bank(views_of(mesh));
  const SilhouetteSearch search(bank);
  auto cameras = cameras_of(rig, learned);
  const Rigid3 truth = rig.truth(learned.frames[0]->info().capture);
  const double whole = search.overlap(cameras[1], truth, 1);
  // Half of the object lies where nothing is known.
  const auto middle = rig.cameras()[1].model.project(cameras[1].camera_from_world *
                                                     (truth * bank.model().center()));
  ASSERT_TRUE(middle);
  ForegroundMap cut = learned.maps[1];
  for (int y = 0; y < cut.height; ++y) {
    for (int x = 0; 2 * x < middle->x(); ++x) {
      cut.classes[static_cast<size_t>(y * cut.width + x)] = ForegroundMap::kUnknown;
    }
  }
  cameras[1].map = &cut;
  cameras[1].sum_up();
  EXPECT_NEAR(search.overlap(cameras[1], truth, 1), whole, 0.15);
  // And then nearly all of it.
  std::fill(cut.classes.begin(), cut.classes.end(), uint8_t{ForegroundMap::kUnknown});
  EXPECT_LT(search.overlap(cameras[1], truth, 1), 0);
}

TEST(SilhouetteSearch, FindsNothingInNothing) {
  const TriangleMesh mesh = make_truck();
  SceneRigOptions options = scene(mesh, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -9}));
  const SceneRig rig(options);
  const Learned learned(rig);
  const TemplateBank bank(views_of(mesh));
  EXPECT_TRUE(SilhouetteSearch(bank).search(cameras_of(rig, learned), 8).empty());
}

// With the maps of the backgrounds, through the detector's one test.
class DetectorWithSilhouettes : public ::testing::Test {
 protected:
  static std::unique_ptr<ObjectDetector> detector(const SceneRig& rig, const TriangleMesh& mesh) {
    return ObjectDetector::create(kObject, views_of(mesh), detector_cameras(rig)).value();
  }
  static Detection search(ObjectDetector& detector, const Learned& learned, bool silhouettes) {
    for (size_t i = 0; i < learned.frames.size(); ++i) {
      detector.add_frame(CameraId(static_cast<uint32_t>(i)), *learned.frames[i],
                         silhouettes ? &learned.maps[i] : nullptr);
    }
    Detection found;
    for (int i = 0; i < 6 && found.poses.empty(); ++i) found = detector.detect();
    return found;
  }
};

TEST_F(DetectorWithSilhouettes, FindsInARoomOfItsColor) {
  const TriangleMesh mesh = make_creature(3000);
  SceneRigOptions options = scene(mesh, turned(0.8, {1, 2, 3}, {0.04, -0.03, 0.02}));
  options.backdrop.similarity = 0.9f;
  options.backdrop.like = options.paint.color;
  options.sensor.read_noise = 5;
  const SceneRig rig(options);
  const Learned learned(rig);
  const Detection found = search(*detector(rig, mesh), learned, true);
  ASSERT_EQ(found.poses.size(), 1u);
  const Rigid3 truth = rig.truth(found.time);
  EXPECT_LT(translation_distance(found.poses[0].world_from_object, truth), 0.015);
  EXPECT_LT(rotation_angle(found.poses[0].world_from_object, truth), 0.15);
}

TEST_F(DetectorWithSilhouettes, AGhostIsNoObject) {
  const TriangleMesh mesh = make_truck();
  // There from the start, learned with the room, then gone.
  SceneRigOptions options = scene(mesh, Rigid3());
  const Rigid3 place = turned(0.8, {1, 2, 3}, {0.04, -0.03, 0.02});
  options.paint.kind = Paint::Kind::kFaces;
  options.path = [place](Time time) {
    const bool here = time - Time{} < kAlone;
    return here ? place : Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -9});
  };
  const SceneRig rig(options);
  const Learned learned(rig);
  EXPECT_GT(learned.maps[0].share, 0.005) << "its place is new";
  const auto looking = detector(rig, mesh);
  for (int i = 0; i < 2; ++i) {
    const Detection found = search(*looking, learned, true);
    EXPECT_TRUE(found.poses.empty()) << found.poses[0].evidence;
  }
}

TEST_F(DetectorWithSilhouettes, FindsWhatNeverMoved) {
  const TriangleMesh mesh = make_truck();
  SceneRigOptions options = scene(mesh, Rigid3());
  options.paint.kind = Paint::Kind::kFaces;
  options.path = resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01}));
  const SceneRig rig(options);
  const Learned learned(rig);
  EXPECT_LT(learned.maps[0].share, 0.005) << "nothing is new";
  const Detection found = search(*detector(rig, mesh), learned, true);
  ASSERT_EQ(found.poses.size(), 1u) << "by its edges, in the search that goes everywhere";
  EXPECT_LT(translation_distance(found.poses[0].world_from_object, rig.truth(found.time)), 0.006);
}

int bit_by_bit(const MaskPatch::Bits& mask, const MaskPatch::Bits& piece) {
  int bits = 0;
  for (size_t i = 0; i < 64 * mask.size(); ++i) {
    bits += static_cast<int>((mask[i / 64] & piece[i / 64]) >> (i % 64) & 1);
  }
  return bits;
}

TEST(MaskOverlap, EachKernelCountsAsBitByBit) {
  Random random(5);
  const auto bits = [&] {
    MaskPatch::Bits out{};
    for (uint64_t& word : out) word = random.bits() & random.bits();
    return out;
  };
  std::vector<MaskPatch::Bits> masks;
  for (int i = 0; i < 50; ++i) masks.push_back(bits());
  MaskPatch::Bits all{};
  all.fill(~uint64_t{0});
  masks.push_back(all);  // the largest counts
  const MaskPatch patch{bits(), all, bits()};
  for (const auto kernel : {&overlap_masks_scalar, &overlap_masks}) {
    std::vector<MaskOverlap> out(masks.size());
    kernel(masks, patch, out.data());
    for (size_t i = 0; i < masks.size(); ++i) {
      EXPECT_EQ(out[i].front, bit_by_bit(masks[i], patch.front));
      EXPECT_EQ(out[i].shadow, bit_by_bit(masks[i], patch.shadow));
      EXPECT_EQ(out[i].unknown, bit_by_bit(masks[i], patch.unknown));
    }
  }
}

}  // namespace
}  // namespace sightline::test
