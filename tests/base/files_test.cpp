// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/files.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

namespace sightline {
namespace {

/// Files in a folder of their own, under a given umask. It is the process's: one test at a time.
class FileModes : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = std::filesystem::path(testing::TempDir()) / fmt::format("modes_{}", ::getpid());
    std::filesystem::create_directory(directory_);
    before_ = umask(022);
  }
  void TearDown() override {
    umask(before_);
    std::filesystem::remove_all(directory_);
  }
  static unsigned mode_of(const std::filesystem::path& path) {
    struct stat info {};
    EXPECT_EQ(stat(path.c_str(), &info), 0);
    return info.st_mode & 07777;
  }

  std::filesystem::path directory_;
  mode_t before_ = 0;
};

TEST_F(FileModes, ANewFileObeysTheUmask) {
  for (const auto& [mask, mode] :
       {std::pair{022u, 0644u}, {027u, 0640u}, {077u, 0600u}, {0u, 0666u}}) {
    umask(mask);
    const auto path = directory_ / std::to_string(mask);
    ASSERT_TRUE(write_file_atomically(path, "x"));
    EXPECT_EQ(mode_of(path), mode) << mask;
  }
}

TEST_F(FileModes, AReplacedFileIsNeverWidened) {
  const auto path = directory_ / "secret";
  ASSERT_TRUE(write_file_atomically(path, "x"));
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  ASSERT_TRUE(write_file_atomically(path, "y"));
  EXPECT_EQ(mode_of(path), 0600u);
  umask(077);
  ASSERT_EQ(chmod(path.c_str(), 0666), 0);
  ASSERT_TRUE(write_file_atomically(path, "z"));
  EXPECT_EQ(mode_of(path), 0600u);
  EXPECT_EQ(*read_file(path), "z");
}

TEST_F(FileModes, AFailureLeavesNothingBehind) {
  ASSERT_TRUE(std::filesystem::create_directory(directory_ / "taken"));
  EXPECT_FALSE(write_file_atomically(directory_ / "taken", "x"));
  EXPECT_FALSE(write_file_atomically(directory_ / "none" / "file", "x"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_), {}), 1);
}

}  // namespace
}  // namespace sightline
