// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibration/target_frames.hpp"
#include "cell/cell_worker.hpp"
#include "sightline/base/snapshot.hpp"
#include "workers/points_worker.hpp"
#include "workers/recorder_worker.hpp"
#include "workers/search_worker.hpp"

namespace sightline {

/// Who takes the frames and estimates of every camera beside its own threads; null: nobody. A
/// reload puts others in their place while cameras go on.
struct FrameTaps {
  Snapshot<RecorderWorker> recorder;
  Snapshot<SearchWorker> search;
  Snapshot<PointsWorker> points;
  Snapshot<const TargetFrames> targets;  ///< while views of a calibration target are captured
  Snapshot<CellWorker> cell;             ///< takes observations or estimates

  /// On a capture thread; never waits.
  void record(const FramePtr& frame) const {
    if (const auto to = recorder.read()) to->push(frame);
  }
  /// On the thread that frames come from, with what is known of their place; never waits.
  /// `observed`: the camera takes part in stereo points.
  void push(const FramePtr& frame, bool observed) const {
    if (const auto to = search.read()) to->push(frame);
    if (const auto to = targets.read()) to->push(frame);
    if (const auto to = observed ? points.read() : nullptr) to->push(frame);
  }
  ScenePointsPtr points_at(Time time) const {
    const auto from = points.read();
    return from ? from->points_at(time) : nullptr;
  }
};

}  // namespace sightline
