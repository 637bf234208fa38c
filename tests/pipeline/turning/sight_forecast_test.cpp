// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/sight_forecast.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "sightline/pipeline/rig.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {
namespace {

const std::filesystem::path kBench =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";
constexpr double kEnough = 0.3, kFrame = 1.0 / 30;  // of the object; [s]

/// Shares of the carton that each camera sees in its pixels, frame by frame, by the generator.
std::map<std::string, std::vector<double>> true_shares() {
  std::map<std::string, std::vector<double>> shares;
  std::ifstream file(kBench / "visibility.csv");
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string camera, field;
    std::getline(fields, camera, ',');
    std::getline(fields, field, ',');
    std::getline(fields, field, ',');
    std::getline(fields, field, ',');
    shares[camera].push_back(std::stod(field));
  }
  return shares;
}

class SightForecast : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    installation_ = std::make_unique<Installation>(recording_installation(kBench).value());
    rig_ = std::make_unique<Rig>(load_rig(*installation_).value());
    const auto rows = read_truth(kBench / "truth.csv").value();
    for (const auto& row : rows) poses_.push_back(row.world_from_object);
  }
  static void TearDownTestSuite() {
    rig_.reset();
    installation_.reset();
    poses_.clear();
  }

  static std::vector<SightCamera> cameras() {
    std::vector<SightCamera> all;
    for (uint32_t i = 0; i < rig_->cameras.size(); ++i) {
      all.push_back({CameraId(i), rig_->cameras[i]});
    }
    return all;
  }
  static Time time_of(size_t frame) {
    return Time{} + from_seconds(1 + static_cast<double>(frame) * kFrame);
  }
  /// As an estimator would have it that makes no mistakes: the pose, and how it moved lately.
  static PoseTrack track(size_t frame) {
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = time_of(frame);
    estimate.state = TrackState::kTracking;
    estimate.world_from_object = poses_.at(frame);
    estimate.twist = difference(poses_.at(frame - 1), poses_.at(frame)) / kFrame;
    return PoseTrack(estimate.object, {estimate}, MotionNoise{});
  }
  static std::vector<Sight> forecast(size_t frame) {
    return forecast_sight(track(frame), time_of(frame), *rig_->objects.front().mesh, cameras());
  }
  static const Sight* of(const std::vector<Sight>& sights, const std::string& camera) {
    for (const Sight& sight : sights) {
      if (installation_->cameras.at(sight.camera.index()).name == camera) return &sight;
    }
    return nullptr;
  }

  static inline std::unique_ptr<Installation> installation_;
  static inline std::unique_ptr<Rig> rig_;
  static inline std::vector<Rigid3> poses_;
};

TEST_F(SightForecast, WhatIsSeenNowIsWhatTheImagesShow) {
  const auto truth = true_shares();
  double worst = 0;
  for (size_t frame = 1; frame < poses_.size(); ++frame) {
    for (const SightCamera& camera : cameras()) {
      const std::string& name = installation_->cameras.at(camera.camera.index()).name;
      const double share = visible_share(camera, *rig_->objects.front().mesh, poses_[frame]);
      worst = std::max(worst, std::abs(share - truth.at(name).at(frame)));
    }
  }
  EXPECT_LT(worst, 0.25);  // points of a box against pixels
}

// The side camera loses the carton behind the monitor about frame 29, and finds it about frame 79.
TEST_F(SightForecast, TellsWhenAnObjectGoesBehindSomethingAndComesBack) {
  const auto side = true_shares().at("side");
  const auto crossing = [&](size_t from, bool seen) {
    while ((side.at(from) >= kEnough) != seen) ++from;
    return from;
  };
  const size_t goes = crossing(5, false), comes = crossing(goes, true);
  // It goes on as it moves, and the carton's way bends: what is further ahead is known by less.
  const std::map<size_t, double> within = {{6, 0.25}, {12, 0.35}, {18, kSightHorizon}};  // [s]
  for (const size_t change : {goes, comes}) {
    for (const auto& [ahead, tolerance] : within) {
      const auto sights = forecast(change - ahead);
      const Sight* sight = of(sights, "side");
      ASSERT_NE(sight, nullptr) << change << " " << ahead;
      EXPECT_EQ(sight->sees, change == goes) << ahead;
      ASSERT_TRUE(sight->changes_in.has_value()) << change << " " << ahead;
      EXPECT_NEAR(*sight->changes_in, static_cast<double>(ahead) * kFrame, tolerance)
          << change << " " << ahead;
    }
  }
  const auto sights = forecast(goes);
  const Sight* left = of(sights, "left");
  ASSERT_NE(left, nullptr);
  EXPECT_TRUE(left->sees);
  EXPECT_EQ(left->share, 1);
}

TEST_F(SightForecast, ACameraThatLooksAwaySeesNothing) {
  SightCamera camera = cameras().front();
  const Rigid3 pose = rig_->cameras.front()->camera().world_from_camera;
  const Rigid3 about(Eigen::Quaterniond(Eigen::AngleAxisd(3.1, Eigen::Vector3d::UnitY())),
                     Eigen::Vector3d::Zero());
  EXPECT_EQ(visible_share(camera, *rig_->objects.front().mesh, poses_[5]), 1);
  camera.world_from_camera = pose;
  EXPECT_EQ(visible_share(camera, *rig_->objects.front().mesh, poses_[5]), 1);
  camera.world_from_camera = pose * about;
  EXPECT_EQ(visible_share(camera, *rig_->objects.front().mesh, poses_[5]), 0);
}

TEST_F(SightForecast, WithoutAPoseNothingIsSaid) {
  const PoseTrack empty(ObjectId(0), {}, MotionNoise{});
  EXPECT_TRUE(forecast_sight(empty, time_of(3), *rig_->objects.front().mesh, cameras()).empty());
}

}  // namespace
}  // namespace sightline
