// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/image/picture.hpp"
#include "sightline/render/free_view.hpp"
#include "stream_output.hpp"
#include "track_board.hpp"

namespace sightline {

/// What a free view's thread is made of.
struct ViewParts {
  CameraId id;  ///< after those of the cameras; nothing is measured with it
  std::string name;
  double rate_hz = 15;
  std::unique_ptr<FreeView> view;
  std::shared_ptr<StreamOutput> output;
  std::shared_ptr<TrackBoard> board;
  std::function<std::vector<bool>()> present;  ///< per camera: has it a signal? Must not block
  std::function<ScenePointsPtr(Time)> points;  ///< reconstructed lately; empty or null: none
};

/// One free view: the thread ("view:NAME") that draws it at its own rate while somebody looks.
class ViewUnit {
 public:
  static std::unique_ptr<ViewUnit> start(ViewParts parts, Registry& registry,
                                         HeartbeatBoard& beats);
  ~ViewUnit() { stop(); }
  void stop();

  const std::string& name() const { return parts_.name; }
  const std::shared_ptr<StreamOutput>& output() const { return parts_.output; }

 private:
  ViewUnit(ViewParts parts, Registry& registry);
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void draw(Time now);

  ViewParts parts_;
  PicturePool pictures_;
  Gauge& draw_seconds_;
  std::vector<PoseTrackPtr> tracks_;
  AnnotatedPicture annotated_;
  std::jthread thread_;
};

}  // namespace sightline
