// SPDX-License-Identifier: Apache-2.0
// What a watch proposes, written and taken over.
#include "sightline/pipeline/calibration_proposal.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

CalibratedCamera camera(const std::string& name, double x, double fx = 600) {
  CameraModel::Parameters lens;
  lens.width = 640;
  lens.height = 480;
  lens.fx = lens.fy = fx;
  lens.cx = 319.5;
  lens.cy = 239.5;
  return {name, CameraModel::create(lens, name).value(),
          Rigid3(Eigen::Quaterniond::Identity(), {x, 0, 0}), 0.3};
}

class Proposal : public testing::Test {
 protected:
  Proposal() : folder_(fs::path(testing::TempDir()) / fmt::format("proposal_{}", ::getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    EXPECT_TRUE(write_calibration(calibration(), {camera("a", 0), camera("b", 1)}));
    before_ = read_file(calibration()).value();
    installation_.calibration = calibration();
    for (const CalibratedCamera& calibrated : {camera("a", 0), camera("b", 1)}) {
      installation_.cameras.push_back({.name = calibrated.name,
                                       .recording = {},
                                       .recorded_as = {},
                                       .calibration = calibrated,
                                       .overlay = {},
                                       .place = {}});
    }
    watches_.resize(2);
    watches_[1].state = CalibrationState::kKnocked;
    watches_[1].correction << 0, 0.01, 0, 0.002, 0, 0;
    EXPECT_TRUE(write_proposal(proposed(), installation_, watches_));
  }
  ~Proposal() override { fs::remove_all(folder_); }

  fs::path calibration() const { return folder_ / "calibration.toml"; }
  fs::path proposed() const { return folder_ / "state" / "proposed.toml"; }
  void expect_refused(const Result<Acceptance>& done, const std::string& words) {
    ASSERT_FALSE(done.has_value());
    EXPECT_NE(done.error().message().find(words), std::string::npos) << done.error().message();
    EXPECT_EQ(read_file(calibration()).value(), before_) << "nothing is written";
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 2);
  }

  const fs::path folder_;
  std::string before_;
  Installation installation_;
  std::vector<CameraWatch> watches_;
};

TEST_F(Proposal, IsTakenOverAndTheOldOneKept) {
  const Acceptance done = accept_proposal(calibration(), proposed()).value();
  ASSERT_EQ(done.cameras.size(), 1u);
  EXPECT_EQ(done.cameras[0].name, "b");
  EXPECT_NEAR(done.cameras[0].turned_deg, 0.573, 1e-3);
  EXPECT_NEAR(done.cameras[0].shifted_mm, 2, 1e-3);
  EXPECT_EQ(read_file(done.kept).value(), before_);
  const std::vector<CalibratedCamera> now = read_calibration(calibration()).value();
  EXPECT_EQ(now[0].world_from_camera, camera("a", 0).world_from_camera);
  const Vector6 moved = difference(camera("b", 1).world_from_camera, now[1].world_from_camera);
  EXPECT_LT((moved - watches_[1].correction).norm(), 1e-9);
}

TEST_F(Proposal, OfAnotherCalibrationIsNone) {
  const fs::path file = proposal_file(calibration(), "/state");
  EXPECT_EQ(file.parent_path(), "/state");
  ASSERT_TRUE(accept_proposal(calibration(), proposed()).has_value());
  EXPECT_NE(proposal_file(calibration(), "/state"), file);
  EXPECT_TRUE(proposal_file(calibration(), "").empty());
}

TEST_F(Proposal, IsRefusedWhereItDoesNotFit) {
  expect_refused(accept_proposal(calibration(), calibration()), "proposes nothing");
  const std::vector<std::string> other = {"a"};
  expect_refused(accept_proposal(calibration(), proposed(), other),
                 "proposes no other place for camera \"a\"");
  ASSERT_TRUE(write_calibration(proposed(), {camera("b", 1.1, 700)}));
  expect_refused(accept_proposal(calibration(), proposed()), "has another lens");
  ASSERT_TRUE(write_calibration(proposed(), {camera("c", 1.1)}));
  expect_refused(accept_proposal(calibration(), proposed()), "\"c\" is not in it");
  ASSERT_TRUE(write_file_atomically(proposed(), "[[camera]]\nname = 3\n"));
  expect_refused(accept_proposal(calibration(), proposed()), "proposed.toml:2");
}

}  // namespace
}  // namespace sightline
