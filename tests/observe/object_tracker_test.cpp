// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/track/object_tracker.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cstring>
#include <numbers>

#include "sightline/fuse/estimator.hpp"
#include "sightline/observe/shape/shape_symmetry.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/allocations.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "tracked_creature.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::creature;
using test::SceneRig;
using test::SceneRigOptions;
using test::SceneShot;

constexpr double kDeg = std::numbers::pi / 180;

std::shared_ptr<const ViewpointModel> views_of(const TriangleMesh& mesh) {
  const auto prepared = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  ViewpointModelOptions options;
  options.image_px = 240;
  auto made = ViewpointModel::build(mesh, mesh_depth_renderer_factory(prepared), options);
  EXPECT_TRUE(made) << made.error().message();
  return *made;
}

TrackedObject tracked(Modalities modalities = {false, true, true, true}) {
  return test::tracked_creature(modalities);
}

SceneRigOptions options_of(Duration duration) {
  SceneRigOptions options;
  options.shape = std::make_shared<const test::RayMesh>(creature());
  options.duration = duration;
  test::SceneSteps steps;
  options.path = test::smooth_path(steps, duration);
  options.sensor.read_noise = 4;
  return options;
}

/// Trackers of all cameras and one estimator, started next to the truth.
class Tracking {
 public:
  explicit Tracking(const SceneRig& rig, const TrackedObject& object = tracked()) : rig_(rig) {
    for (size_t i = 0; i < rig.cameras().size(); ++i) {
      auto made =
          ObjectTracker::create(rig.cameras()[i], CameraId(static_cast<uint32_t>(i)), {object});
      EXPECT_TRUE(made) << made.error().message();
      trackers.push_back(*std::move(made));
    }
    start(object.shape_symmetry, Rigid3(), true);
  }

  /// Begins anew at the next set, at the true pose turned by `turn`; `told`: that is said to be the
  /// right one of those that look alike.
  void start(const ShapeSymmetry& shape_symmetry, const Rigid3& turn, bool told) {
    auto made = ObjectEstimator::create({}, ObjectId(0), shape_symmetry);
    EXPECT_TRUE(made) << made.error().message();
    estimator = std::make_unique<ObjectEstimator>(*std::move(made));
    shape_symmetry_ = shape_symmetry;
    turn_ = turn;
    told_ = told;
    started_ = false;
  }

  UpdateReport step(const std::vector<SceneShot>& set) {
    observations.clear();
    const PoseTrackPtr track = estimator->track();
    for (const SceneShot& shot : set) {
      const FramePtr frame = rig_.shoot(shot);
      ObjectTracker& tracker = *trackers[static_cast<size_t>(shot.camera)];
      if (started_) {
        tracker.step(*frame, {&track, 1}, observations);
        continue;
      }
      Vector6 off;
      off << 0.03, -0.02, 0.02, 0.004, -0.003, 0.004;
      Matrix6 covariance = Matrix6::Identity() * 0.03 * 0.03;
      covariance.diagonal().tail<3>().setConstant(0.005 * 0.005);
      observations.push_back(
          tracker.propose(*frame, ObjectId(0),
                          rig_.truth(shot.true_capture) * turn_ * Rigid3::exp(off), covariance));
      if (!told_) continue;
      const Rigid3 pose = rig_.truth(shot.true_capture) * turn_;
      observations.back().symmetric_hypotheses = {{pose, 0}};
      for (const Rigid3& other : shape_symmetry_.rotations) {
        observations.back().symmetric_hypotheses.push_back({pose * other, 40});
      }
    }
    started_ = true;
    return estimator->process(observations);
  }

  std::vector<std::unique_ptr<ObjectTracker>> trackers;
  std::unique_ptr<ObjectEstimator> estimator;
  std::vector<Observation> observations;  ///< of the last step

 private:
  const SceneRig& rig_;
  ShapeSymmetry shape_symmetry_;
  Rigid3 turn_;
  bool told_ = true;
  bool started_ = false;
};

struct Errors {
  std::vector<double> mm, deg;
  void add(const Rigid3& truth, const Rigid3& pose) {
    mm.push_back(1e3 * translation_distance(truth, pose));
    deg.push_back(rotation_angle(truth, pose) / kDeg);
  }
  static double median(std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + static_cast<ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
  }
  static double worst(const std::vector<double>& v) {
    return *std::max_element(v.begin(), v.end());
  }
};

TEST(ObjectTracker, TwoCamerasHoldAPlainObjectInClutter) {
  const SceneRig rig(options_of(700ms));
  Tracking tracking(rig);
  Errors errors;
  int frames = 0, sure = 0;
  for (const auto& set : rig.sets()) {
    const UpdateReport report = tracking.step(set);
    const Rigid3 truth = rig.truth(set.front().true_capture);
    ASSERT_TRUE(has_pose(report.estimate.state));
    if (++frames <= 8) continue;
    errors.add(truth, report.estimate.world_from_object);
    sure += report.estimate.state == TrackState::kTracking ? 1 : 0;
  }
  EXPECT_LT(Errors::median(errors.mm), 0.6);
  EXPECT_LT(Errors::median(errors.deg), 0.8);
  EXPECT_LT(Errors::worst(errors.mm), 4);
  EXPECT_LT(Errors::worst(errors.deg), 4);
  EXPECT_GE(sure, frames - 10);
}

TEST(ObjectTracker, ComesBackFromAPoorPrediction) {
  SceneRigOptions options = options_of(100ms);
  options.azimuths_deg = {0};
  const SceneRig rig(options);
  const SceneShot shot = rig.shots().front();
  const FramePtr frame = rig.shoot(shot);
  const Rigid3 truth = rig.truth(shot.true_capture);
  auto tracker = ObjectTracker::create(rig.cameras()[0], CameraId(0), {tracked()});
  ASSERT_TRUE(tracker);
  int found = 0, tried = 0;
  for (int axis = 0; axis < 6; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Vector6 off = Vector6::Zero();
      off[axis] = sign * (axis < 3 ? 8 * kDeg : 0.012);
      Matrix6 covariance = Matrix6::Identity() * std::pow(6 * kDeg, 2);
      covariance.diagonal().tail<3>().setConstant(0.01 * 0.01);
      Rigid3 pose = truth * Rigid3::exp(off);
      for (int round = 0; round < 4; ++round) {
        const Observation seen = (*tracker)->propose(*frame, ObjectId(0), pose, covariance);
        if (seen.terms.empty()) break;
        Matrix6 system = covariance.inverse();
        Vector6 slope = Vector6::Zero();
        for (const PoseTermPtr& term : seen.terms) {
          const LinearizedTerm at = term->linearize(pose);
          system += at.information;
          slope += at.gradient;
        }
        pose = pose * Rigid3::exp(-system.ldlt().solve(slope));
      }
      ++tried;
      // One camera knows little of depth.
      const Vector6 left = difference(pose, truth);
      const Eigen::Vector3d ray =
          (pose.inverse() * rig.cameras()[0].world_from_camera).translation.normalized();
      const Eigen::Vector3d aside = left.tail<3>() - ray * ray.dot(left.tail<3>());
      found +=
          aside.norm() < 0.002 && left.tail<3>().norm() < 0.025 && left.head<3>().norm() < 3 * kDeg;
    }
  }
  EXPECT_GE(found, tried - 2);
}

// A quarter of its size and 15 degrees from frame to frame, each time in a new direction: where it
// is predicted is farther from it than where it was.
TEST(ObjectTracker, MotionThatTurnsBackAtOnceIsHeld) {
  SceneRigOptions options = options_of(1s);
  test::SceneSteps steps;
  steps.step = 0.031;
  steps.turn = 15 * kDeg;
  options.path = test::erratic_path(steps, options.duration);
  const SceneRig rig(options);
  Tracking tracking(rig);
  int sets = 0, held = 0;
  for (const auto& set : rig.sets()) {
    const PoseEstimate estimate = tracking.step(set).estimate;
    const Rigid3 truth = rig.truth(set.front().true_capture);
    ++sets;
    held += has_pose(estimate.state) &&
                    translation_distance(truth, estimate.world_from_object) < 0.05 &&
                    rotation_angle(truth, estimate.world_from_object) < 5 * kDeg
                ? 1
                : 0;
  }
  EXPECT_GE(held, sets * 9 / 10);
}

TEST(ObjectTracker, ACoveredCameraSaysNothingAndLearnsNothing) {
  SceneRigOptions options = options_of(700ms);
  options.cards.push_back({1, 400ms, 560ms, 0ms, 1.0});
  const SceneRig rig(options);
  Tracking tracking(rig);
  int hidden_frames = 0, claims = 0, learned = 0;
  double worst_mm = 0;
  for (const auto& set : rig.sets()) {
    const UpdateReport report = tracking.step(set);
    const Duration since = set.front().true_capture - options.start;
    const Rigid3 truth = rig.truth(set.front().true_capture);
    if (since < 300ms) continue;
    worst_mm =
        std::max(worst_mm, 1e3 * translation_distance(truth, report.estimate.world_from_object));
    if (since < 400ms || since >= 560ms) continue;
    ++hidden_frames;
    const auto& result = tracking.trackers[1]->last_result(0);
    claims += result.seen ? 1 : 0;
    learned += since > 440ms && result.learned ? 1 : 0;
  }
  EXPECT_GT(hidden_frames, 3);
  EXPECT_EQ(claims, 0);
  EXPECT_EQ(learned, 0);
  // Depth by one camera alone.
  EXPECT_LT(worst_mm, 9);
  EXPECT_TRUE(tracking.trackers[1]->last_result(0).seen) << "does not come back";
}

TEST(ObjectTracker, HiddenFromAllIsCoastingWithinOneFrame) {
  SceneRigOptions options = options_of(400ms);
  options.cards.push_back({-1, 300ms, 360ms, 0ms, 1.0});
  const SceneRig rig(options);
  Tracking tracking(rig);
  for (const auto& set : rig.sets()) {
    const UpdateReport report = tracking.step(set);
    const Duration since = set.front().true_capture - options.start;
    if (since > 300ms && since < 360ms) {
      EXPECT_EQ(report.estimate.state, TrackState::kCoasting);
    }
  }
}

TEST(ObjectTracker, TwoRunsAreTheSameToTheLastBit) {
  const SceneRig rig(options_of(300ms));
  std::vector<std::vector<double>> runs(2);
  for (auto& run : runs) {
    Tracking tracking(rig);
    for (const auto& set : rig.sets()) {
      const Rigid3 pose = tracking.step(set).estimate.world_from_object;
      run.insert(run.end(), {pose.translation.x(), pose.translation.y(), pose.translation.z(),
                             pose.rotation.x(), pose.rotation.y(), pose.rotation.z()});
    }
  }
  ASSERT_EQ(runs[0].size(), runs[1].size());
  EXPECT_EQ(std::memcmp(runs[0].data(), runs[1].data(), runs[0].size() * sizeof(double)), 0);
}

TEST(ObjectTracker, AllocatesOnlyWhatItHandsOut) {
  const SceneRig rig(options_of(600ms));
  Tracking tracking(rig);
  size_t worst = 0;
  int frames = 0;
  std::vector<Observation> out;
  out.reserve(4);
  for (const auto& set : rig.sets()) {
    const PoseTrackPtr track = tracking.estimator->track();
    if (++frames > 12) {
      const FramePtr frame = rig.shoot(set[0]);
      frame->i420();
      out.clear();
      const size_t before = test::allocations();
      tracking.trackers[0]->step(*frame, {&track, 1}, out);
      worst = std::max(worst, test::allocations() - before);
    }
    tracking.step(set);
  }
  // Per term: itself with its counts, and its matches; and the list of terms as it grows.
  EXPECT_LE(worst, 10u);
}

TEST(ObjectTracker, ALostObjectYieldsAnEmptyObservation) {
  const SceneRig rig(options_of(100ms));
  auto tracker = ObjectTracker::create(rig.cameras()[0], CameraId(0), {tracked()});
  ASSERT_TRUE(tracker);
  std::vector<Observation> out;
  const FramePtr frame = rig.shoot(rig.shots().front());
  (*tracker)->step(*frame, {}, out);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_TRUE(out[0].terms.empty());
  EXPECT_EQ(out[0].capture, frame->info().capture);
}

TEST(ObjectTracker, TheSceneHidesLines) {
  SceneRigOptions options = options_of(100ms);
  options.azimuths_deg = {0};
  const SceneRig rig(options);
  const SceneShot shot = rig.shots().front();
  const FramePtr frame = rig.shoot(shot);
  const CalibratedCamera& camera = rig.cameras()[0];
  const Rigid3 truth = rig.truth(shot.true_capture);
  const auto middle = camera.model.project(camera.world_from_camera.inverse() * truth.translation);
  ASSERT_TRUE(middle);
  // A wall right before the camera, left of the object's middle.
  const int width = camera.model.width(), height = camera.model.height();
  auto wall = std::make_shared<std::vector<float>>(static_cast<size_t>(width * height), 0.0f);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < static_cast<int>(middle->x()); ++x) {
      (*wall)[static_cast<size_t>(y * width + x)] = 4.0f;
    }
  }
  const SceneDepth scene{{0, 0, width, height, width, wall->data()}, wall};
  const Matrix6 covariance = Matrix6::Identity() * 1e-5;
  auto open = ObjectTracker::create(camera, CameraId(0), {tracked()});
  auto walled = ObjectTracker::create(camera, CameraId(0), {tracked()}, {}, scene);
  ASSERT_TRUE(open && walled);
  (*open)->propose(*frame, ObjectId(0), truth, covariance);
  const Observation seen = (*walled)->propose(*frame, ObjectId(0), truth, covariance);
  EXPECT_LT((*walled)->last_result(0).lines_total, (*open)->last_result(0).lines_total * 2 / 3);
  for (const PoseTermPtr& term : seen.terms) {
    const auto* lines = dynamic_cast<const LineTerm*>(term.get());
    if (lines == nullptr) continue;
    for (const LineMatch& line : lines->lines()) EXPECT_GT(line.center.x(), middle->x());
  }
}

TEST(ObjectTracker, PrintIsKeptWhereTheMeshIs) {
  const TriangleMesh carton = test::make_carton();
  SceneRigOptions options = options_of(900ms);
  options.shape = std::make_shared<const test::RayMesh>(carton);
  options.paint.kind = test::Paint::Kind::kPrinted;
  const SceneRig rig(options);
  const auto mesh = std::make_shared<const RenderMesh>(make_render_mesh(carton));
  Tracking tracking(rig, {ObjectId(0),
                          views_of(carton),
                          {false, true, true, true},
                          mesh_depth_renderer_factory(mesh)});
  std::vector<double> off_px;
  for (const auto& set : rig.sets()) {
    tracking.step(set);
    const CalibratedCamera& camera = rig.cameras()[0];
    const Rigid3 camera_from_object =
        camera.world_from_camera.inverse() * rig.truth(set[0].true_capture);
    for (const PoseTermPtr& term : tracking.observations[0].terms) {
      if (term->kind() != "texture") continue;
      const auto& points = dynamic_cast<const ReprojectionTerm&>(*term);
      for (const PointMatch& match : points.matches()) {
        const auto pixel = camera.model.project(camera_from_object * match.point_in_object);
        ASSERT_TRUE(pixel);
        off_px.push_back((*pixel - match.pixel).norm());
      }
    }
  }
  ASSERT_GT(off_px.size(), 50u);
  EXPECT_LT(Errors::median(off_px), 1.5);
}

/// A carton, to which nothing but its paint is another when it is turned over.
const TriangleMesh& carton() {
  static const TriangleMesh mesh = [] {
    TriangleMesh made = test::make_carton();
    made.face_colors.clear();
    for (const auto& corners : made.face_normals) {
      const Eigen::Vector3f side = made.normals[corners[0]];
      made.face_colors.push_back((0.5f * Eigen::Vector3f::Ones() + 0.45f * side).cwiseMax(0.04f));
    }
    return made;
  }();
  return mesh;
}

TrackedObject tracked_carton(bool colors) {
  static const auto views = views_of(carton());
  const auto mesh = std::make_shared<const RenderMesh>(make_render_mesh(carton()));
  TrackedObject object{ObjectId(0),
                       views,
                       {false, true, true, true},
                       mesh_depth_renderer_factory(mesh),
                       shape_symmetry_of(*views, {}),
                       nullptr};
  if (!colors) return object;
  std::vector<SurfaceSample> samples;
  for (size_t f = 0; f < carton().faces.size(); ++f) {
    const auto& face = carton().faces[f];
    const Eigen::Vector3f a = carton().vertices[face[0]], b = carton().vertices[face[1]],
                          c = carton().vertices[face[2]];
    const Eigen::Array3f rgb = carton().face_colors[f].array().pow(1 / 2.2f);
    const float y = 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2];
    const Eigen::Vector3f yuv(16 + 219 * y, 128 + 126 * (rgb[2] - y), 128 + 160 * (rgb[0] - y));
    for (float u = 0.05f; u < 1; u += 0.1f) {
      for (float v = 0.05f; u + v < 1; v += 0.1f) {
        samples.push_back({a + u * (b - a) + v * (c - a), (b - a).cross(c - a).normalized(), yuv});
      }
    }
  }
  object.samples = std::make_shared<const std::vector<SurfaceSample>>(std::move(samples));
  return object;
}

SceneRigOptions carton_options(Duration duration, test::Paint::Kind paint) {
  SceneRigOptions options = options_of(duration);
  options.shape = std::make_shared<const test::RayMesh>(carton());
  options.paint.kind = paint;
  return options;
}

TEST(ObjectTracker, ShapeAloneDoesNotTellHowACartonLies) {
  const SceneRig rig(carton_options(500ms, test::Paint::Kind::kPrinted));
  const TrackedObject object = tracked_carton(false);
  ASSERT_EQ(object.shape_symmetry.rotations.size(), 3u);
  Tracking tracking(rig, object);
  tracking.start(object.shape_symmetry, object.shape_symmetry.rotations[1], false);
  int ambiguous = 0;
  for (const auto& set : rig.sets()) {
    const PoseEstimate estimate = tracking.step(set).estimate;
    ASSERT_EQ(estimate.state, TrackState::kDegraded);
    ambiguous += estimate.degraded_reasons == kAmbiguous ? 1 : 0;
    EXPECT_GT(estimate.sigma_rotation(), 60 * kDeg);
    // Held as well as one can: at a symmetric pose.
    Rigid3 nearest = rig.truth(set.front().true_capture);
    for (const Rigid3& turn : object.shape_symmetry.rotations) {
      const Rigid3 other = rig.truth(set.front().true_capture) * turn;
      if (rotation_angle(other, estimate.world_from_object) <
          rotation_angle(nearest, estimate.world_from_object)) {
        nearest = other;
      }
    }
    EXPECT_LT(rotation_angle(nearest, estimate.world_from_object), 4 * kDeg);
    EXPECT_LT(translation_distance(nearest, estimate.world_from_object), 0.004);
  }
  EXPECT_GE(ambiguous, 10);
}

TEST(ObjectTracker, ColorsOfTheMeshTellHowACartonLies) {
  const SceneRig rig(carton_options(400ms, test::Paint::Kind::kFaces));
  const TrackedObject object = tracked_carton(true);
  for (const Rigid3& turn : object.shape_symmetry.rotations) {
    Tracking tracking(rig, object);
    tracking.start(object.shape_symmetry, turn, false);
    PoseEstimate estimate;
    for (const auto& set : rig.sets()) {
      estimate = tracking.step(set).estimate;
      const double off =
          rotation_angle(rig.truth(set.front().true_capture), estimate.world_from_object);
      ASSERT_TRUE(estimate.state != TrackState::kTracking || off < 5 * kDeg) << off / kDeg;
    }
    EXPECT_EQ(estimate.state, TrackState::kTracking);
  }
}

TEST(ObjectTracker, APrintThatDoesNotShowRefusesTheOutline) {
  const SceneRig rig(carton_options(300ms, test::Paint::Kind::kFaces));
  TrackedObject object = tracked_carton(true);
  object.printed = true;
  Tracking tracking(rig, object);
  size_t measured = 0;
  for (const auto& set : rig.sets()) {
    tracking.step(set);
    for (const Observation& seen : tracking.observations) measured += seen.terms.empty() ? 0 : 1;
  }
  EXPECT_GT(measured, rig.shots().size() / 2);
  // The same shape at the same place, with another print.
  std::vector<SurfaceSample> other = *object.samples;
  for (SurfaceSample& spot : other) spot.color = Eigen::Vector3f::Constant(255) - spot.color;
  object.samples = std::make_shared<const std::vector<SurfaceSample>>(std::move(other));
  Tracking refused(rig, object);
  refused.step(rig.sets().front());  // a proposal is not asked for its print
  for (size_t i = 1; i < rig.sets().size(); ++i) {
    refused.step(rig.sets()[i]);
    for (const Observation& seen : refused.observations) EXPECT_TRUE(seen.terms.empty()) << i;
  }
}

TEST(ObjectTracker, PrintSeenBeforeTellsHowACartonLiesWhenItIsFoundAgain) {
  const SceneRig rig(carton_options(1200ms, test::Paint::Kind::kPrinted));
  const TrackedObject object = tracked_carton(false);
  Tracking tracking(rig, object);
  size_t count = 0;
  PoseEstimate estimate;
  for (const auto& set : rig.sets()) {
    if (++count == 20)
      tracking.start(object.shape_symmetry, object.shape_symmetry.rotations[2], false);
    estimate = tracking.step(set).estimate;
    const double off =
        rotation_angle(rig.truth(set.front().true_capture), estimate.world_from_object);
    ASSERT_TRUE(estimate.state != TrackState::kTracking || off < 5 * kDeg) << count;
    if (count == 19) {
      EXPECT_EQ(estimate.state, TrackState::kTracking);
    }
  }
  EXPECT_EQ(estimate.state, TrackState::kTracking);
}

TEST(ObjectTracker, RefusesImpossibleOptions) {
  const SceneRig rig(options_of(50ms));
  TrackerOptions options;
  options.learning_rate = 0;
  const auto made = ObjectTracker::create(rig.cameras()[0], CameraId(0), {tracked()}, options);
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().text.find("learning_rate"), std::string::npos);
}

}  // namespace
}  // namespace sightline
