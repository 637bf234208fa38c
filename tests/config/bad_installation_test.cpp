// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/installation.hpp"

#include <gtest/gtest.h>

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
     "a port number between 0 and 65535, found 100000"},
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
    {"search scale", base_with("[fiducial]\nsearch_scale = 0.3\n"), "8:16",
     "expected one of 1 0.5 0.25, found 0.3"},
    {"actions without a rate", base_with("[action]\ngroup_key = 2\n"), "7:1", "[action] needs"},
    {"actions that nobody waits for", base_with("[action]\nrate = 2\n"), "8:8",
     "no camera waits for action commands"},
    {"broker with a wildcard", base_with("[publish.mqtt]\nhost = \"a\"\ntopic = \"a/#\"\n"), "9:9",
     "without +"},
    {"host without a cell",
     base_with("[[camera]]\nname = \"right\"\nsource = \"replay:r\"\nhost = \"a\"\n"), "10:8",
     "has a meaning with [cell] broker only"},
    {"role of a host", base_with("[cell]\nrole = \"fuse\"\n"), "8:8", "fusion"},
    {"role without a broker", base_with("[cell]\nrole = \"cameras\"\n"), "8:8",
     "say where their broker is"},
    {"cell with a wildcard", base_with("[cell]\nname = \"a/#\"\n"), "8:8", "without +"},
    {"neighbors without a broker", base_with("[cell]\nneighbors = [\"b\"]\n"), "8:13",
     "say where the broker is"},
    {"a neighbor that is itself",
     base_with("[cell]\nbroker = \"b\"\nname = \"a\"\nneighbors = [\"a\"]\n"), "10:13",
     "is this cell"},
    {"a neighbor with the same topics",
     base_with("[cell]\nbroker = \"b\"\nname = \"a/b\"\nneighbors = [\"a\"]\n"), "10:13",
     "shares topics with \"a/b\""},
    {"a neighbor that is a pattern", base_with("[cell]\nbroker = \"b\"\nneighbors = [\"#\"]\n"),
     "9:13", "without +"},
    {"local estimates beside the cell's", base_with("[cell]\nbroker = \"b\"\nlocal = true\n"),
     "9:9", "keep the estimates anyway"},
    {"a camera of a cell without a host",
     base_with("[[camera]]\nname = \"right\"\nsource = \"replay:r\"\ncell = \"b\"\n"), "10:8",
     "with host only"},
    {"a camera of an unknown cell",
     base_with("[[camera]]\nname = \"right\"\nhost = \"h\"\ncell = \"site/c\"\n[cell]\nbroker = "
               "\"b\"\nneighbors = [\"site/b\"]\n"),
     "10:8", "not among the neighbors"},
    {"certificate without a key", base_with("[cell]\ncertificate = \"c.pem\"\n"), "8:15",
     "certificate and key"},
    {"unknown kind", base_with("[record]\nkinds = [\"view\"]\n"), "8:9", "viewing"},
    {"kind twice", base_with("[record]\nkinds = [\"poses\", \"poses\"]\n"), "8:9", "twice"},
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
     "needs a camera"},
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
     "4:10", "needs the folder"},
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
    {"start in words", base_with("start = \"there\"\n"), "7:9", "neither \"last\" nor a pose"},
    {"start of one row", base_with("start = [[1, 0, 0, 0]]\n"), "7:9", "a pose: 4 rows of 4"},
    {"start that is no rigid transform",
     base_with("start = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"), "7:9",
     "start: "},
    {"object without file", base_with("[[object]]\n"), "7:1", "[[object]] needs \"file\""},
    {"missing scene", base_with("[scene]\nmeshes = [\"a.obj\",\n  \"missing.obj\"]\n"), "9:3",
     "there is no file dir/missing.obj"},
    {"scene unit", base_with("[scene]\nunit = \"feet\"\n"), "8:8",
     "\"m\", \"cm\", \"mm\" or \"in\""},
    {"half a volume", base_with("[scene]\nvolume.min = [0, 0, 0]\n"), "8:1", "needs \"max\""},
    {"volume turned inside out",
     base_with("[scene]\nvolume.min = [0, 0, 0]\nvolume.max = [1, 1, -1]\n"), "9:14",
     "must be above min"},
    {"view without name", base_with("[[virtual_camera]]\nfov_deg = 40\n"), "7:1",
     "[[virtual_camera]] needs \"name\""},
    {"view named like a camera", base_with("[[virtual_camera]]\nname = \"left\"\n"), "8:8",
     "a camera or virtual camera \"left\" already, in line 3"},
    {"view from its target",
     base_with("[[virtual_camera]]\nname = \"v\"\neye = [1, 2, 3]\ntarget = [1, 2, 3]\n"), "7:1",
     "at its target"},
    {"view of two numbers", base_with("[[virtual_camera]]\nname = \"v\"\neye = [1, 2]\n"), "9:7",
     "3"},
    {"view of odd size", base_with("[[virtual_camera]]\nname = \"v\"\nwidth = 641\n"), "7:1",
     "even"},
    {"view with a wrong key", base_with("[[virtual_camera]]\nname = \"v\"\nfov = 30\n"), "9:1",
     "unknown key \"fov\" in [[virtual_camera]]"},
    {"missing font", base_with("[overlay]\nfont_file = \"missing.ttf\"\n"), "8:13", "no file"},
    {"remote http", base_with("[http]\naddress = \"0.0.0.0\"\n"), "8:11", "open = true"},
    {"tokens in the clear",
     base_with("[access]\ntokens = \"tokens\"\n[http]\naddress = \"0.0.0.0\"\n"), "10:11",
     "certificate"},
    {"remote rtsp", base_with("[rtsp]\naddress = \"0.0.0.0\"\n"), "8:11", "open = true"},
    {"certificate alone", base_with("[access]\ncertificate = \"rig.pem\"\n"), "8:15",
     "certificate and key, or neither"},
    {"missing certificate", base_with("[access]\ncertificate = \"missing\"\nkey = \"rig.key\"\n"),
     "8:15", "cannot use certificate and key"},
    {"missing tokens", base_with("[access]\ntokens = \"missing\"\n"), "8:10",
     "cannot use these tokens"},
    {"host name", base_with("[http]\nnames = [\"a b\"]\n"), "8:9", "no host name"},
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

TEST(BadInstallation, EveryMistakeHasItsPlaceAndSaysWhatToDo) {
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

TEST(BadInstallation, ReportsAllMistakesInTheOrderOfTheFile) {
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

TEST(BadInstallation, AFloodOfMistakesIsCut) {
  std::string text = kBase;
  text += "[rtsp]\n";
  for (int i = 0; i < 1000; ++i) text += "key" + std::to_string(i) + " = 1\n";
  const auto installation = parse(text);
  ASSERT_FALSE(installation.has_value());
  EXPECT_NE(installation.error().text.find("and 950 more"), std::string::npos);
}

TEST(BadInstallation, TooManyCameras) {
  std::string text = "calibration = \"c.toml\"\n";
  for (int i = 0; i < 65; ++i) text += "[[camera]]\nname = \"c" + std::to_string(i) + "\"\n";
  const auto installation = parse(text);
  ASSERT_FALSE(installation.has_value());
  EXPECT_NE(installation.error().text.find("65 cameras; at most 64"), std::string::npos);
}

TEST(BadInstallation, AnOddSizeMayBeObserved) {
  const Installation installation = parsed(
      "calibration = \"c.toml\"\n[[camera]]\nname = \"odd\"\nsource = \"replay:r\"\n"
      "role = \"observe\"\n");
  EXPECT_FALSE(streams(installation.cameras[0].role));
}

}  // namespace
}  // namespace sightline
