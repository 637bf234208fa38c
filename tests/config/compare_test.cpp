// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "fake_files.hpp"
#include "sightline/config/installation.hpp"

namespace sightline {
namespace {

constexpr const char* kBase = R"(calibration = "calibration.toml"
[[camera]]
name = "left"
source = "replay:rec"
[[object]]
file = "objects/carton.toml"
)";

std::string base_with(const std::string& more) { return kBase + more; }

Installation parsed(const std::string& text) {
  auto installation = parse_installation(text, "dir/cell.toml", test::fake_files());
  EXPECT_TRUE(installation.has_value()) << installation.error().message();
  return *std::move(installation);
}

std::string two_cameras(const std::string& more = "") {
  return base_with("[[camera]]\nname = \"right\"\nsource = \"replay:rec\"\n" + more);
}

TEST(Compare, NothingChanged) {
  const InstallationChanges changes = compare(parsed(two_cameras()), parsed(two_cameras()));
  EXPECT_TRUE(changes.none());
  EXPECT_EQ(changes.summary(), "nothing");
}

TEST(Compare, FindsCameras) {
  const Installation one = parsed(kBase), two = parsed(two_cameras());
  EXPECT_EQ(compare(one, two).cameras_added, std::vector<std::string>{"right"});
  EXPECT_EQ(compare(two, one).cameras_removed, std::vector<std::string>{"right"});
  EXPECT_FALSE(compare(one, two).camera_ids);
  const Installation faster = parsed(two_cameras("rate = 15\n"));
  EXPECT_EQ(compare(two, faster).cameras_changed, std::vector<std::string>{"right"});
  Installation moved = two;
  moved.cameras[1].calibration.world_from_camera.translation.x() += 0.001;
  EXPECT_EQ(compare(two, moved).cameras_changed, std::vector<std::string>{"right"});
  Installation swapped = two;
  std::swap(swapped.cameras[0], swapped.cameras[1]);
  EXPECT_TRUE(compare(two, swapped).camera_ids);
  EXPECT_TRUE(compare(two, swapped).cameras_changed.empty());
}

TEST(Compare, ARestyledCameraNeedNotRestart) {
  const Installation before = parsed(two_cameras());
  const Installation after = parsed(two_cameras("[camera.overlay]\nstyles = [\"axes\"]\n"));
  const InstallationChanges changes = compare(before, after);
  EXPECT_EQ(changes.cameras_restyled, std::vector<std::string>{"right"});
  EXPECT_TRUE(changes.cameras_changed.empty());
  EXPECT_EQ(changes.summary(), "overlay of right");
  const InstallationChanges all =
      compare(before, parsed(two_cameras("[overlay]\ncolor = \"#000000\"\n")));
  EXPECT_EQ(all.cameras_restyled, (std::vector<std::string>{"left", "right"}));
}

TEST(Compare, FindsAChangedSceneDepth) {
  const Installation none = parsed(two_cameras());
  const Installation before = parsed(two_cameras("scene_depth = \"right.png\"\n"));
  const auto expect_found = [](const Installation& old, const Installation& now) {
    const InstallationChanges changes = compare(old, now);
    EXPECT_TRUE(changes.scene_depth);
    EXPECT_EQ(changes.cameras_changed, std::vector<std::string>{"right"});
    EXPECT_EQ(changes.summary(), "changed camera right; scene depth");
  };
  expect_found(none, before);
  expect_found(before, none);
  expect_found(before, parsed(two_cameras("scene_depth = \"other.png\"\n")));
  expect_found(before,
               parsed(two_cameras("scene_depth = \"right.png\"\nscene_depth_scale = 0.002\n")));
  Installation painted = before;
  painted.cameras[1].scene_depth_content += 1;
  expect_found(before, painted);
  EXPECT_TRUE(compare(before, before).none());
}

TEST(Compare, TheLineOfATableIsNoChange) {
  EXPECT_TRUE(compare(parsed(two_cameras()), parsed("# a comment\n" + two_cameras())).none());
}

TEST(Compare, FindsVirtualCameras) {
  const std::string view = "[[virtual_camera]]\nname = \"room\"\n";
  const Installation before = parsed(base_with(view));
  for (const char* more : {"width = 640\n", "rate = 5\n", "eye = [1, 2, 3]\n", "fov_deg = 60\n",
                           "grid_m = 1\n", "[virtual_camera.overlay]\nstyles = [\"axes\"]\n"}) {
    const InstallationChanges changes = compare(before, parsed(base_with(view + more)));
    EXPECT_EQ(changes.summary(), "virtual cameras") << more;
  }
  EXPECT_TRUE(compare(before, parsed(base_with(view))).none());
}

TEST(Compare, FindsObjectsByContent) {
  const Installation before = parsed(kBase);
  Installation after = before;
  after.objects[0].content += 1;
  EXPECT_EQ(compare(before, after).objects_changed, std::vector<std::string>{"carton"});
  const Installation more = parsed(base_with("[[object]]\nfile = \"b.toml\"\n"));
  EXPECT_EQ(compare(before, more).objects_added, std::vector<std::string>{"b"});
  EXPECT_EQ(compare(more, before).objects_removed, std::vector<std::string>{"b"});
  EXPECT_FALSE(compare(more, before).object_ids);
}

TEST(Compare, EachSectionAlone) {
  const Installation before = parsed(kBase);
  const auto changes = [&](const std::string& text) {
    return compare(before, parsed(base_with(text)));
  };
  EXPECT_EQ(changes("[scene]\nmeshes = [\"a.obj\"]\n").summary(), "scene");
  EXPECT_EQ(changes("[scene]\nlearn = true\n").summary(), "scene");
  EXPECT_EQ(changes("[overlay]\ndepth_tolerance = 0.1\n").summary(),
            "overlay backend, font and depth");
  EXPECT_EQ(changes("[overlay]\ncrease_deg = 20\n").summary(),
            "surfaces of meshes; overlay backend, font and depth");
  EXPECT_EQ(changes("[overlay]\nfill = \"textured\"\n").summary(),
            "overlay of left; surfaces of meshes");
  EXPECT_EQ(changes("[[virtual_camera]]\nname = \"room\"\n").summary(), "virtual cameras");
  EXPECT_EQ(compare(before, parsed("name = \"cell 2\"\n" + base_with(""))).summary(), "name");
  EXPECT_EQ(changes("[fiducial]\nmin_side_px = 9\n").summary(), "observe");
  EXPECT_EQ(changes("[estimator]\nnoise_linear = 9\n").summary(), "estimator");
  EXPECT_EQ(changes("[rtsp]\nport = 9\n").summary(), "rtsp");
  EXPECT_EQ(changes("[encoder]\nprefer = [\"x264enc\"]\n").summary(), "encoder");
  EXPECT_EQ(changes("[http]\nenabled = false\n").summary(), "http");
  EXPECT_EQ(changes("[record]\nstorage = \"ffv1\"\n").summary(), "record");
  EXPECT_EQ(changes("[detect]\naccept = 0.5\n").summary(), "observe");
  EXPECT_EQ(changes("[points]\nrate = 2\n").summary(), "observe");
  EXPECT_EQ(changes("[watch]\nauto_recover = true\n").summary(), "watch");
  EXPECT_EQ(changes("[daemon]\nlog_level = \"debug\"\n").summary(), "daemon");
}

}  // namespace
}  // namespace sightline
