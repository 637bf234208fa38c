// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/replay_library.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>

#include "sightline/pipeline/source_factory.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

// The first frame of a camera of the bundled recording.
FrameInfo first_frame(ReplayLibrary& library, const Installation& installation, size_t camera) {
  CameraConfig config = installation.cameras[camera];
  config.recording = SIGHTLINE_SOURCE_DIR "/recordings/bench";
  config.recorded_as = config.name;
  const auto id = CameraId(static_cast<uint32_t>(camera));
  const auto source = library.open(config, id, false).value();
  for (int i = 0; i < 50; ++i) {
    const SourceStep step = source->next({}, 200ms).value();
    if (step.kind == SourceStep::Kind::kFrame) return step.frame->info();
  }
  return {};
}

TEST(ReplayLibrary, CamerasOfOneRecordingAreInStepWhoeverOpensItFirst) {
  ReplayLibrary library;
  const Installation installation =
      recording_installation(SIGHTLINE_SOURCE_DIR "/recordings/bench").value();
  std::array<FrameInfo, 3> frames;
  {
    std::vector<std::jthread> threads;
    for (size_t i = 0; i < frames.size(); ++i) {
      threads.emplace_back([&, i] { frames[i] = first_frame(library, installation, i); });
    }
  }
  const FrameInfo late = first_frame(library, installation, 0);
  const auto start_of = [](const FrameInfo& info) {  // of the recording, by a frame of it
    return info.capture - info.sequence * Duration(33'333'333ns);
  };
  for (const FrameInfo& info : {frames[1], frames[2], late}) {
    const Duration apart = start_of(info) - start_of(frames[0]);
    EXPECT_LT(std::abs(to_seconds(apart)), 1e-3);
  }
}

// A camera whose calibration says so comes with its capture times shifted, live and replayed.
TEST(SourceFactory, TimeOffsetsAreInTheCaptureTimes) {
  Installation installation =
      recording_installation(SIGHTLINE_SOURCE_DIR "/recordings/bench").value();
  installation.cameras[1].calibration.time_offset_s = -0.03;
  Registry registry;
  SourceFactory factory(registry);
  std::array<FrameInfo, 2> infos;
  for (uint32_t c = 0; c < 2; ++c) {
    const auto open = factory.opener(installation.cameras[c], CameraId(c), false);
    const auto source = open({}).value();
    for (int i = 0; i < 50 && infos[c].width == 0; ++i) {
      const SourceStep step = source->next({}, 200ms).value();
      if (step.kind == SourceStep::Kind::kFrame) infos[c] = step.frame->info();
    }
  }
  EXPECT_EQ(infos[0].time_offset, 0ms);
  EXPECT_EQ(infos[1].time_offset, -30ms);
  const auto start_of = [](const FrameInfo& info) {
    return info.capture - info.sequence * Duration(33'333'333ns);
  };
  EXPECT_NEAR(to_seconds(start_of(infos[1]) - start_of(infos[0])), -0.03, 1e-3);

  const auto recording = open_recording(SIGHTLINE_SOURCE_DIR "/recordings/bench").value();
  EXPECT_EQ(time_offsets(recording, installation), (std::vector<Duration>{0ms, -30ms, 0ms}));
}

}  // namespace
}  // namespace sightline
