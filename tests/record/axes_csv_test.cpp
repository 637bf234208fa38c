// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/axes_csv.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <numbers>

#include "record/media.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/replay.hpp"
#include "sightline/record/writer.hpp"

namespace sightline {
namespace {

using namespace test;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const std::vector<std::string> kCameras = {"left", "head"};
const std::string kHead = "camera,t_ns,pan_deg,tilt_deg,zoom,moving\n";

auto parse(const std::string& rows, std::vector<std::string>* warnings = nullptr) {
  return parse_axes_csv(kHead + rows, "axes.csv", kCameras, warnings);
}

TEST(AxesCsv, ReadsAndWritesTheSame) {
  const AxisReading reading{time_from_ns(1'234'567'890), -0.5, 0.25, 1234, true};
  const auto back = parse(format_axes_row("head", reading) + "\n");
  ASSERT_TRUE(back.has_value());
  EXPECT_THAT((*back)[0], IsEmpty());
  ASSERT_THAT((*back)[1], SizeIs(1));
  EXPECT_EQ((*back)[1][0].stamp, reading.stamp);
  EXPECT_NEAR((*back)[1][0].pan, reading.pan, 1e-8);
  EXPECT_NEAR((*back)[1][0].tilt, reading.tilt, 1e-8);
  EXPECT_EQ((*back)[1][0].zoom, 1234);
  EXPECT_TRUE((*back)[1][0].moving);
}

TEST(AxesCsv, RefusesWithTheLine) {
  const std::string good = "head,1000,1,2,0,1\n";
  const auto fault = [&](const std::string& row) {
    const auto rows = parse(good + row);
    return rows ? std::string("read") : rows.error().message();
  };
  EXPECT_THAT(fault("side,2000,1,2,0,1\n"), HasSubstr("axes.csv:3"));
  EXPECT_THAT(fault("side,2000,1,2,0,1\n"), HasSubstr("not in recording.toml"));
  EXPECT_THAT(fault("head,1000,1,2,0,1\n"), HasSubstr("run backwards or stand still"));
  EXPECT_THAT(fault("head,2000,1,2,0\n"), HasSubstr("axes.csv:3"));
  EXPECT_THAT(fault("head,2000,x,2,0,1\n"), HasSubstr("pan_deg"));
  EXPECT_THAT(fault("head,2000,nan,2,0,1\n"), HasSubstr("pan_deg"));
  EXPECT_THAT(fault("head,2000,1,99999,0,1\n"), HasSubstr("tilt_deg"));
  EXPECT_THAT(fault("head,2000,1,2,inf,1\n"), HasSubstr("zoom"));
  EXPECT_THAT(fault("head,2000,1,2,0,2\n"), HasSubstr("moving"));
  EXPECT_THAT(fault("head,-5,1,2,0,1\n"), HasSubstr("t_ns"));
  EXPECT_FALSE(parse_axes_csv("camera,t_ns,pan,tilt\n", "axes.csv", kCameras, nullptr));
  std::vector<std::string> warnings;
  const auto cut = parse(good + "head,20", &warnings);
  ASSERT_TRUE(cut.has_value());
  EXPECT_THAT((*cut)[1], SizeIs(1));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("stops inside this line")));
}

FramePtr frame_at(uint64_t sequence, Time capture, CameraPlacePtr place) {
  FrameInfo info;
  info.camera = CameraId(0);
  info.sequence = sequence;
  info.capture = capture;
  info.arrival = capture + 5ms;
  info.width = info.height = 64;
  return Frame::with_place(Frame::decoded(info, std::make_shared<Image>(64, 64)), std::move(place));
}

// Recorded, opened and played again: the frames say the same of where the camera stood.
TEST(AxesCsv, ReadingsOfFramesAreRecordedOnceAndReplayed) {
  const TempFolder temp;
  CameraAxes axes;
  axes.latency_s = 0.02;
  AxisHistory live(axes, 500);
  RecordingWriterOptions options;
  options.cameras = {{"head", PixelFormat::kI420, 64, 64}};
  auto writer = RecordingWriter::create(temp / "r", options);
  ASSERT_TRUE(writer.has_value());
  std::vector<CameraPlacePtr> places;
  int64_t ms = 1000;
  const auto angle = [](int64_t t) { return 1e-3 * static_cast<double>(t - 1000); };
  for (uint64_t i = 0; i < 20; ++i) {
    const Time capture = time_from_ns(1'000'000 * (1100 + 33 * static_cast<int64_t>(i)));
    for (; ms <= 1105 + 33 * static_cast<int64_t>(i); ms += 10) {
      live.add({time_from_ns(ms * 1'000'000), angle(ms), -0.5 * angle(ms), 0, true});
    }
    places.push_back(live.place_at(capture));
    // Every third is lost on its way: its readings come with the next one.
    if (i % 3 == 2) continue;
    ASSERT_TRUE((*writer)->append(*frame_at(i, capture, places.back())).has_value());
  }
  ASSERT_TRUE((*writer)->close().has_value());
  auto recording = open_recording(temp / "r");
  ASSERT_TRUE(recording.has_value()) << recording.error().message();
  EXPECT_THAT(recording->cameras[0].axes, SizeIs((ms - 1000) / 10));
  const auto history = std::make_shared<AxisHistory>(axes, 500);
  auto replay = VirtualReplay::open(std::make_shared<const Recording>(*std::move(recording)), {},
                                    {}, {history})
                    .value();
  size_t seen = 0;
  while (const auto set = replay->next().value()) {
    const FrameInfo& info = set->front()->info();
    ASSERT_TRUE(info.place);
    const CameraPlace& before = *places[info.sequence];
    EXPECT_EQ(info.place->state, before.state) << info.sequence;
    EXPECT_LT(rotation_angle(info.place->world_from_camera, before.world_from_camera), 1e-7);
    EXPECT_LT((*info.place->covariance - *before.covariance).norm(), 1e-9);
    ++seen;
  }
  EXPECT_EQ(seen, 14u);
  EXPECT_EQ(places.back()->state, AxesState::kKnown);
}

TEST(AxesCsv, CameraWithoutReadingsHasNoVote) {
  const TempFolder temp;
  RecordingWriterOptions options;
  options.cameras = {{"head", PixelFormat::kI420, 64, 64}};
  auto writer = RecordingWriter::create(temp / "r", options);
  ASSERT_TRUE(writer.has_value());
  ASSERT_TRUE((*writer)->append(*frame_at(0, time_from_ns(1'000'000'000), nullptr)).has_value());
  ASSERT_TRUE((*writer)->close().has_value());
  EXPECT_FALSE(std::filesystem::exists(temp / "r" / "axes.csv"));
  auto recording = std::make_shared<const Recording>(open_recording(temp / "r").value());
  auto replay =
      VirtualReplay::open(recording, {}, {}, {std::make_shared<AxisHistory>(CameraAxes(), 500)})
          .value();
  const auto set = replay->next().value();
  ASSERT_TRUE(set && set->front()->info().place);
  EXPECT_FALSE(set->front()->info().place->trusted());
}

}  // namespace
}  // namespace sightline
