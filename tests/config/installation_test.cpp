// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/installation.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "fake_files.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {
namespace {

using test::fake_files;

constexpr const char* kBase = R"(calibration = "calibration.toml"
[[camera]]
name = "left"
source = "replay:rec"
[[object]]
file = "objects/carton.toml"
)";

Result<Installation> parse(const std::string& text) {
  return parse_installation(text, "dir/cell.toml", fake_files());
}

Installation parsed(const std::string& text) {
  auto installation = parse(text);
  EXPECT_TRUE(installation.has_value()) << installation.error().message();
  return *std::move(installation);
}

TEST(Installation, CamerasOfOtherHosts) {
  const std::string text = R"(calibration = "calibration.toml"
[cell]
broker = "10.0.0.1"
host = "hall-1"
[[camera]]
name = "right"
source = "replay:missing"
host = "hall-2"
[[camera]]
name = "left"
source = "replay:rec"
host = "hall-1"
[[camera]]
name = "side"
source = "replay:rec"
)";
  if (!cell_available()) GTEST_SKIP();
  const Installation installation = parsed(text);
  ASSERT_EQ(installation.cameras.size(), 2U);
  EXPECT_EQ(installation.cameras[0].name, "left");
  EXPECT_EQ(installation.cameras[1].name, "side");
  ASSERT_EQ(installation.cell.cameras.size(), 1U);
  EXPECT_EQ(installation.cell.cameras[0].name, "right");
  EXPECT_EQ(installation.cell.cameras[0].host, "hall-2");
  EXPECT_EQ(installation.cell.cameras[0].calibration, camera_hash(test::calibrated("right")));
  EXPECT_TRUE(installation.watch.enabled);

  const auto with_role = [&](const std::string& role, const std::string& host) {
    std::string changed = text;
    changed.replace(changed.find("host = \"hall-1\""), 15,
                    "host = \"" + host + "\"\nrole = \"" + role + "\"");
    return parse(changed);
  };
  EXPECT_FALSE(with_role("fusion", "hall-1")) << "it has cameras";
  const auto cameras = with_role("cameras", "hall-1");
  ASSERT_TRUE(cameras);
  EXPECT_FALSE(cameras->watch.enabled) << "places are judged where the estimates are";
  EXPECT_TRUE(compare(installation, *cameras).cell);
  const auto other = with_role("both", "hall-1");
  EXPECT_TRUE(compare(installation, *other).none());
}

TEST(Installation, CamerasAtTheBorderAreANeighborsHosts) {
  if (!cell_available()) GTEST_SKIP();
  const Installation installation = parsed(R"(calibration = "calibration.toml"
[cell]
broker = "10.0.0.1"
host = "hall-1"
name = "site/a"
neighbors = ["site/b", "site/c"]
[[camera]]
name = "right"
host = "hall-1"
cell = "site/b"
[[camera]]
name = "left"
source = "replay:rec"
host = "hall-1"
cell = "site/a"
)");
  ASSERT_EQ(installation.cameras.size(), 1U) << "hosts of two cells may have one name";
  EXPECT_EQ(installation.cameras[0].name, "left");
  EXPECT_EQ(installation.cell.cameras.at(0).cell, "site/b");
  EXPECT_EQ(installation.cell.neighbors, (std::vector<std::string>{"site/b", "site/c"}));
}

TEST(Installation, OtherHostsAreToldWhereThePageIs) {
  if (!cell_available()) GTEST_SKIP();
  const auto page = [](const std::string& cell, const std::string& http) {
    return parsed("calibration = \"calibration.toml\"\n[cell]\nbroker = \"b\"\nhost = \"f\"\n" +
                  cell + "[http]\n" + http +
                  "[[camera]]\nname = \"left\"\nsource = \"replay:rec\"\n")
        .cell.page;
  };
  EXPECT_EQ(page("", ""), "") << "loopback";
  EXPECT_EQ(page("", "address = \"10.0.0.7\"\nopen = true\nport = 80\n"), "http://10.0.0.7:80/");
  EXPECT_EQ(page("", "address = \"::\"\nopen = true\nport = 81\nnames = [\"hall.example\"]\n"),
            "http://hall.example:81/");
  EXPECT_EQ(page("page = \"https://front.example/hall/\"\n", ""), "https://front.example/hall/");
  const auto wrong = parse(
      "calibration = \"calibration.toml\"\n[cell]\nbroker = \"b\"\npage = \"javascript:1\"\n"
      "[[camera]]\nname = \"left\"\nsource = \"replay:rec\"\n");
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().text.find("page"), std::string::npos) << wrong.error().text;
}

TEST(Installation, AFusionHostNeedsNoCamera) {
  if (!cell_available()) GTEST_SKIP();
  const std::string head =
      "calibration = \"calibration.toml\"\n[cell]\nbroker = \"b\"\nhost = \"f\"\n";
  const std::string camera = "[[camera]]\nname = \"left\"\nhost = \"a\"\n";
  EXPECT_TRUE(parsed(head + "role = \"fusion\"\n" + camera).cameras.empty());
  EXPECT_NE(parse(head + camera).error().text.find("no camera is this host's"), std::string::npos);
}

TEST(Installation, LiveSources) {
  const std::string head = "calibration = \"calibration.toml\"\n";
  const Installation installation = parsed(head + R"(
[[camera]]
name = "left"
source = "v4l2:serial:A0"
rate = 30
format = "MJPEG"
frame_timeout = 2.5
[camera.controls]
auto_exposure = "manual_mode"
exposure_time_absolute = 80
exposure_dynamic_framerate = false
[[camera]]
name = "right"
source = "aravis:192.168.0.3"
format = "BayerRG8"
exposure_us = 5000
gain = 3
gamma = 1
trigger = "Action1"
trigger_edge = "falling"
trigger_delay_us = 20
strobe = "Line2"
action_group_key = 4294967295
latch = false
chunks = false
resend_ratio = 0.5
packet_timeout_us = 5000
frame_retention_us = 50000
ptp = true
[[camera]]
name = "side"
source = "rtsp://me:secret@10.0.0.7/live"
transport = "udp"
latency_ms = 50
[[camera]]
name = "back"
source = 'libcamera:\_SB_.PCI0-1:1.0-0bda:58f4'
rate = 15
buffers = 6
[camera.controls]
AeEnable = false
AnalogueGain = 2.5
AfMode = "continuous"
[action]
rate = 20
address = "192.168.0.255"
group_key = 4294967295
)");
  ASSERT_EQ(installation.cameras.size(), 4u);
  const CameraConfig& left = installation.cameras[0];
  EXPECT_EQ(left.source, SourceKind::kV4l2);
  EXPECT_EQ(left.v4l2.device, "serial:A0");
  EXPECT_EQ(left.v4l2.format, "MJPEG");
  EXPECT_EQ(left.v4l2.width, 640);
  EXPECT_EQ(left.v4l2.rate_hz, 30);
  EXPECT_EQ(left.v4l2.frame_timeout, from_seconds(2.5));
  EXPECT_EQ(left.v4l2.controls.at("auto_exposure"), V4l2ControlValue("manual_mode"));
  EXPECT_EQ(left.v4l2.controls.at("exposure_time_absolute"), V4l2ControlValue(int64_t{80}));
  EXPECT_EQ(left.v4l2.controls.at("exposure_dynamic_framerate"), V4l2ControlValue(int64_t{0}));
  const CameraConfig& right = installation.cameras[1];
  EXPECT_EQ(right.source, SourceKind::kAravis);
  EXPECT_EQ(right.aravis.id, "192.168.0.3");
  EXPECT_EQ(right.aravis.pixel_format, "BayerRG8");
  EXPECT_EQ(right.aravis.height, 480);
  EXPECT_EQ(right.aravis.exposure_us, 5000);
  EXPECT_EQ(right.aravis.trigger, "Action1");
  EXPECT_EQ(right.aravis.trigger_edge, TriggerEdge::kFalling);
  EXPECT_EQ(right.aravis.trigger_delay_us, 20);
  EXPECT_EQ(right.aravis.strobe, "Line2");
  EXPECT_EQ(right.aravis.action.group_key, 0xFFFFFFFFu);
  EXPECT_FALSE(right.aravis.latch);
  EXPECT_FALSE(right.aravis.chunks);
  EXPECT_EQ(right.aravis.resend_ratio, 0.5);
  EXPECT_EQ(right.aravis.packet_timeout_us, 5000);
  EXPECT_EQ(right.aravis.frame_retention_us, 50000);
  EXPECT_EQ(installation.action.rate_hz, 20);
  EXPECT_EQ(installation.action.command.address, "192.168.0.255");
  EXPECT_EQ(installation.action.command.keys.group_key, 0xFFFFFFFFu);
  EXPECT_TRUE(right.aravis.ptp);
  EXPECT_EQ(right.gamma, 1);
  EXPECT_EQ(left.gamma, 0) << "that of [fiducial]";
  const CameraConfig& side = installation.cameras[2];
  EXPECT_EQ(side.source, SourceKind::kNetwork);
  EXPECT_EQ(side.network.url, "rtsp://me:secret@10.0.0.7/live");
  EXPECT_EQ(side.network.transport, RtspTransport::kUdp);
  EXPECT_EQ(side.network.latency_ms, 50);
  EXPECT_EQ(side.network.width, 640);
  const CameraConfig& back = installation.cameras[3];
  EXPECT_EQ(back.source, SourceKind::kLibcamera);
  EXPECT_EQ(back.libcamera.id, "\\_SB_.PCI0-1:1.0-0bda:58f4");
  EXPECT_EQ(back.libcamera.rate_hz, 15);
  EXPECT_EQ(back.libcamera.height, 480);
  EXPECT_EQ(back.libcamera.buffers, 6);
  EXPECT_EQ(back.libcamera.controls.at("AeEnable"), LibcameraControlValue(int64_t{0}));
  EXPECT_EQ(back.libcamera.controls.at("AnalogueGain"), LibcameraControlValue(2.5));
  EXPECT_EQ(back.libcamera.controls.at("AfMode"), LibcameraControlValue("continuous"));
  EXPECT_TRUE(compare(installation, installation).none());
}

std::string example_text() {
  std::ifstream file(SIGHTLINE_SOURCE_DIR "/config/sightline.example.toml");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Installation, TheSmallestFileIsComplete) {
  const Installation installation = parsed(kBase);
  EXPECT_EQ(installation.name, "cell");
  EXPECT_EQ(installation.calibration, "dir/calibration.toml");
  ASSERT_EQ(installation.cameras.size(), 1u);
  const CameraConfig& camera = installation.cameras[0];
  EXPECT_EQ(camera.name, "left");
  EXPECT_EQ(camera.recording, "dir/rec");
  EXPECT_EQ(camera.recorded_as, "left");
  EXPECT_TRUE(camera.loop);
  EXPECT_TRUE(observes(camera.role) && streams(camera.role));
  EXPECT_EQ(camera.calibration.model.width(), 640);
  EXPECT_EQ(camera.place.text, "dir/cell.toml:2:1");
  EXPECT_EQ(camera.overlay.color, OverlayStyle{}.color);
  ASSERT_EQ(installation.objects.size(), 1u);
  EXPECT_EQ(installation.objects[0].description.name, "carton");
  EXPECT_TRUE(installation.rtsp.enabled);
  EXPECT_EQ(installation.rtsp.server.port, 8554);
  EXPECT_EQ(installation.http.server.port, 8080);
  EXPECT_EQ(installation.http.server.address, "127.0.0.1");
  EXPECT_FALSE(installation.record.enabled);
  EXPECT_TRUE(installation.encoder.prefer.empty());
}

TEST(Installation, TheExampleParses) {
  const Installation installation = parsed(example_text());
  ASSERT_EQ(installation.cameras.size(), 3u);
  EXPECT_EQ(installation.cameras[2].role, CameraRole::kStream);
  EXPECT_TRUE(installation.cameras[2].overlay.box3d);
  EXPECT_FALSE(installation.cameras[2].overlay.circle);
  EXPECT_EQ(installation.cameras[2].overlay.line_px, 3);
  EXPECT_TRUE(installation.cameras[0].overlay.circle);
  EXPECT_EQ(installation.rtsp.server.address, "127.0.0.1");
  EXPECT_EQ(installation.scene.meshes.size(), 1u);
}

// "# key = value", as opposed to prose.
bool is_commented_key(const std::string& line) {
  const size_t end = line.find(" = ");
  if (!line.starts_with("# ") || end == std::string::npos) return false;
  return line.find_first_not_of("abcdefghijklmnopqrstuvwxyz_", 2) == end;
}

// What the example calls a default is the default, and every key it shows exists.
TEST(Installation, TheExamplesCommentedKeysAreTheDefaults) {
  const std::string text = example_text();
  std::string all;
  std::istringstream lines(text);
  int uncommented = 0;
  for (std::string line; std::getline(lines, line);) {
    const bool names_a_file = line.find("_file") != std::string::npos ||
                              line.find("directory") != std::string::npos ||
                              line.starts_with("# tokens") || line.starts_with("# certificate") ||
                              line.starts_with("# key =");
    // Their defaults follow the rig.
    const bool is_a_place = line.starts_with("# eye") || line.starts_with("# target") ||
                            line.starts_with("# nearest_m") || line.starts_with("# farthest_m");
    if (!names_a_file && !is_a_place && is_commented_key(line)) {
      line = line.substr(2);
      ++uncommented;
    }
    all += line + "\n";
  }
  EXPECT_GT(uncommented, 25);
  const InstallationChanges changes = compare(parsed(text), parsed(all));
  EXPECT_TRUE(changes.none()) << changes.summary();
}

TEST(Installation, VirtualCameras) {
  const Installation installation = parsed(kBase + std::string(R"(
[[virtual_camera]]
name = "above"
width = 640
height = 360
rate = 10
eye = [0, -2, 3]
target = [0, 0, 0.5]
up = [0, 1, 0]
fov_deg = 60
grid_m = 0.25
[virtual_camera.overlay]
fill_opacity = 0.5
[[virtual_camera]]
name = "room"
)"));
  ASSERT_EQ(installation.virtual_cameras.size(), 2u);
  const VirtualCameraConfig& above = installation.virtual_cameras[0];
  EXPECT_EQ(above.view.model.width(), 640);
  EXPECT_EQ(above.rate_hz, 10);
  EXPECT_EQ(above.grid_m, 0.25);
  EXPECT_EQ(above.overlay.fill_opacity, 0.5f);
  EXPECT_TRUE(above.view.world_from_camera.translation.isApprox(Eigen::Vector3d(0, -2, 3)));
  EXPECT_EQ(installation.virtual_cameras[1].view.model.height(), 720);
  EXPECT_FALSE(installation.virtual_cameras[1].overlay.circle);
}

TEST(Installation, ThemesComeFirst) {
  const auto styled = [](const std::string& of_all, const std::string& of_view) {
    return parsed(kBase + ("[overlay]\n" + of_all) +
                  "[[virtual_camera]]\nname = \"room\"\n[virtual_camera.overlay]\n" + of_view);
  };
  const Installation minimal =
      styled("color = \"#010203\"\ntheme = \"minimal\"\n", "font_px = 30\n");
  const OverlayStyle& camera = minimal.cameras.at(0).overlay;
  EXPECT_FALSE(camera.fill || camera.circle || camera.label);
  EXPECT_TRUE(camera.outline);
  EXPECT_EQ(camera.color, (Rgb{1, 2, 3}));
  EXPECT_FALSE(minimal.virtual_cameras.at(0).overlay.label);
  EXPECT_EQ(minimal.virtual_cameras.at(0).overlay.font_px, 30);
  const OverlayStyle own =
      styled("color = \"#010203\"\n", "theme = \"high_contrast\"\n").virtual_cameras.at(0).overlay;
  EXPECT_EQ(own.color, theme_style("high_contrast")->color);
}

TEST(Installation, WhereAnObjectStarts) {
  const std::string base = kBase;
  const ObjectConfig nowhere = parsed(base).objects.at(0);
  EXPECT_FALSE(nowhere.start || nowhere.start_last);
  const ObjectConfig last = parsed(base + "start = \"last\"\n").objects.at(0);
  EXPECT_TRUE(last.start_last);
  EXPECT_FALSE(last.start);
  const ObjectConfig posed =
      parsed(base + "start = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]\n")
          .objects.at(0);
  ASSERT_TRUE(posed.start);
  EXPECT_EQ(posed.start->translation, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(posed, nowhere) << "nothing that runs has to start again";
}

TEST(Installation, EveryValueArrives) {
  const Installation installation = parsed(R"(
calibration = "/abs/c.toml"
name = "n"
[[camera]]
name = "right"
source = "replay:/r"
recorded_as = "left"
loop = false
rate = 12.5
role = "observe"
[camera.overlay]
styles = []
color = "#010203"
[scene]
meshes = ["a.obj", "b.ply"]
unit = "mm"
volume.min = [-1, -2, 0]
volume.max = [1, 2, 0.5]
[overlay]
styles = ["trail", "axes"]
hidden_color = "#FFEEDD"
fill = "textured"
shading = "smooth"
fill_opacity = 1
trail_seconds = 2.5
last_seen = true
depth_tolerance = 0.02
font_file = "f.ttf"
[rtsp]
enabled = false
port = 9000
[encoder]
bitrate_kbps = 2500
keyframe_interval = 15
prefer = ["vah264enc", "x264enc"]
[http]
address = "::"
open = true
names = ["rig.example"]
port = 81
[access]
tokens = "tokens"
certificate = "rig.pem"
key = "credential:rig.key"
[record]
enabled = true
directory = "out"
storage = "ffv1"
[fiducial]
search_scale = 1
min_side_px = 8
full_search_interval = 3
[estimator]
noise_linear = 5
noise_angular = 6.5
gate_probability = 0.99
one_camera_is_degraded = true
flat_print_is_degraded = false
[daemon]
log_level = "warning"
)");
  const CameraConfig& camera = installation.cameras.at(0);
  EXPECT_EQ(camera.recording, "/r");
  EXPECT_EQ(camera.recorded_as, "left");
  EXPECT_FALSE(camera.loop);
  EXPECT_EQ(camera.rate_hz, 12.5);
  EXPECT_EQ(camera.role, CameraRole::kObserve);
  EXPECT_FALSE(camera.overlay.trail || camera.overlay.axes || camera.overlay.outline);
  EXPECT_TRUE(camera.overlay.last_seen);
  EXPECT_EQ(camera.overlay.color, (Rgb{1, 2, 3}));
  EXPECT_EQ(camera.overlay.xray_color, (Rgb{255, 238, 221}));
  EXPECT_EQ(camera.overlay.fill_opacity, 1.0f);
  EXPECT_EQ(camera.overlay.fill_kind, FillKind::kTextured);
  EXPECT_EQ(camera.overlay.shading, Shading::kSmooth);
  EXPECT_EQ(camera.overlay.trail_seconds, 2.5);
  EXPECT_EQ(installation.calibration, "/abs/c.toml");
  EXPECT_EQ(installation.scene.meshes[1], "dir/b.ply");
  EXPECT_EQ(installation.scene.meters_per_unit, 0.001);
  EXPECT_EQ(installation.scene.volume, (Box3{{-1, -2, 0}, {1, 2, 0.5}}));
  EXPECT_EQ(installation.render.font_file, "dir/f.ttf");
  EXPECT_EQ(installation.render.depth_tolerance, 0.02);
  EXPECT_FALSE(installation.rtsp.enabled);
  EXPECT_EQ(installation.rtsp.server.port, 9000);
  EXPECT_EQ(installation.encoder.bitrate_kbps, 2500);
  EXPECT_EQ(installation.encoder.keyframe_interval, 15);
  EXPECT_EQ(installation.encoder.prefer, (std::vector<std::string>{"vah264enc", "x264enc"}));
  EXPECT_EQ(installation.http.server.address, "::");
  EXPECT_TRUE(installation.http.server.open);
  EXPECT_EQ(installation.http.server.names, std::vector<std::string>{"rig.example"});
  EXPECT_EQ(installation.http.server.tokens, "dir/tokens");
  EXPECT_EQ(installation.http.server.tls, (TlsFiles{"dir/rig.pem", "credential:rig.key", 9}));
  EXPECT_EQ(installation.rtsp.server.certificate, "dir/rig.pem");
  EXPECT_EQ(installation.rtsp.server.key, "credential:rig.key");
  EXPECT_EQ(installation.http.server.tokens_content, 7u);
  EXPECT_EQ(installation.rtsp.server.tokens, "dir/tokens");
  EXPECT_EQ(installation.http.server.port, 81);
  EXPECT_TRUE(installation.record.enabled);
  EXPECT_EQ(installation.record.raw_storage, RawStorage::kFfv1);
  EXPECT_EQ(installation.fiducial.search_scale, 1);
  EXPECT_EQ(installation.fiducial.min_side_px, 8);
  EXPECT_EQ(installation.fiducial.full_search_interval, 3);
  EXPECT_EQ(installation.estimator.noise.linear, 5);
  EXPECT_EQ(installation.estimator.noise.angular, 6.5);
  EXPECT_EQ(installation.estimator.gate_probability, 0.99);
  EXPECT_TRUE(installation.estimator.one_camera_is_degraded);
  EXPECT_FALSE(installation.estimator.flat_print_is_degraded);
  EXPECT_EQ(installation.daemon.log_level, log::Level::kWarning);
}

}  // namespace
}  // namespace sightline
