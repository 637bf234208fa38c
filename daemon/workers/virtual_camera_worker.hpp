// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/image/image.hpp"
#include "sightline/pipeline/track_board.hpp"
#include "sightline/render/overlay/virtual_camera.hpp"
#include "workers/stream_output.hpp"

namespace sightline {

/// What a virtual camera's thread is made of.
struct VirtualCameraParts {
  CameraId id;  ///< after those of the cameras; nothing is measured with it
  std::string name;
  double rate_hz = 15;
  std::unique_ptr<VirtualCamera> view;
  std::shared_ptr<StreamOutput> output;
  std::shared_ptr<TrackBoard> board;
  std::function<std::vector<bool>()> present;  ///< per camera: has it a signal? Must not block
  std::function<ScenePointsPtr(Time)> points;  ///< reconstructed lately; empty or null: none
};

/// One virtual camera: the thread ("view:NAME") that draws it at its own rate while somebody looks.
class VirtualCameraWorker {
 public:
  static std::unique_ptr<VirtualCameraWorker> start(VirtualCameraParts parts, Registry& registry,
                                                    HeartbeatBoard& beats);
  ~VirtualCameraWorker() { stop(); }
  /// The output stays open: another worker may go on with it.
  void stop();

  const std::string& name() const { return parts_.name; }
  const std::shared_ptr<StreamOutput>& output() const { return parts_.output; }

 private:
  VirtualCameraWorker(VirtualCameraParts parts, Registry& registry);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void draw(Time now);

  VirtualCameraParts parts_;
  ImagePool images_;
  Gauge& draw_seconds_;
  std::vector<PoseTrackPtr> tracks_;
  AnnotatedImage annotated_;
  std::jthread thread_;
};

}  // namespace sightline
