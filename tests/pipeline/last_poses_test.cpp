// SPDX-License-Identifier: Apache-2.0
// Where objects were last, kept over restarts.
#include "sightline/pipeline/last_poses.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "sightline/base/files.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

class LastPoses : public testing::Test {
 protected:
  LastPoses() : folder_(fs::path(testing::TempDir()) / fmt::format("last_poses_{}", ::getpid())) {
    fs::remove_all(folder_);
  }
  ~LastPoses() override { fs::remove_all(folder_); }

  static PoseLogRow row(const std::string& name, double x) {
    PoseLogRow row;
    row.object = name;
    row.state = TrackState::kTracking;
    row.world_from_object = Rigid3(Eigen::Quaterniond::Identity(), {x, 0.2, 0.3});
    return row;
  }
  void damage(std::string_view text) { std::ofstream(file()) << text; }
  fs::path file() const { return folder_ / "state" / "last.csv"; }

  const fs::path folder_;
};

TEST_F(LastPoses, ComeBackAsTheyWere) {
  EXPECT_TRUE(read_last_poses(file()).empty()) << "there is no file yet";
  ASSERT_TRUE(write_last_poses(file(), {row("carton", 0.1), row("cup", -2)}));
  const auto rows = read_last_poses(file());
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].object, "carton");
  EXPECT_EQ(rows[1].world_from_object->translation, Eigen::Vector3d(-2, 0.2, 0.3));
  size_t files = 0;
  for (const auto& entry : fs::directory_iterator(file().parent_path())) files += entry.exists();
  EXPECT_EQ(files, 1u) << "what it was written to beside is gone";
}

TEST_F(LastPoses, WhatIsDamagedIsNothing) {
  ASSERT_TRUE(write_last_poses(file(), {row("carton", 0.1)}));
  const std::string whole = read_file(file()).value();
  damage(whole.substr(0, whole.size() / 2));
  EXPECT_TRUE(read_last_poses(file()).empty());
  damage(whole + "1,cup,tracking,nan,0,0,1,0,0,0,1,1,left\n");
  EXPECT_TRUE(read_last_poses(file()).empty());
  damage(std::string("\0\0\0\0 no text", 12));
  EXPECT_TRUE(read_last_poses(file()).empty());
  damage(std::string(kPoseLogHeader) + "\n1,carton,lost,,,,,,,,,,\n");
  EXPECT_TRUE(read_last_poses(file()).empty()) << "no pose";
  fs::remove(file());
  fs::create_directory(file());
  EXPECT_TRUE(read_last_poses(file()).empty()) << "no file";
}

TEST_F(LastPoses, EveryInstallationHasItsOwnFile) {
  ::setenv("STATE_DIRECTORY", (folder_.string() + ":/other").c_str(), 1);
  Installation one, other;
  one.file = "a/cell.toml";
  other.file = "b/cell.toml";
  EXPECT_EQ(last_poses_file(one).parent_path(), folder_);
  EXPECT_EQ(last_poses_file(one), last_poses_file(one));
  EXPECT_NE(last_poses_file(one), last_poses_file(other));
  ::unsetenv("STATE_DIRECTORY");
  ::setenv("XDG_STATE_HOME", folder_.c_str(), 1);
  EXPECT_EQ(state_folder(), folder_ / "sightline");
  ::setenv("XDG_STATE_HOME", "relative", 1);
  EXPECT_NE(state_folder(), fs::path("relative") / "sightline");
  ::unsetenv("XDG_STATE_HOME");
}

}  // namespace
}  // namespace sightline
