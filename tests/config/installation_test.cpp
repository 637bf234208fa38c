// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/installation.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "fake_files.hpp"

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
  EXPECT_EQ(left.gamma, 0) << "that of [observe]";
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
  EXPECT_EQ(camera.where, "dir/cell.toml:2:1");
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
  EXPECT_EQ(installation.rtsp.server.address, "0.0.0.0");
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
    const bool names_a_file =
        line.find("font_file") != std::string::npos || line.find("directory") != std::string::npos;
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

TEST(Installation, FreeViews) {
  const Installation installation = parsed(kBase + std::string(R"(
[[view]]
name = "above"
width = 640
height = 360
rate = 10
eye = [0, -2, 3]
target = [0, 0, 0.5]
up = [0, 1, 0]
fov_deg = 60
grid_m = 0.25
[view.overlay]
fill_opacity = 0.5
[[view]]
name = "room"
)"));
  ASSERT_EQ(installation.views.size(), 2u);
  const ViewConfig& above = installation.views[0];
  EXPECT_EQ(above.view.model.width(), 640);
  EXPECT_EQ(above.rate_hz, 10);
  EXPECT_EQ(above.grid_m, 0.25);
  EXPECT_EQ(above.overlay.fill_opacity, 0.5f);
  EXPECT_TRUE(above.view.world_from_camera.translation.isApprox(Eigen::Vector3d(0, -2, 3)));
  EXPECT_EQ(installation.views[1].view.model.height(), 720);
  EXPECT_FALSE(installation.views[1].overlay.circle);
}

TEST(Installation, ThemesComeFirst) {
  const auto styled = [](const std::string& of_all, const std::string& of_view) {
    return parsed(kBase + ("[overlay]\n" + of_all) + "[[view]]\nname = \"room\"\n[view.overlay]\n" +
                  of_view);
  };
  const Installation minimal =
      styled("color = \"#010203\"\ntheme = \"minimal\"\n", "font_px = 30\n");
  const OverlayStyle& camera = minimal.cameras.at(0).overlay;
  EXPECT_FALSE(camera.fill || camera.circle || camera.label);
  EXPECT_TRUE(camera.outline);
  EXPECT_EQ(camera.color, (Rgb{1, 2, 3}));
  EXPECT_FALSE(minimal.views.at(0).overlay.label);
  EXPECT_EQ(minimal.views.at(0).overlay.font_px, 30);
  const OverlayStyle own =
      styled("color = \"#010203\"\n", "theme = \"high_contrast\"\n").views.at(0).overlay;
  EXPECT_EQ(own.color, theme_style("high_contrast")->color);
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
allow_remote = true
port = 81
[record]
enabled = true
directory = "out"
storage = "ffv1"
[observe]
search_scale = 1
min_side_px = 8
full_search_interval = 3
[estimator]
noise_linear = 5
noise_angular = 6.5
gate_probability = 0.99
one_camera_is_degraded = true
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
  EXPECT_EQ(installation.render.font_file, "dir/f.ttf");
  EXPECT_EQ(installation.render.depth_tolerance, 0.02);
  EXPECT_FALSE(installation.rtsp.enabled);
  EXPECT_EQ(installation.rtsp.server.port, 9000);
  EXPECT_EQ(installation.encoder.bitrate_kbps, 2500);
  EXPECT_EQ(installation.encoder.keyframe_interval, 15);
  EXPECT_EQ(installation.encoder.prefer, (std::vector<std::string>{"vah264enc", "x264enc"}));
  EXPECT_EQ(installation.http.server.address, "::");
  EXPECT_EQ(installation.http.server.port, 81);
  EXPECT_TRUE(installation.record.enabled);
  EXPECT_EQ(installation.record.raw_storage, RawStorage::kFfv1);
  EXPECT_EQ(installation.observe.search_scale, 1);
  EXPECT_EQ(installation.observe.min_side_px, 8);
  EXPECT_EQ(installation.observe.full_search_interval, 3);
  EXPECT_EQ(installation.estimator.noise.linear, 5);
  EXPECT_EQ(installation.estimator.noise.angular, 6.5);
  EXPECT_EQ(installation.estimator.gate_probability, 0.99);
  EXPECT_TRUE(installation.estimator.one_camera_is_degraded);
  EXPECT_EQ(installation.daemon.log_level, log::Level::kWarning);
}

struct BadFile {
  const char* what;
  std::string text;
  const char* place;  // line:column
  const char* says;
};

std::string base_with(const std::string& more) { return kBase + more; }

const BadFile kBadFiles[] = {
    {"syntax", "calibration = \"c.toml\"\nname = \n", "2:8", "not valid TOML"},
    {"not UTF-8", "name = \"\xff\xfe\"\n", "1:8", "not valid TOML"},
    {"no calibration", "[[camera]]\nname = \"left\"\nsource = \"replay:r\"\n", "1:1",
     "the file needs \"calibration\""},
    {"no camera", "calibration = \"c.toml\"\n", "1:1", "the file needs \"camera\""},
    {"missing calibration file", "calibration = \"missing.toml\"\ncamera = []\n", "1:15",
     "dir/missing.toml: no such file"},
    {"unknown key", base_with("[rtsp]\nprot = 1\n"), "8:1", "did you mean \"port\"?"},
    {"unknown table", base_with("[rstp]\n"), "7:2", "did you mean \"rtsp\"?"},
    {"unknown key, nothing near", base_with("[daemon]\nzzzzzz = 1\n"), "8:1", "known: log_level"},
    {"unknown key of a camera",
     base_with("[[camera]]\nname = \"right\"\nsource = \"replay:r\"\n"
               "raet = 30\n"),
     "10:1", "unknown key \"raet\" in [[camera]]; did you mean \"rate\"?"},
    {"wrong type", base_with("[rtsp]\nenabled = \"yes\"\n"), "8:11",
     "expected true or false, found the text \"yes\""},
    {"unit in a text",
     base_with("[[camera]]\nname = \"right\"\nsource = \"replay:r\"\nrate = \"30fps\"\n"), "10:8",
     "expected a frame rate in Hz between 0.1 and 1000, found the text \"30fps\""},
    {"percent for share", base_with("[overlay]\nfill_opacity = 50\n"), "8:16",
     "a share (0 invisible, 1 opaque) between 0 and 1, found 50"},
    {"not a number", base_with("[overlay]\nfill_opacity = nan\n"), "8:16", "found nan"},
    {"port", base_with("[rtsp]\nport = 100000\n"), "8:8",
     "a port number between 1 and 65535, found 100000"},
    {"fraction for whole", base_with("[overlay]\nfont_px = 16.5\n"), "8:11",
     "a whole number of pixels between 8 and 64, found 16.5"},
    {"color", base_with("[overlay]\ncolor = \"red\"\n"), "8:9", "\"#rrggbb\", found \"red\""},
    {"style", base_with("[overlay]\nstyles = [\"fill\", \"outlin\"]\n"), "8:10",
     "did you mean \"outline\"?"},
    {"style with own key", base_with("[overlay]\nstyles = [\"last_seen\"]\n"), "8:10",
     "last_seen = true"},
    {"fill", base_with("[overlay]\nfill = \"texture\"\n"), "8:8", "did you mean \"textured\"?"},
    {"theme", base_with("[overlay]\ntheme = \"dark\"\n"), "8:9", "\"dark\" is no theme"},
    {"styles as text", base_with("[overlay]\nstyles = \"fill\"\n"), "8:10", "a list of texts"},
    {"choice", base_with("[daemon]\nlog_level = \"verbose\"\n"), "8:13",
     "known: debug, info, warning, error"},
    {"search scale", base_with("[observe]\nsearch_scale = 0.3\n"), "8:16",
     "expected one of 1 0.5 0.25, found 0.3"},
    {"actions without a rate", base_with("[action]\ngroup_key = 2\n"), "7:1", "[action] needs"},
    {"actions that nobody waits for", base_with("[action]\nrate = 2\n"), "8:8",
     "no camera waits for action commands"},
    {"later section", base_with("[publish]\nmqtt = true\n"), "7:1", "later release"},
    {"live source",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = "
     "\"webcam:0\"\n",
     "4:10", "known: replay:FOLDER"},
    {"password of an unknown source",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = "
     "\"rtps://me:secret@host\"\nlatency_ms = 5\n",
     "4:10", "this is no source"},
    {"network address",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"rtsp:///x\"\n", "4:10",
     "names no host"},
    {"empty device",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"aravis:\"\n", "4:10",
     "wants a camera"},
    {"key of another source",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"v4l2:a\"\nptp = true\n",
     "5:7", "ptp: is not for this kind of source"},
    {"loop of a live source",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"v4l2:a\"\nloop = true\n",
     "5:8", "loop: is not for"},
    {"live key of a recording",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"replay:r\"\ngain = 1\n",
     "5:8", "gain: is not for a recording"},
    {"unknown key of a live source",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"aravis:a\"\nexposur = 1\n",
     "5:1", "unknown key"},
    {"value of a control",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"v4l2:a\"\n"
     "controls = { gain = 1.5 }\n",
     "5:21", "a whole number, true, false or a text"},
    {"empty source",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = "
     "\"replay:\"\n",
     "4:10", "wants the folder"},
    {"no source", "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\n", "2:1",
     "[[camera]] needs \"source\""},
    {"no name", "calibration = \"c.toml\"\n[[camera]]\nsource = \"replay:r\"\n", "2:1",
     "[[camera]] needs \"name\""},
    {"missing recording",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = "
     "\"replay:missing\"\n",
     "4:10", "cannot play this recording"},
    {"recording without the camera",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"unrecorded\"\nsource = \"replay:r\"\n", "4:10",
     "the recording has no camera \"unrecorded\""},
    {"recorded_as without the camera",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"replay:r\"\nrecorded_as = "
     "\"rihgt\"\n",
     "5:15", "did you mean \"right\"?"},
    {"recording of another size",
     "calibration = \"c.toml\"\n[[camera]]\nname = \"left\"\nsource = \"replay:r\"\nrecorded_as = "
     "\"large\"\n",
     "4:10", "\"large\" is 1280x720, the calibration of \"left\" 640x480"},
    {"duplicate camera", base_with("[[camera]]\nname = \"left\"\nsource = \"replay:r\"\n"), "8:8",
     "there is a camera \"left\" already, in line 3"},
    {"camera name", base_with("[[camera]]\nname = \"a+b\"\nsource = \"replay:r\"\n"), "8:8",
     "letters, digits"},
    {"camera without calibration",
     base_with("[[camera]]\nname = \"lefd\"\nsource = \"replay:r\"\n"), "8:8",
     "no calibration in dir/calibration.toml; did you mean \"left\"?"},
    {"size differs",
     base_with("[[camera]]\nname = \"right\"\nsource = \"replay:r\"\n"
               "width = 1280\nheight = 480\n"),
     "10:9", "1280 differs from the calibration, which is for 640x480"},
    {"odd size streamed", base_with("[[camera]]\nname = \"odd\"\nsource = \"replay:r\"\n"), "8:8",
     "even width and height"},
    {"camera in single brackets", "calibration = \"c.toml\"\n[camera]\nname = \"left\"\n", "2:1",
     "double brackets"},
    {"section in double brackets", base_with("[[rtsp]]\nport = 1\n"), "7:1", "one table [rtsp]"},
    {"missing object file", base_with("[[object]]\nfile = \"missing.toml\"\n"), "8:8",
     "dir/missing.toml: no such file"},
    {"duplicate object", base_with("[[object]]\nfile = \"other/carton.toml\"\n"), "8:8",
     "an object \"carton\" already, in line 6"},
    {"object without file", base_with("[[object]]\n"), "7:1", "[[object]] needs \"file\""},
    {"missing scene", base_with("[scene]\nmeshes = [\"a.obj\",\n  \"missing.obj\"]\n"), "9:3",
     "there is no file dir/missing.obj"},
    {"scene unit", base_with("[scene]\nunit = \"feet\"\n"), "8:8",
     "\"m\", \"cm\", \"mm\" or \"in\""},
    {"view without name", base_with("[[view]]\nfov_deg = 40\n"), "7:1", "[[view]] needs \"name\""},
    {"view named like a camera", base_with("[[view]]\nname = \"left\"\n"), "8:8",
     "a camera or view \"left\" already, in line 3"},
    {"view from its target",
     base_with("[[view]]\nname = \"v\"\neye = [1, 2, 3]\ntarget = [1, 2, 3]\n"), "7:1",
     "at its target"},
    {"view of two numbers", base_with("[[view]]\nname = \"v\"\neye = [1, 2]\n"), "9:7", "3"},
    {"view of odd size", base_with("[[view]]\nname = \"v\"\nwidth = 641\n"), "7:1", "even"},
    {"view with a wrong key", base_with("[[view]]\nname = \"v\"\nfov = 30\n"), "9:1",
     "unknown key \"fov\" in [[view]]"},
    {"missing font", base_with("[overlay]\nfont_file = \"missing.ttf\"\n"), "8:13", "no file"},
    {"remote http", base_with("[http]\naddress = \"0.0.0.0\"\n"), "8:11", "allow_remote = true"},
    {"http address", base_with("[http]\naddress = \"localhost\"\n"), "8:11", "numeric address"},
    {"one port for two", base_with("[http]\nport = 8554\n"), "8:8", "used by [rtsp] and by [http]"},
    {"record without directory", base_with("[record]\nenabled = true\n"), "7:1",
     "needs \"directory\""},
    {"missing record directory", base_with("[record]\ndirectory = \"missing\"\n"), "8:13",
     "make it first"},
    {"auto among others", base_with("[encoder]\nprefer = [\"auto\", \"x264enc\"]\n"), "8:10",
     "stands alone"},
    {"encoder with a pipeline in it", base_with("[encoder]\nprefer = [\"x264enc ! fakesink\"]\n"),
     "8:10", "no name of a GStreamer element"},
    {"overlay of a camera",
     base_with("[[camera]]\nname = \"right\"\nsource = \"replay:r\"\n"
               "[camera.overlay]\nfont_file = \"x\"\n"),
     "11:1", "unknown key \"font_file\""},
    {"NUL in a path", "calibration = \"c\\u0000.toml\"\ncamera = []\n", "1:15", "a text in quotes"},
};

TEST(Installation, EveryMistakeHasItsPlaceAndSaysWhatToDo) {
  for (const BadFile& bad : kBadFiles) {
    const auto installation = parse(bad.text);
    ASSERT_FALSE(installation.has_value()) << bad.what;
    const Error& error = installation.error();
    EXPECT_EQ(error.where, std::string("dir/cell.toml:") + bad.place) << bad.what << "\n"
                                                                      << error.message();
    EXPECT_NE(error.text.find(bad.says), std::string::npos) << bad.what << "\n" << error.message();
    EXPECT_EQ(exit_code(error), 2) << bad.what;
  }
}

TEST(Installation, ReportsAllMistakesInTheOrderOfTheFile) {
  const auto installation = parse(R"(calibration = "c.toml"
[http]
prt = 1
[[camera]]
name = "left"
source = "replay:r"
rate = -1
width = 7
[rtsp]
port = "x"
)");
  ASSERT_FALSE(installation.has_value());
  const std::string all = installation.error().message();
  EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 3) << all;
  size_t at = 0;
  for (const char* place : {"dir/cell.toml:3:1: ", "\ndir/cell.toml:7:8: ", "\ndir/cell.toml:8:9: ",
                            "\ndir/cell.toml:10:8: "}) {
    const size_t next = all.find(place, at);
    ASSERT_NE(next, std::string::npos) << place << "\n" << all;
    at = next;
  }
}

TEST(Installation, AFloodOfMistakesIsCut) {
  std::string text = kBase;
  text += "[rtsp]\n";
  for (int i = 0; i < 1000; ++i) text += "key" + std::to_string(i) + " = 1\n";
  const auto installation = parse(text);
  ASSERT_FALSE(installation.has_value());
  EXPECT_NE(installation.error().text.find("and 950 more"), std::string::npos);
}

TEST(Installation, TooManyCameras) {
  std::string text = "calibration = \"c.toml\"\n";
  for (int i = 0; i < 65; ++i) text += "[[camera]]\nname = \"c" + std::to_string(i) + "\"\n";
  const auto installation = parse(text);
  ASSERT_FALSE(installation.has_value());
  EXPECT_NE(installation.error().text.find("65 cameras; at most 64"), std::string::npos);
}

TEST(Installation, AnOddSizeMayBeObserved) {
  const Installation installation = parsed(
      "calibration = \"c.toml\"\n[[camera]]\nname = \"odd\"\nsource = \"replay:r\"\n"
      "role = \"observe\"\n");
  EXPECT_FALSE(streams(installation.cameras[0].role));
}

}  // namespace
}  // namespace sightline
