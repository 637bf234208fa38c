// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "calibration/capture_service.hpp"
#include "heartbeat.hpp"
#include "recording/recording_manager.hpp"
#include "sightline/control/http_content.hpp"
#include "system/config_report.hpp"
#include "system/system.hpp"
#include "web/picture_board.hpp"
#include "web/pose_feed.hpp"
#include "web/whep_service.hpp"

namespace sightline {

/// What the HTTP interface speaks about. The functions are called on its thread and do not wait.
struct WebSources {
  const Registry* registry = nullptr;  ///< outlives the server, as the rest
  std::function<Health()> health;
  std::function<std::shared_ptr<const System>()> system;  ///< never null
  std::function<std::shared_ptr<const ConfigReport>()> config;
  std::function<std::vector<ThreadWait>()> waits;
  std::function<void()> request_reload;  ///< empty: this program does not reload
  std::shared_ptr<PoseFeed> poses;
  std::shared_ptr<PictureBoard> pictures;
  std::shared_ptr<RecordingManager> recordings;
  std::shared_ptr<WhepService> whep;
  std::shared_ptr<CaptureService> captures;
  std::shared_ptr<HttpWaker> waker;
};

/// Everything that the HTTP interface answers with (docs/api.md).
HttpContent web_content(WebSources sources);

}  // namespace sightline
