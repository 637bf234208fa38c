// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "sightline/base/files.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/config/object_file.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
const fs::path kBench = SIGHTLINE_SOURCE_DIR "/recordings/bench";

class OnDisk : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(testing::TempDir()) /
        ("sightline_config_" + std::to_string(testing::UnitTest::GetInstance()->random_seed()) +
         testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void copy_bench_texts() {
    fs::create_directories(folder_ / "objects");
    for (const char* name : {"recording.toml", "calibration.toml", "scene.obj",
                             "objects/carton.toml", "objects/carton.obj"}) {
      fs::copy_file(kBench / name, folder_ / name);
    }
  }
  void rewrite(const char* name, const std::string& from, const std::string& to) {
    std::string text = *read_file(folder_ / name);
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos);
    ASSERT_TRUE(write_file_atomically(folder_ / name, text.replace(at, from.size(), to)));
  }

  fs::path folder_;
};

// Whoever calibrates has no calibration yet.
TEST_F(OnDisk, AnInstallationThatIsToBeCalibrated) {
  const std::string text =
      "calibration = \"none_yet.toml\"\n"
      "[[camera]]\nname = \"top\"\nsource = \"v4l2:/dev/video0\"\n"
      "[[camera]]\nname = \"low\"\nsource = \"v4l2:/dev/video2\"\nwidth = 1920\nheight = 1080\n"
      "[[camera]]\nname = \"played\"\nsource = \"replay:" +
      kBench.string() + "\"\nrecorded_as = \"side\"\n";
  ASSERT_TRUE(write_file_atomically(folder_ / "rig.toml", text));
  EXPECT_FALSE(read_installation(folder_ / "rig.toml"));
  const auto rig = read_uncalibrated_installation(folder_ / "rig.toml");
  ASSERT_TRUE(rig.has_value()) << rig.error().message();
  ASSERT_EQ(rig->cameras.size(), 3u);
  EXPECT_EQ(rig->cameras[0].v4l2.width, 0);  // as the camera is set
  EXPECT_EQ(rig->cameras[1].v4l2.width, 1920);
  EXPECT_EQ(rig->cameras[1].v4l2.height, 1080);
  EXPECT_EQ(rig->cameras[2].recorded_as, "side");
  // An earlier calibration says the size, unless the table does.
  fs::copy_file(kBench / "calibration.toml", folder_ / "none_yet.toml");
  rewrite("rig.toml", "\"top\"", "\"left\"");
  const auto again = read_uncalibrated_installation(folder_ / "rig.toml");
  ASSERT_TRUE(again.has_value()) << again.error().message();
  EXPECT_EQ(again->cameras[0].v4l2.width, again->cameras[0].calibration.model.width());
  EXPECT_EQ(again->cameras[1].v4l2.width, 1920);
  // Everything else is still refused.
  rewrite("rig.toml", "width = 1920\n", "");
  EXPECT_FALSE(read_uncalibrated_installation(folder_ / "rig.toml"));
  rewrite("rig.toml", "height = 1080\n", "tint = 1\n");
  EXPECT_FALSE(read_uncalibrated_installation(folder_ / "rig.toml"));
}

TEST_F(OnDisk, ARecordingIsAnInstallation) {
  const auto installation = recording_installation(kBench);
  ASSERT_TRUE(installation.has_value()) << installation.error().message();
  ASSERT_EQ(installation->cameras.size(), 3u);
  EXPECT_EQ(installation->name, "bench");
  EXPECT_EQ(installation->cameras[2].name, "side");
  EXPECT_FALSE(installation->cameras[0].loop);
  EXPECT_EQ(installation->cameras[0].calibration.name, "left");
  ASSERT_EQ(installation->objects.size(), 1u);
  EXPECT_EQ(installation->objects[0].description.name, "carton");
  ASSERT_EQ(installation->scene.meshes.size(), 1u);
  EXPECT_NE(installation->scene.content, 0u);
  EXPECT_FALSE(installation->rtsp.enabled || installation->http.enabled);
}

TEST_F(OnDisk, ReadsAnInstallationThatPlaysARecording) {
  const std::string bench = kBench.string();
  const fs::path file = folder_ / "cell.toml";
  std::ofstream(file) << "calibration = \"" << bench << "/calibration.toml\"\n"
                      << "[[camera]]\nname = \"right\"\nsource = \"replay:" << bench << "\"\n"
                      << "[[object]]\nfile = \"" << bench << "/objects/carton.toml\"\n"
                      << "[scene]\nmeshes = [\"" << bench << "/scene.obj\"]\n"
                      << "[record]\nenabled = true\ndirectory = \".\"\n";
  const auto installation = read_installation(file);
  ASSERT_TRUE(installation.has_value()) << installation.error().message();
  EXPECT_EQ(installation->cameras[0].calibration.model.width(), 640);
  EXPECT_NE(installation->objects[0].content, 0u);
}

TEST_F(OnDisk, SeesThatAnObjectsMeshHasChanged) {
  copy_bench_texts();
  const auto before = recording_installation(folder_);
  ASSERT_TRUE(before.has_value()) << before.error().message();
  std::ofstream(folder_ / "objects/carton.obj", std::ios::app) << "# more\n";
  const auto after = recording_installation(folder_);
  ASSERT_TRUE(after.has_value());
  EXPECT_EQ(compare(*before, *after).objects_changed, std::vector<std::string>{"carton"});
}

TEST_F(OnDisk, ErrorsOfNamedFilesAreInside) {
  copy_bench_texts();
  rewrite("objects/carton.toml", "tag36h11", "tag36h99");
  const fs::path file = folder_ / "cell.toml";
  std::ofstream(file) << "calibration = \"calibration.toml\"\n"
                      << "[[camera]]\nname = \"right\"\nsource = \"replay:.\"\n"
                      << "[[object]]\nfile = \"objects/carton.toml\"\n";
  const auto installation = read_installation(file);
  ASSERT_FALSE(installation.has_value());
  EXPECT_EQ(installation.error().where, file.string() + ":6:8");
  EXPECT_NE(installation.error().text.find("carton.toml:6:10"), std::string::npos)
      << installation.error().message();
}

TEST_F(OnDisk, AFileOfBytesIsNoSceneDepth) {
  copy_bench_texts();
  ASSERT_TRUE(write_file_atomically(folder_ / "depth.png", "RIFF"));
  const char* text =
      "calibration = \"calibration.toml\"\n[[camera]]\nname = \"left\"\n"
      "source = \"rtsp://host/left\"\nscene_depth = \"depth.png\"\n";
  ASSERT_TRUE(write_file_atomically(folder_ / "cell.toml", text));
  const auto installation = read_installation(folder_ / "cell.toml");
  ASSERT_FALSE(installation);
  EXPECT_EQ(installation.error().where, (folder_ / "cell.toml").string() + ":5:15");
  EXPECT_NE(installation.error().text.find("cannot use this depth image"), std::string::npos)
      << installation.error().text;
}

TEST_F(OnDisk, ADeepHeaderIsRefused) {
  std::string text = "[a";
  for (int i = 0; i < 35000; ++i) text += ".a";
  ASSERT_TRUE(write_file_atomically(folder_ / "deep.toml", text + "]\n"));
  const auto installation = read_installation(folder_ / "deep.toml");
  ASSERT_FALSE(installation);
  EXPECT_NE(installation.error().text.find("nested more than 32 levels"), std::string::npos);
  const auto object = read_object_file(folder_ / "deep.toml");
  ASSERT_FALSE(object);
  EXPECT_NE(object.error().text.find("nested more than 32 levels"), std::string::npos);
}

TEST_F(OnDisk, ARecordingWithoutCalibrationOfACamera) {
  copy_bench_texts();
  rewrite("calibration.toml", "\"left\"", "\"laft\"");
  const auto installation = recording_installation(folder_);
  ASSERT_FALSE(installation.has_value());
  EXPECT_NE(installation.error().message().find("recording.toml:6"), std::string::npos)
      << installation.error().message();
  EXPECT_NE(installation.error().text.find("\"left\" has no calibration"), std::string::npos);
}

TEST_F(OnDisk, ARecordingOfAnotherSize) {
  copy_bench_texts();
  rewrite("recording.toml", "width = 640", "width = 320");
  const auto installation = recording_installation(folder_);
  ASSERT_FALSE(installation.has_value());
  EXPECT_NE(installation.error().text.find("recorded at 320x480"), std::string::npos);
}

TEST_F(OnDisk, MissingFiles) {
  EXPECT_EQ(exit_code(read_installation(folder_ / "none.toml").error()), 2);
  EXPECT_EQ(exit_code(recording_installation(folder_ / "none").error()), 2);
}

}  // namespace
}  // namespace sightline
