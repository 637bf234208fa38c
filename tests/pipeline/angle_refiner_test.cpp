// SPDX-License-Identifier: Apache-2.0
//
// A head that swings at up to 60 deg/s before a room whose truth is known; its encoder is coarse
// (0.05 deg) and late (80 ms).
#include "sightline/pipeline/turning/angle_refiner.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "pipeline/turning_room.hpp"
#include "sightline/base/time.hpp"

namespace sightline {
namespace {

using namespace test;

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 1e9;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

struct Outcome {
  std::vector<double> refined_deg, encoder_deg;  ///< errors of where the camera looks
  std::vector<double> normalized;                ///< squared errors by their covariance, of two
  int frames = 0;
  int used = 0, refused = 0, same = 0;  ///< frames; the last were not touched
  RefinerStatus status;
  double cpu_ms = 0;  ///< of all frames
  std::vector<std::string> news;
};

/// Pan and tilt error by the covariance of the place.
double normalized_error(const CameraAxes& axes, const CameraPlace& place,
                        const Eigen::Vector2d& truth) {
  const Rigid3 camera = axes.world_from_camera(truth.x(), truth.y());
  const Eigen::Vector3d error = (camera * place.world_from_camera.inverse()).log().head<3>();
  const auto jacobian = axes.jacobian(truth.x());
  const Eigen::Matrix<double, 3, 2> turns = jacobian.topRows<3>();
  const Eigen::Matrix<double, 2, 3> inverse =
      (turns.transpose() * turns).inverse() * turns.transpose();
  const Eigen::Vector2d angles = inverse * error;
  const Eigen::Matrix2d covariance =
      inverse * place.covariance->topLeftCorner<3, 3>() * inverse.transpose();
  return angles.dot(covariance.inverse() * angles);
}

/// `warm_up`: frames that do not count.
Outcome run(const CalibratedCamera& camera, TurningHead& head, int frames, int warm_up,
            const std::function<void(TurningHead&)>& before = {},
            std::span<const PoseTrackPtr> tracks = {}, std::span<const MovingBox> boxes = {}) {
  const auto refiner = AngleRefiner::create(camera);
  Outcome out;
  for (int i = 0; i < frames; ++i) {
    if (before) before(head);
    const FramePtr frame = head.next();
    ++out.frames;
    const double start = process_cpu_ms();
    const FramePtr refined = refiner->step(frame, tracks, boxes);
    out.cpu_ms += process_cpu_ms() - start;
    if (const auto news = refiner->news()) out.news.push_back(*news);
    if (i < warm_up) continue;
    out.status = refiner->status();
    out.used += out.status.verdict == RefinerVerdict::kUsed ? 1 : 0;
    out.refused += out.status.verdict == RefinerVerdict::kRefused ? 1 : 0;
    out.same += frame == refined ? 1 : 0;
    const Eigen::Vector2d truth = head.truth();
    const Rigid3 camera_truth = camera.axes->world_from_camera(truth.x(), truth.y());
    const auto error = [&](const FramePtr& of) {
      return rotation_angle(camera_truth, of->info().place->world_from_camera) / kDegree;
    };
    out.encoder_deg.push_back(error(frame));
    out.refined_deg.push_back(error(refined));
    out.normalized.push_back(normalized_error(*camera.axes, *refined->info().place, truth));
  }
  return out;
}

void print(const char* name, const Outcome& r) {
  std::printf(
      "%s: encoder %.4f / %.4f deg, refined %.4f / %.4f (median / 95 %%), normalized %.2f; ", name,
      quantile(r.encoder_deg, 0.5), quantile(r.encoder_deg, 0.95), quantile(r.refined_deg, 0.5),
      quantile(r.refined_deg, 0.95), quantile(r.normalized, 0.5));
  std::printf(
      "%.2f ms of CPU a frame, used %d refused %d same %d of %zu, %zu keyframes, latency %.2f +- "
      "%.2f ms%s%s\n",
      r.cpu_ms / r.frames, r.used, r.refused, r.same, r.refined_deg.size(), r.status.keyframes,
      1e3 * r.status.latency_s, 1e3 * r.status.latency_sigma_s,
      r.status.latency_known ? " known" : "", r.status.latency_contradicted ? " contradicted" : "");
}

TEST(AngleRefiner, IsGoodToTwoHundredthsOfADegree) {
  const CalibratedCamera camera = head_camera();
  TurningHead head(camera, Room{});
  const Outcome r = run(camera, head, 120, 60);
  print("swing", r);
  EXPECT_GT(quantile(r.encoder_deg, 0.5), 0.05);
  EXPECT_LT(quantile(r.refined_deg, 0.5), 0.01);
  EXPECT_LT(quantile(r.refined_deg, 0.95), 0.02);
  EXPECT_GT(r.used, 55);
  EXPECT_NEAR(r.status.latency_s, 0.080, 0.001);
  EXPECT_FALSE(r.status.latency_contradicted);
  EXPECT_TRUE(r.news.empty());
  // 95 % of a chi^2 of two lie below 6.
  EXPECT_LT(quantile(r.normalized, 0.95), 6.0);
}

TEST(AngleRefiner, FindsTheLatencyFromFortyMillisecondsOff) {
  for (const double configured : {0.040, 0.120}) {
    CalibratedCamera camera = head_camera();
    camera.axes->latency_s = configured;
    TurningHead head(camera, Room{});
    const Outcome r = run(camera, head, 120, 60);
    print("wrong latency", r);
    EXPECT_GT(quantile(r.encoder_deg, 0.5), 1.0);
    EXPECT_LT(quantile(r.refined_deg, 0.95), 0.03);
    EXPECT_TRUE(r.status.latency_known);
    EXPECT_TRUE(r.status.latency_contradicted);
    EXPECT_NEAR(r.status.latency_s, 0.080, 0.003);
    EXPECT_LT(std::abs(r.status.latency_s - 0.080), 4 * r.status.latency_sigma_s);
    ASSERT_EQ(r.news.size(), 1u);
    EXPECT_THAT(r.news[0], testing::HasSubstr("head: by its picture"));
  }
}

TEST(AngleRefiner, WithoutTextureItIsTheEncoder) {
  const CalibratedCamera camera = head_camera(640, 360);
  Room room;
  room.contrast = 0;
  TurningHead head(camera, room);
  const Outcome r = run(camera, head, 60, 0);
  print("no texture", r);
  EXPECT_EQ(r.same, 60);
  EXPECT_EQ(r.status.keyframes, 0u);
}

// All that it sees turns with 8 deg/s by itself: nothing tells that from a turn but the encoder.
TEST(AngleRefiner, ABackgroundThatMovesDoesNoHarm) {
  const CalibratedCamera camera = head_camera(640, 360);
  TurningHead head(camera, Room{});
  const Outcome r = run(camera, head, 180, 0, [](TurningHead& h) {
    Vector6 turn;
    turn << 0, 0, 8 * kDegree * h.now(), 0, 0, 0;
    h.room().world_from_room = Rigid3::exp(turn);
  });
  print("all moves", r);
  EXPECT_LT(quantile(r.refined_deg, 0.5), 1.1 * quantile(r.encoder_deg, 0.5) + 0.01);
  EXPECT_LT(quantile(r.refined_deg, 0.95), 1.1 * quantile(r.encoder_deg, 0.95) + 0.01);
  EXPECT_FALSE(r.status.latency_contradicted);
}

// The same once all is known: until the readings of its time have come it is drawn along, as far as
// the head itself could have accelerated.
TEST(AngleRefiner, ABackgroundThatBeginsToMoveDoesLittleHarm) {
  const CalibratedCamera camera = head_camera(640, 360);
  for (const double rate_deg : {0.5, 3.0, 20.0}) {
    TurningHead head(camera, Room{});
    const Outcome r = run(camera, head, 150, 75, [&](TurningHead& h) {
      Vector6 turn;
      turn << 0, 0, rate_deg * kDegree * std::max(h.now() - 2.5, 0.0), 0, 0, 0;
      h.room().world_from_room = Rigid3::exp(turn);
    });
    print("begins to move", r);
    EXPECT_LT(quantile(r.refined_deg, 0.5), 1.1 * quantile(r.encoder_deg, 0.5) + 0.01);
    EXPECT_LT(quantile(r.refined_deg, 0.95), 1.25 * quantile(r.encoder_deg, 0.95) + 0.01);
    EXPECT_LT(quantile(r.refined_deg, 1), 0.4 + 0.06 * rate_deg);
    EXPECT_FALSE(r.status.latency_contradicted);
  }
}

TEST(AngleRefiner, WhatMovesBeforeTheBackgroundIsOutvoted) {
  const CalibratedCamera camera = head_camera(640, 360);
  Room room;
  room.cover = 0.35;
  TurningHead head(camera, room);
  const Outcome r = run(camera, head, 120, 60,
                        [](TurningHead& h) { h.room().cover_shift += Eigen::Vector2d(1.5, -0.8); });
  print("a third moves", r);
  EXPECT_LT(quantile(r.refined_deg, 0.95), 0.5 * quantile(r.encoder_deg, 0.95));
  EXPECT_NEAR(r.status.latency_s, 0.080, 0.002);
}

// An object that hides two thirds and moves: it is known where it is.
TEST(AngleRefiner, ObjectsAreLeftOutWhereTheyAreKnownToBe) {
  const CalibratedCamera camera = head_camera(640, 360);
  Room room;
  room.cover = 0.6;
  const auto moves = [](TurningHead& h) { h.room().cover_shift += Eigen::Vector2d(2.5, -1.2); };
  TurningHead blind(camera, room), seeing(camera, room);
  const Outcome without = run(camera, blind, 110, 60, moves);
  // A plate that goes along with the camera would need a pose for each frame; one that is large
  // enough and near hides the left of every picture if the head is asked at its own place.
  const auto refiner = AngleRefiner::create(camera);
  std::vector<double> errors;
  int used = 0;
  for (int i = 0; i < 110; ++i) {
    moves(seeing);
    const FramePtr frame = seeing.next();
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = frame->info().capture;
    estimate.state = TrackState::kTracking;
    estimate.world_from_object = frame->info().place->world_from_camera;
    const std::vector<PoseTrackPtr> tracks = {
        std::make_shared<const PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{})};
    const double right = (0.6 * 640 - 319.5) / camera.model.parameters().fx;
    const std::vector<MovingBox> boxes = {{ObjectId(0), {-0.7, -0.5, 1.0}, {right, 0.5, 1.001}}};
    const FramePtr refined = refiner->step(frame, tracks, boxes);
    if (i < 60) continue;
    used += refiner->status().verdict == RefinerVerdict::kUsed ? 1 : 0;
    const Eigen::Vector2d truth = seeing.truth();
    errors.push_back(rotation_angle(camera.axes->world_from_camera(truth.x(), truth.y()),
                                    refined->info().place->world_from_camera) /
                     kDegree);
  }
  print("two thirds move", without);
  std::printf("left out: %.4f / %.4f deg, used %d\n", quantile(errors, 0.5), quantile(errors, 0.95),
              used);
  EXPECT_LT(without.used, 20);
  EXPECT_LT(quantile(without.refined_deg, 0.95), 1.1 * quantile(without.encoder_deg, 0.95) + 0.01);
  EXPECT_GT(used, 45);
  EXPECT_LT(quantile(errors, 0.95), 0.03);
}

// Rounding does not average out, and a head that stands says nothing of its latency.
TEST(AngleRefiner, AHeadThatStandsLearnsNothingItCannotKnow) {
  CalibratedCamera camera = head_camera(640, 360);
  camera.axes->latency_s = 0.040;
  TurningHead head(camera, Room{}, [](double) -> Eigen::Vector2d {
    return Eigen::Vector2d(10.02, -3.02) * kDegree;  // 0.02 off the nearest step
  });
  const Outcome r = run(camera, head, 90, 45);
  print("stands", r);
  EXPECT_FALSE(r.status.latency_known);
  EXPECT_FALSE(r.status.latency_contradicted);
  EXPECT_GT(r.status.sigma, 0.008 * kDegree);
  EXPECT_LT(quantile(r.normalized, 0.95), 9.0);
}

// Five readings after a jump the history believes them again; the picture does not.
TEST(AngleRefiner, AnglesThatJumpAreNotBelieved) {
  const CalibratedCamera camera = head_camera(640, 360);
  for (const double jump : {57.0, 12.0}) {
    TurningHead head(camera, Room{});
    head.spoil = [&](AxisReading& reading) {
      if (head.now() > 2.5 && head.now() < 3.5) reading.pan += jump * kDegree;
    };
    const auto refiner = AngleRefiner::create(camera);
    int trusted_wrong = 0, believed_by_encoder = 0, back = 0;
    std::vector<std::string> news;
    for (int i = 0; i < 135; ++i) {
      const FramePtr frame = head.next();
      const FramePtr refined = refiner->step(frame, {}, {});
      if (const auto text = refiner->news()) news.push_back(*text);
      const Eigen::Vector2d truth = head.truth();
      const Rigid3 there = camera.axes->world_from_camera(truth.x(), truth.y());
      const auto wrong = [&](const FramePtr& f) {
        const CameraPlace& place = *f->info().place;
        return place.trusted() && rotation_angle(there, place.world_from_camera) > kDegree;
      };
      believed_by_encoder += wrong(frame) ? 1 : 0;
      trusted_wrong += wrong(refined) ? 1 : 0;
      back += head.now() > 3.8 && refiner->status().verdict == RefinerVerdict::kUsed ? 1 : 0;
    }
    EXPECT_GT(believed_by_encoder, 15) << jump;
    EXPECT_EQ(trusted_wrong, 0) << jump;
    EXPECT_GT(back, 15) << jump;
    ASSERT_EQ(news.size(), 2u) << jump;
    EXPECT_THAT(news[0], testing::HasSubstr("have jumped"));
    EXPECT_THAT(news[1], testing::HasSubstr("believed again"));
  }
}

TEST(AngleRefiner, AnEncoderThatCountsTheOtherWayIsFoundOut) {
  for (const bool pan : {true, false}) {
    const CalibratedCamera camera = head_camera(640, 360);
    TurningHead head(camera, Room{}, [](double t) -> Eigen::Vector2d {
      return Eigen::Vector2d(20 * std::sin(2 * t), 12 * std::sin(1.5 * t)) * kDegree;
    });
    head.spoil = [&](AxisReading& reading) { (pan ? reading.pan : reading.tilt) *= -1; };
    const Outcome r = run(camera, head, 90, 60);
    print(pan ? "pan the other way" : "tilt the other way", r);
    EXPECT_EQ(r.status.verdict, RefinerVerdict::kReversed);
    ASSERT_FALSE(r.news.empty());
    EXPECT_THAT(r.news[0], testing::HasSubstr(pan ? "pan_scale" : "tilt_scale"));
  }
}

TEST(AngleRefiner, FixedCamerasHaveNone) {
  CalibratedCamera camera = head_camera(640, 360);
  camera.axes.reset();
  EXPECT_EQ(AngleRefiner::create(camera), nullptr);
}

}  // namespace
}  // namespace sightline
