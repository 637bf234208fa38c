// SPDX-License-Identifier: Apache-2.0
// An object's print, known from the textures of its mesh: it is found by it, and nothing else is.
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <fstream>
#include <numbers>

#include "observe/detect/colors/contour_colors.hpp"
#include "pipeline/rendered_features.hpp"
#include "sightline/base/files.hpp"
#include "sightline/observe/detect/detection_policy.hpp"
#include "sightline/observe/features/feature_detector.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

const std::filesystem::path kBench =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";

Installation unmarked() {
  Installation installation = recording_installation(kBench).value();
  installation.objects.front().description.modalities = {false, true, true, true};
  return installation;
}

Rig rig_of(const Installation& installation, const std::filesystem::path& cache = {}) {
  RigOptions options;
  options.cache = cache;
  return load_rig(installation, options).value();
}

/// Bench's carton in its first images, nothing trained but by its mesh.
class Print : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    const Installation installation = unmarked();
    rig_ = std::make_unique<Rig>(rig_of(installation));
    for (uint32_t i = 0; i < installation.cameras.size(); ++i) {
      cameras_.push_back({CameraId(i), installation.cameras[i].calibration});
    }
    const auto recording = std::make_shared<const Recording>(open_recording(kBench).value());
    frames_ = *VirtualReplay::open(recording).value()->next().value();
    truth_ = read_truth(kBench / "truth.csv").value().front().world_from_object;
  }
  static void TearDownTestSuite() {
    rig_.reset();
    frames_.clear();
    cameras_.clear();
  }

  static const RigObject& carton() { return rig_->objects.front(); }
  template <typename Watcher>
  static void show(Watcher& watcher) {
    for (const FramePtr& frame : frames_) watcher.add_frame(frame->info().camera, *frame);
  }
  static std::unique_ptr<ColorVerifier> colors() {
    auto colors = ColorVerifier::create(*carton().samples, cameras_).value();
    show(*colors);
    return colors;
  }
  /// Standing on its head.
  static Rigid3 upside_down() {
    return truth_ *
           Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX())),
                  Eigen::Vector3d::Zero());
  }

  static inline std::unique_ptr<Rig> rig_;
  static inline std::vector<DetectorCamera> cameras_;
  static inline std::vector<FramePtr> frames_;
  static inline Rigid3 truth_;
};

TEST_F(Print, IsTaughtByTheMeshAlone) {
  ASSERT_TRUE(carton().features);
  EXPECT_TRUE(carton().printed);
  EXPECT_EQ(carton().features->mesh, mesh_content(*carton().triangles));
  const auto detector = FeatureDetector::create(carton().features, cameras_).value();
  show(*detector);
  const PoseProposals found = detector->propose();
  ASSERT_FALSE(found.poses.empty());
  const PoseError error = pose_error(truth_, found.poses.front().world_from_object);
  EXPECT_LT(error.mm, 10);
  EXPECT_LT(error.deg, 4);
}

TEST_F(Print, ConfirmsAPoseAndRefusesOthers) {
  const auto verifier = colors();
  const DetectionPolicy policy({}, 0.4, true);
  PoseProposals proposals;
  proposals.time = frames_.front()->info().capture;
  proposals.poses.resize(2);
  proposals.poses[0].world_from_object = truth_;
  proposals.poses[1].world_from_object = upside_down();
  const PoseProposals judged = policy.confirm(proposals, verifier.get());
  EXPECT_TRUE(judged.poses[0].confirmed);
  EXPECT_FALSE(judged.poses[1].confirmed);
  EXPECT_FALSE(policy.confirm(proposals, nullptr).poses[0].confirmed);
  const DetectionPolicy plain({}, 0.4, false);
  EXPECT_FALSE(plain.confirm(proposals, verifier.get()).poses[0].confirmed);
}

TEST_F(Print, AnOutlineWithoutItIsNone) {
  const auto verifier = colors();
  const auto outline_at = [](const Rigid3& pose) {
    Detection out;
    out.poses.push_back({pose, Vector6::Zero(), 5, 2});  // as much evidence as one likes
    for (const FramePtr& frame : frames_) {
      Observation observation;
      observation.camera = frame->info().camera;
      observation.capture = frame->info().capture;
      observation.hypotheses.push_back({pose, 0});
      out.observations.push_back(std::move(observation));
    }
    return out;
  };
  const DetectionPolicy printed({}, 0.4, true), plain({}, 0.4, false);
  EXPECT_EQ(printed.by_outline(outline_at(truth_), verifier.get()).poses.size(), 1u);
  EXPECT_TRUE(printed.by_outline(outline_at(upside_down()), verifier.get()).poses.empty());
  EXPECT_EQ(plain.by_outline(outline_at(upside_down()), verifier.get()).poses.size(), 1u);
}

TEST_F(Print, ItsColorsTellOutlinesApart) {
  const auto verifier = colors();
  const Time time = frames_.front()->info().capture;
  const auto outline_at = [](const Rigid3& pose, double score) {
    observe::ContourPose out;
    out.fit.motion.world_from_object = pose;
    out.score = score;
    return out;
  };
  std::vector<observe::ContourPose> poses = {outline_at(upside_down(), 0.70),
                                             outline_at(truth_, 0.65)};
  observe::weigh_by_colors(*verifier, time, poses);
  EXPECT_EQ(poses[0].score, 0.65);
  EXPECT_NEAR(translation_distance(poses[0].fit.motion.world_from_object, truth_), 0, 1e-12);
  EXPECT_LT(poses[1].score, 0.75 * 0.70 + 1e-9);
  // Colors that agree nowhere may be another paint.
  poses = {outline_at(upside_down(), 0.70), outline_at(upside_down(), 0.60)};
  observe::weigh_by_colors(*verifier, time, poses);
  EXPECT_EQ(poses[0].score, 0.70);
  EXPECT_EQ(poses[1].score, 0.60);
}

TEST_F(Print, IsKeptInTheCacheAndMadeAnewWhereThatIsDamaged) {
  const auto cache =
      std::filesystem::path(testing::TempDir()) / fmt::format("print_{}", ::getpid());
  std::filesystem::remove_all(cache);
  const Rig first = rig_of(unmarked(), cache);
  std::filesystem::path file;
  for (const auto& entry : std::filesystem::directory_iterator(cache)) {
    if (entry.path().filename().string().starts_with("features-")) file = entry.path();
  }
  ASSERT_FALSE(file.empty());
  const std::string kept = read_file(file).value();
  EXPECT_EQ(kept, format_feature_model(*carton().features)) << "the same every time";
  std::ofstream(file, std::ios::trunc) << kept.substr(0, kept.size() / 2);
  const Rig second = rig_of(unmarked(), cache);
  ASSERT_TRUE(second.objects.front().features);
  EXPECT_EQ(read_file(file).value(), kept);
  std::filesystem::remove_all(cache);
}

TEST_F(Print, IsNotAskedOfWhatIsNotMeasuredByTexture) {
  Installation installation = unmarked();
  installation.objects.front().description.modalities.texture = false;
  const Rig rig = rig_of(installation);
  EXPECT_FALSE(rig.objects.front().features);
  EXPECT_FALSE(rig.objects.front().printed);
}

TEST_F(Print, EndsWhenItIsTold) {
  std::stop_source stop;
  stop.request_stop();
  MeshSurface surface;
  const auto image = std::make_shared<const Image>(16, 16);
  const auto made = pipeline::rendered_features(
      {*carton().triangles, *carton().mesh, *carton().views, surface, {image}}, {},
      stop.get_token());
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace sightline
