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
#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/pipeline/mesh_print_renderer.hpp"
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

  /// The pose that all cameras together measure about a proposed one; `edit` may change a frame.
  struct Measured {
    PoseError error;
    int cameras = 0, by_print_alone = 0;
  };
  template <typename Edit>
  static Measured measure_about(const Rigid3& proposed, const Edit& edit) {
    const Installation installation = unmarked();
    Matrix6 covariance = Matrix6::Identity() * 1e-3;
    covariance.diagonal().tail<3>().setConstant(4e-4);
    Matrix6 information = Matrix6::Identity() * 1e-6;
    std::vector<PoseTermPtr> terms;
    Measured out;
    for (const FramePtr& frame : frames_) {
      const CameraId id = frame->info().camera;
      const auto observer = CameraObserver::create(installation, *rig_, id).value();
      const FramePtr seen = edit(frame);
      const Observation observation =
          observer->tracker().propose(*seen, ObjectId(0), proposed, covariance);
      if (observation.terms.empty()) continue;
      ++out.cameras;
      out.by_print_alone += observer->tracker().last_result(0).by_print_alone ? 1 : 0;
      terms.insert(terms.end(), observation.terms.begin(), observation.terms.end());
    }
    Rigid3 pose = proposed;
    for (int i = 0; i < 5; ++i) {
      information = Matrix6::Identity() * 1e-6;
      Vector6 gradient = Vector6::Zero();
      for (const PoseTermPtr& term : terms) {
        const LinearizedTerm at = term->linearize(pose);
        information += at.information;
        gradient += at.gradient;
      }
      pose = pose * Rigid3::exp(-information.ldlt().solve(gradient));
    }
    out.error = pose_error(truth_, pose);
    return out;
  }

  /// What its camera makes of a frame in which it is followed at its true pose.
  struct Followed {
    ObjectTracker::TrackResult result;
    Observation observation;
  };
  static Followed followed_in(const FramePtr& frame) {
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = frame->info().capture;
    estimate.state = TrackState::kTracking;
    estimate.world_from_object = truth_;
    estimate.covariance.diagonal().head<6>().setConstant(1e-5);
    const std::vector<PoseTrackPtr> tracks = {std::make_shared<const PoseTrack>(
        ObjectId(0), std::vector<PoseEstimate>{estimate}, MotionNoise())};
    const auto observer = CameraObserver::create(unmarked(), *rig_, frame->info().camera).value();
    std::vector<Observation> out;
    observer->tracker().step(*frame, tracks, out);
    return {observer->tracker().last_result(0), out.at(0)};
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
    out.score = out.rank = score;
    return out;
  };
  std::vector<observe::ContourPose> poses = {outline_at(upside_down(), 0.70),
                                             outline_at(truth_, 0.65)};
  observe::weigh_by_colors(*verifier, time, 0.2, poses);
  EXPECT_EQ(poses[0].score, 0.65);
  EXPECT_NEAR(translation_distance(poses[0].fit.motion.world_from_object, truth_), 0, 1e-12);
  EXPECT_LT(poses[1].score, 0.75 * 0.70 + 1e-9);
  // Colors that agree nowhere may be another paint.
  poses = {outline_at(upside_down(), 0.70), outline_at(upside_down(), 0.60)};
  observe::weigh_by_colors(*verifier, time, 0.2, poses);
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

TEST_F(Print, IsRenderedWhereTheDepthIs) {
  const CameraModel& camera = cameras_[0].calibration.model;
  const auto print = mesh_print_renderer_factory(carton().painted)(camera);
  const auto depth = mesh_depth_renderer_factory(carton().mesh)(camera);
  const Rigid3 pose = cameras_[0].calibration.world_from_camera.inverse() * truth_;
  const PrintTile tile = print->render(pose);
  const DepthTile only = depth->render(pose);
  ASSERT_GT(tile.depth.width, 50);
  ASSERT_EQ(tile.depth.width, only.width);
  ASSERT_EQ(tile.depth.height, only.height);
  int least = 255, most = 0;
  for (int y = 0; y < only.height; ++y) {
    for (int x = 0; x < only.width; ++x) {
      ASSERT_EQ(tile.depth.row(y)[x], only.row(y)[x]);
      if (!(only.row(y)[x] > 0)) continue;
      const int luma = tile.luma[y * tile.luma_stride + x];
      least = std::min(least, luma);
      most = std::max(most, luma);
    }
  }
  EXPECT_GT(most - least, 80) << "black and white are printed on it";
  EXPECT_EQ(print->render(Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -1})).depth.width, 0);
}

// A white rim beside a light wall pulls its outline by two pixels; its print does not move.
TEST_F(Print, SaysWhereItIsFromBeside) {
  const auto as_it_is = [](const FramePtr& frame) { return frame; };
  for (const double depth : {-0.02, 0.0, 0.02}) {
    Vector6 off;
    off << 0.02, -0.02, 0.02, 0.004, depth, -0.004;
    const Measured measured = measure_about(truth_ * Rigid3::exp(off), as_it_is);
    EXPECT_GE(measured.cameras, 2);
    EXPECT_EQ(measured.by_print_alone, 0);
    EXPECT_LT(measured.error.mm, 2) << depth;
    EXPECT_LT(measured.error.deg, 1) << depth;
  }
}

TEST_F(Print, HoldsItWhereNoOutlineShows) {
  const auto uncover_the_middle = [](const FramePtr& frame) {
    const CalibratedCamera& camera = cameras_[frame->info().camera.index()].calibration;
    const auto middle = camera.model.project(camera.world_from_camera.inverse() * truth_ *
                                             carton().views->center());
    auto image = std::make_shared<Image>(frame->info().width, frame->info().height);
    frame->copy_i420_to(image->mutable_view());
    const MutablePlaneView luma = image->mutable_view().y;
    const double reach = 0.42 * camera.model.parameters().fx * carton().views->radius() /
                         (camera.world_from_camera.inverse() * truth_.translation).norm();
    for (int y = 0; y < luma.height; ++y) {
      for (int x = 0; x < luma.width; ++x) {
        if ((*middle - Eigen::Vector2d(x, y)).cwiseAbs().maxCoeff() < reach) continue;
        luma.row(y)[x] = 120;
        image->mutable_view().u.row(y / 2)[x / 2] = 128;
        image->mutable_view().v.row(y / 2)[x / 2] = 128;
      }
    }
    return Frame::decoded(frame->info(), image);
  };
  const Measured measured = measure_about(truth_, uncover_the_middle);
  EXPECT_GE(measured.by_print_alone, 1);
  EXPECT_LT(measured.error.mm, 5);
  const auto cover_all = [](const FramePtr& frame) {
    auto image = std::make_shared<Image>(frame->info().width, frame->info().height);
    const MutablePlaneView luma = image->mutable_view().y;
    for (int y = 0; y < luma.height; ++y) std::fill_n(luma.row(y), luma.width, uint8_t{120});
    return Frame::decoded(frame->info(), image);
  };
  EXPECT_EQ(measure_about(truth_, cover_all).cameras, 0);
}

// In light through a grille, by another white: point by point it is there, as a whole it does not
// look like it.
TEST_F(Print, PointsInPlaceCountForMoreThanHowItLooksAsAWhole) {
  const FramePtr& frame = frames_.front();
  auto image = std::make_shared<Image>(frame->info().width, frame->info().height);
  frame->copy_i420_to(image->mutable_view());
  const auto& view = image->mutable_view();
  for (int y = 0; y < view.y.height; ++y) {
    for (int x = 0; x < view.y.width; ++x) {
      const int light = x / 40 % 2 == 0 ? 150 : 0;
      view.y.row(y)[x] = static_cast<uint8_t>(view.y.row(y)[x] / 4 + light);
      if (x % 2 != 0 || y % 2 != 0) continue;
      for (const MutablePlaneView& plane : {view.u, view.v}) {
        uint8_t& chroma = plane.row(y / 2)[x / 2];
        chroma = static_cast<uint8_t>(255 - chroma);
      }
    }
  }
  const FramePtr seen = Frame::decoded(frame->info(), image);
  const auto verifier = ColorVerifier::create(*carton().samples, cameras_).value();
  verifier->add_frame(frame->info().camera, *seen);
  const Time time = frame->info().capture;
  EXPECT_LT(verifier->correlation(truth_, Vector6::Zero(), time), 0.25);

  const auto [result, observation] = followed_in(seen);
  EXPECT_TRUE(result.seen);
  EXPECT_GE(result.points_used, 12);
  EXPECT_FALSE(observation.terms.empty());
}

// Its outline and, from afar, its colors; but nothing of what is printed on it.
TEST_F(Print, AnotherBoxOfItsShapeIsMissingIt) {
  const FramePtr& frame = frames_.front();
  const CalibratedCamera& camera = cameras_[frame->info().camera.index()].calibration;
  const DepthTile tile = mesh_depth_renderer_factory(carton().mesh)(camera.model)
                             ->render(camera.world_from_camera.inverse() * truth_);
  const auto image = std::make_shared<Image>(frame->info().width, frame->info().height);
  frame->copy_i420_to(image->mutable_view());
  const PlaneView sharp = frame->gray();
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      if (!(tile.row(y)[x] > 0)) continue;
      int sum = 0, count = 0;
      for (int v = -10; v <= 10; ++v) {
        for (int u = -10; u <= 10; ++u) {
          if (!(tile.at(tile.x + x + u, tile.y + y + v) > 0)) continue;
          sum += sharp.row(tile.y + y + v)[tile.x + x + u];
          ++count;
        }
      }
      image->mutable_view().y.row(tile.y + y)[tile.x + x] = static_cast<uint8_t>(sum / count);
    }
  }
  const auto [result, observation] = followed_in(Frame::decoded(frame->info(), image));
  EXPECT_TRUE(result.seen);
  ASSERT_TRUE(observation.picture);
  EXPECT_EQ(observation.picture->missing, 1);
  const auto [as_it_is, right] = followed_in(frame);
  EXPECT_TRUE(as_it_is.by_print);
  ASSERT_TRUE(right.picture);
  EXPECT_LT(right.picture->missing, 0.1);
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
      {*carton().triangles, carton().painted, *carton().views, surface, {image}}, {},
      stop.get_token());
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace sightline
