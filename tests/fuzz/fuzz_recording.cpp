// SPDX-License-Identifier: Apache-2.0
//
// The text files of a recording. The first byte chooses the reader, the rest is the file.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "sightline/record/axes_csv.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/merge.hpp"
#include "sightline/record/pose_log.hpp"
#include "sightline/record/recording.hpp"

using namespace sightline;

namespace {

void read_rows(std::string_view text) {
  const std::string cameras[] = {"left", "right", "side"};
  std::vector<std::string> warnings;
  const auto rows = parse_frames_csv(text, "frames.csv", cameras, &warnings);
  if (!rows) return;
  for (const auto& camera : *rows) {
    for (size_t i = 1; i < camera.size(); ++i) {
      SL_CHECK(camera[i].capture > camera[i - 1].capture, "capture times grow");
      SL_CHECK(camera[i].sequence > camera[i - 1].sequence, "sequences grow");
    }
  }
}

void read_log(std::string_view text) {
  const auto rows = parse_pose_log(text, "poses.csv");
  if (!rows) return;
  std::string again(kPoseLogHeader);
  again += '\n';
  std::vector<TruthRow> truth;
  for (const auto& row : *rows) {
    again += format_pose_row(row) + '\n';
    if (row.world_from_object) truth.push_back({row.time, row.object, *row.world_from_object});
  }
  const auto reread = parse_pose_log(again, "again");
  SL_CHECK(reread && reread->size() == rows->size(), "what was read can be written and read");
  (void)to_json(evaluate(truth, *rows));
}

void read_angles(std::string_view text) {
  const std::string cameras[] = {"left", "right", "side"};
  std::vector<std::string> warnings;
  const auto axes = parse_axes_csv(text, "axes.csv", cameras, &warnings);
  if (!axes) return;
  AxisHistory history(CameraAxes(), 500);
  for (const auto& readings : *axes) {
    for (size_t i = 0; i < readings.size(); ++i) {
      SL_CHECK(i == 0 || readings[i].stamp > readings[i - 1].stamp, "times grow");
      history.add(readings[i]);
      SL_CHECK(history.place(readings[i].stamp).covariance->allFinite(), "sigmas are numbers");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0]) {
    case 'f':
      read_rows(text);
      break;
    case 'a':
      read_angles(text);
      break;
    case 'p':
      read_log(text);
      break;
    case 't':
      (void)parse_truth(text, "truth.csv").has_value();
      break;
    default:
      if (const auto manifest = parse_recording_toml(text, "recording.toml")) {
        (void)parse_rfc3339(manifest->start_utc, "recording.toml").has_value();
      }
      (void)parse_rfc3339(text, "recording.toml").has_value();
  }
  return 0;
}
