// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/recording.hpp"

#include <gmock/gmock.h>

#include <sstream>

#include "record/media.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::AllOf;
using testing::HasSubstr;

const std::string kHeader = "camera,sequence,capture_ns,arrival_ns,dropped_before\n";

/// A good recording, of which every test breaks one thing.
class BadRecording : public testing::Test {
 protected:
  void SetUp() override {
    write_small_recording(folder());
    ASSERT_TRUE(open_recording(folder(), RecordingMode::kStrict));
  }
  fs::path folder() const { return temp_ / "rec"; }
  fs::path file(const std::string& name) const { return folder() / name; }

  std::string refusal(RecordingMode mode = RecordingMode::kReplay) const {
    const auto opened = open_recording(folder(), mode);
    return opened ? "opened" : opened.error().message();
  }
  void cut(const std::string& name, double share) const {
    const auto size = static_cast<double>(fs::file_size(file(name)));
    fs::resize_file(file(name), static_cast<uintmax_t>(share * size));
  }

 private:
  TempFolder temp_;
};

TEST_F(BadRecording, IsGoodBefore) {
  const auto recording = open_recording(folder());
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->name, "rec");
  EXPECT_EQ(recording->frame_count(), 40u);
  EXPECT_TRUE(recording->warnings.empty());
  EXPECT_EQ(to_ns(recording->first_capture()), 1'000'000'000);
  EXPECT_EQ(to_ns(recording->last_capture()), 2'930'000'000);
  EXPECT_EQ(recording->cameras[0].frame_period(), std::chrono::milliseconds(100));
  EXPECT_FALSE(recording->start_utc.empty());
}

TEST_F(BadRecording, NoFolder) {
  const auto opened = open_recording(file("nothing"));
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kNotFound);
}

TEST_F(BadRecording, MissingVideo) {
  fs::remove(file("left.mkv"));
  EXPECT_THAT(refusal(), AllOf(HasSubstr("recording.toml:7"), HasSubstr("left.mkv")));
}

TEST_F(BadRecording, VideoIsSomethingElse) {
  write_text(file("left.mkv"), "this is not Matroska");
  EXPECT_THAT(refusal(), HasSubstr("left.mkv: cannot open this video"));
}

TEST_F(BadRecording, EmptyVideo) {
  write_text(file("left.mkv"), "");
  EXPECT_THAT(refusal(), HasSubstr("left.mkv"));
}

TEST_F(BadRecording, TruncatedVideo) {
  cut("right.mkv", 0.3);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("frames.csv:"), HasSubstr("camera right has 20 rows"),
                               HasSubstr("right.mkv ends after ")));
}

TEST_F(BadRecording, TruncatedTailIsCutOffInReplayAndRefusedInCheck) {
  cut("right.mkv", 0.8);
  const auto recording = open_recording(folder());
  ASSERT_TRUE(recording) << recording.error().message();
  EXPECT_EQ(recording->cameras[0].rows.size(), 20u);
  const size_t left = recording->cameras[1].rows.size();
  EXPECT_THAT(left, AllOf(testing::Ge(11u), testing::Lt(20u)));
  ASSERT_EQ(recording->warnings.size(), 1u);
  EXPECT_THAT(recording->warnings[0], HasSubstr("rows from here on are left out"));
  EXPECT_THAT(refusal(RecordingMode::kStrict),
              HasSubstr(fmt::format("right.mkv ends after {} images", left)));
}

TEST_F(BadRecording, MoreRowsThanFrames) {
  std::string csv = read_text(file("frames.csv"));
  for (int i = 20; i < 40; ++i) {
    csv += fmt::format("left,{},{},{},0\n", i, 1'000'000'000 + 100'000'000LL * i, 9'000'000'000);
  }
  write_text(file("frames.csv"), csv);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("frames.csv:42"), HasSubstr("camera left has 40 rows"),
                               HasSubstr("left.mkv ends after 20 images")));
}

TEST_F(BadRecording, MoreFramesThanRows) {
  const std::string csv = read_text(file("frames.csv"));
  write_text(file("frames.csv"), csv.substr(0, csv.find("left,5,")));
  EXPECT_THAT(refusal(), AllOf(HasSubstr("left.mkv: has 20 images"), HasSubstr("5 rows")));
}

TEST_F(BadRecording, AFewMoreFramesThanRowsAreLeftOutInReplay) {
  const std::string csv = read_text(file("frames.csv"));
  write_text(file("frames.csv"), csv.substr(0, csv.find("left,18,")));
  const auto recording = open_recording(folder());
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->cameras[0].rows.size(), 18u);
  EXPECT_EQ(recording->warnings.size(), 2u);
  EXPECT_THAT(refusal(RecordingMode::kStrict), HasSubstr("has 20 images"));
}

TEST_F(BadRecording, RowsUnsorted) {
  const std::string csv = read_text(file("frames.csv"));
  const size_t at = csv.find("left,3,"), end = csv.find("right,3,");
  write_text(file("frames.csv"), csv + csv.substr(at, end - at));
  EXPECT_THAT(refusal(), AllOf(HasSubstr("frames.csv:42"), HasSubstr("not sorted")));
}

TEST_F(BadRecording, RowTwice) {
  edit_text(file("frames.csv"), "left,4,", "left,3,");
  EXPECT_THAT(refusal(),
              AllOf(HasSubstr("frames.csv:10"), HasSubstr("sequence 3 twice, first in line 8")));
}

TEST_F(BadRecording, TimesRunBackwards) {
  edit_text(file("frames.csv"), "left,4,1400000000", "left,4,1200000000");
  EXPECT_THAT(refusal(), AllOf(HasSubstr("frames.csv:10"), HasSubstr("run backwards")));
}

TEST_F(BadRecording, UnknownCodec) {
  edit_text(file("recording.toml"), "rawvideo", "vp8");
  EXPECT_THAT(refusal(), AllOf(HasSubstr("recording.toml:10:"), HasSubstr("unknown codec 'vp8'")));
}

TEST_F(BadRecording, WrongCodec) {
  edit_text(file("recording.toml"), "rawvideo", "h264");
  EXPECT_THAT(refusal(), HasSubstr("holds rawvideo, recording.toml says h264"));
}

TEST_F(BadRecording, WrongSize) {
  edit_text(file("recording.toml"), "width = 64", "width = 80");
  EXPECT_THAT(refusal(), HasSubstr("images are 64 x 48, recording.toml says 80 x 48"));
}

TEST_F(BadRecording, MissingObjectOrScene) {
  edit_text(file("recording.toml"), "objects = []", "objects = [\"objects/cup.toml\"]");
  EXPECT_THAT(refusal(), HasSubstr("objects/cup.toml, which does not exist"));
  edit_text(file("recording.toml"), "objects = [\"objects/cup.toml\"]", "scene = \"table.obj\"");
  EXPECT_THAT(refusal(), HasSubstr("table.obj, which does not exist"));
}

TEST_F(BadRecording, NoRows) {
  fs::remove(file("frames.csv"));
  EXPECT_THAT(refusal(), HasSubstr("frames.csv"));
}

TEST_F(BadRecording, CameraThatNeverDelivered) {
  std::string left;
  std::istringstream lines(read_text(file("frames.csv")));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("right")) left += line + "\n";
  }
  write_text(file("frames.csv"), left);
  fs::remove(file("right.mkv"));
  const auto recording = open_recording(folder());
  ASSERT_TRUE(recording) << recording.error().message();
  EXPECT_TRUE(recording->cameras[1].rows.empty());
  EXPECT_THAT(recording->warnings.at(0), HasSubstr("camera right recorded nothing"));
  EXPECT_THAT(refusal(RecordingMode::kStrict), HasSubstr("does not exist"));
}

std::string manifest_refusal(const std::string& text) {
  const auto parsed = parse_recording_toml(text, "r.toml");
  return parsed ? "parsed" : parsed.error().message();
}

const std::string kHead = "format = 1\nname = \"x\"\n";
const std::string kCamera =
    "[[camera]]\nname = \"a\"\nfile = \"a.mkv\"\ncodec = \"h264\"\nwidth = 4\nheight = 4\n";

std::string camera_with(const std::string& from, const std::string& to) {
  std::string text = kHead + kCamera;
  return text.replace(text.find(from), from.size(), to);
}

TEST(RecordingToml, Refusals) {
  EXPECT_EQ(manifest_refusal(kHead + kCamera), "parsed");
  EXPECT_THAT(manifest_refusal("format = "), HasSubstr("r.toml:1:"));
  EXPECT_THAT(manifest_refusal(camera_with("format = 1", "format = 2")),
              HasSubstr("r.toml:1:10: format is 2"));
  EXPECT_THAT(manifest_refusal("format = 1\n" + kCamera), HasSubstr("'name' (text)"));
  EXPECT_THAT(manifest_refusal(kHead), HasSubstr("[[camera]]"));
  EXPECT_THAT(manifest_refusal(kHead + kCamera + kCamera), HasSubstr("second camera"));
  EXPECT_THAT(manifest_refusal(kHead + "objects = [\"../x.toml\"]\n" + kCamera),
              HasSubstr("r.toml:3:12: '../x.toml' is not a path inside"));
  EXPECT_THAT(manifest_refusal(kHead + "objects = 3\n" + kCamera), HasSubstr("r.toml:3:"));
  EXPECT_THAT(manifest_refusal(kHead + "scene = \"/etc/passwd\"\n" + kCamera),
              HasSubstr("not a path inside"));
  EXPECT_THAT(manifest_refusal(camera_with("\"a\"", "\"a,b\"")), HasSubstr("a,b"));
  EXPECT_THAT(manifest_refusal(camera_with("width = 4", "width = 4.5")),
              HasSubstr("r.toml:7:9: 'width'"));
  EXPECT_THAT(manifest_refusal(camera_with("width = 4", "width = 0")), HasSubstr("width is 0"));
  EXPECT_THAT(manifest_refusal(camera_with("codec = \"h264\"\n", "")), HasSubstr("'codec'"));
  EXPECT_THAT(manifest_refusal(camera_with("width = 4", "pixels = \"ABC\"\nwidth = 4")),
              HasSubstr("'pixels' is not a name"));
}

TEST(RecordingToml, ADeepHeaderIsRefused) {
  std::string text = "[a";
  for (int i = 0; i < 35000; ++i) text += ".a";
  const auto parsed = parse_recording_toml(text + "]\n", "recording.toml");
  ASSERT_FALSE(parsed);
  EXPECT_THAT(parsed.error().message(), HasSubstr("nested more than 32 levels"));
}

TEST(RecordingToml, UnknownKeysAreWarnings) {
  const auto parsed = parse_recording_toml(kHead + "color = 1\n" + kCamera, "r.toml");
  ASSERT_TRUE(parsed);
  ASSERT_EQ(parsed->warnings.size(), 1u);
  EXPECT_THAT(parsed->warnings[0], HasSubstr("r.toml:3:1: unknown key 'color'"));
}

auto parse(const std::string& text, std::vector<std::string>* warnings = nullptr) {
  const std::vector<std::string> cameras = {"a", "b"};
  return parse_frames_csv(text, "f.csv", cameras, warnings);
}

std::string csv_refusal(const std::string& rows) {
  const auto parsed = parse(kHeader + rows);
  return parsed ? "parsed" : parsed.error().message();
}

TEST(FramesCsv, Refusals) {
  EXPECT_EQ(csv_refusal("a,0,1,1,0\nb,0,1,1,0\na,1,2,2,0\n"), "parsed");
  EXPECT_EQ(csv_refusal("a,0,1,1,0\r\nb,0,1,1,0\r\n"), "parsed");
  EXPECT_THAT(parse("camera,sequence\n").error().message(), HasSubstr("f.csv:1"));
  EXPECT_FALSE(parse(""));
  EXPECT_THAT(csv_refusal("a,0,1,1\n"), HasSubstr("f.csv:2: 4 columns"));
  EXPECT_THAT(csv_refusal("a,0,1,1,0,7\n"), HasSubstr("6 columns"));
  EXPECT_THAT(csv_refusal("\na,0,1,1,0\n"), HasSubstr("f.csv:2: 1 columns"));
  EXPECT_THAT(csv_refusal("c,0,1,1,0\n"), HasSubstr("camera 'c' is not in recording.toml"));
  EXPECT_THAT(csv_refusal("a,0,nan,1,0\n"), HasSubstr("capture_ns is 'nan'"));
  EXPECT_THAT(csv_refusal("a,0,1e9,1,0\n"), HasSubstr("capture_ns is '1e9'"));
  EXPECT_THAT(csv_refusal("a,0,-1,1,0\n"), HasSubstr("capture_ns is '-1'"));
  EXPECT_THAT(csv_refusal("a,-1,1,1,0\n"), HasSubstr("sequence is '-1'"));
  EXPECT_THAT(csv_refusal("a,0,1,,0\n"), HasSubstr("arrival_ns is ''"));
  EXPECT_THAT(csv_refusal("a,0,1,1,4294967296\n"), HasSubstr("dropped_before"));
  EXPECT_THAT(csv_refusal("a,0,9223372036854775807,1,0\n"), HasSubstr("capture_ns"));
  EXPECT_THAT(csv_refusal("a,0,1,1,0\na,1,1,1,0\n"), HasSubstr("stand still"));
}

TEST(FramesCsv, CutOffLastLineIsDropped) {
  std::vector<std::string> warnings;
  const std::string whole = kHeader + "a,0,1,1,0\na,1,2,2,0\n";
  for (const std::string tail : {"a", "a,2", "a,2,3", "a,2,3,", "a,2,3,4,"}) {
    warnings.clear();
    const auto rows = parse(whole + tail, &warnings);
    ASSERT_TRUE(rows) << tail;
    EXPECT_EQ((*rows)[0].size(), 2u);
    EXPECT_EQ(warnings.size(), 1u);
  }
  EXPECT_EQ((*parse(whole + std::string(500, '\0')))[0].size(), 2u);
  EXPECT_EQ((*parse(whole + "a,2,3,3,0"))[0].size(), 3u);
}

TEST(FramesCsv, EarlyArrivalIsAWarning) {
  std::vector<std::string> warnings;
  ASSERT_TRUE(parse(kHeader + "a,0,5,4,0\n", &warnings));
  EXPECT_THAT(warnings.at(0), HasSubstr("f.csv:2: 1 rows arrive before"));
}

}  // namespace
}  // namespace sightline
