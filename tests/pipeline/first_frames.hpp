// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/pipeline/rig.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline::test {

/// The first frames of recordings/bench, without the markers on its carton, which is searched for.
struct FirstFrames {
  Installation installation;
  Rig rig;
  std::vector<FramePtr> frames;
  Rigid3 truth;  ///< of the carton, world_from_object

  const ViewpointModel& model() const { return *rig.objects.front().views; }
};

inline FirstFrames first_frames_of_bench() {
  const std::filesystem::path bench =
      std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";
  FirstFrames out;
  out.installation = recording_installation(bench).value();
  out.installation.objects.front().description.modalities.fiducial = false;
  RigOptions options;
  options.cache.clear();
  out.rig = load_rig(out.installation, options).value();
  const auto recording = std::make_shared<const Recording>(open_recording(bench).value());
  out.frames = *VirtualReplay::open(recording).value()->next().value();
  out.truth = read_truth(bench / "truth.csv").value().front().world_from_object;
  return out;
}

}  // namespace sightline::test
