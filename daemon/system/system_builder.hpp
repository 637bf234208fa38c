// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "recording/recording_manager.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/source_factory.hpp"
#include "system/reload_plan.hpp"
#include "system/system.hpp"
#include "web/picture_board.hpp"
#include "web/pose_feed.hpp"
#include "web/whep_service.hpp"

namespace sightline {

/// A system that is all but running: everything that can fail has been made, nothing that runs has
/// been touched. Letting go of it undoes it.
struct SystemDraft {
  ReloadPlan plan;
  /// What stays, and what could be had beside the running system. Cameras to be started are null.
  System system;
  std::vector<CameraParts> cameras;  ///< to be started; without their outputs
  struct Stages {
    CameraId camera;
    std::unique_ptr<ObserveStage> observe;  ///< null: stays
    std::unique_ptr<DrawStage> draw;        ///< null: stays
  };
  std::vector<Stages> stages;             ///< of cameras that go on
  std::vector<VirtualCameraParts> views;  ///< to be started; without their outputs
  std::unique_ptr<ObjectSearch> search;   ///< null: nothing to search for
  std::optional<RecorderOptions> recorder;
};

/// What lives as long as the process, whatever system runs.
struct SystemContext {
  std::filesystem::path record_to;  ///< `sightline record`: into this folder
  Registry& registry;
  HeartbeatBoard& beats;
  SourceFactory& sources;
  std::shared_ptr<FrameTaps> taps;
  std::shared_ptr<PoseFeed> poses;
  std::shared_ptr<PictureBoard> pictures;
  std::shared_ptr<RecordingManager> recordings;
  std::shared_ptr<WhepService> whep;
  HttpContent http{};
  std::function<void(const CellOrder&)> on_order{};  ///< of an operator at another host
  std::function<void()> request_reload{};            ///< empty: this program does not reload
};

/// Makes a system for an installation beside the one that runs. Threads: any, one at a time.
class SystemBuilder {
 public:
  SystemBuilder(const SystemContext& context, const System& old) : context_(context), old_(old) {}
  /// Takes as long as meshes take to load; `stop` is asked between cameras.
  Result<SystemDraft> prepare(Installation next, std::stop_token stop);

 private:
  Status prepare_cameras(SystemDraft& draft, const std::stop_token& stop) const;
  Status prepare_servers(SystemDraft& draft) const;
  Result<CameraParts> camera_parts(const SystemDraft& draft, CameraId id) const;
  void add_source(CameraParts& parts, const CameraConfig& config, bool payload) const;
  Result<SystemDraft::Stages> camera_stages(const SystemDraft& draft, CameraId id) const;
  Result<ObserveStage> observe_stage(const System& next, CameraId id) const;
  Result<DrawStage> draw_stage(const System& next, CameraId id) const;
  Result<std::vector<VirtualCameraParts>> view_parts(const System& next) const;
  Result<RecorderOptions> recorder_options(const Installation& next) const;
  /// It does, or may be told to.
  bool records(const Installation& next) const {
    return !next.record.directory.empty() || !context_.record_to.empty();
  }

  const SystemContext& context_;
  const System& old_;
};

/// Who hears of the estimates that are shown here, wherever they are made: clients, recordings, the
/// log.
FusionWorker::OnEstimate feeds(const SystemContext& context, const Rig& rig);
/// Who hears of this host's estimates: the cell, and those above unless the cell decides.
FusionWorker::OnEstimate on_estimate(const SystemContext& context, const Installation& installation,
                                     const Rig& rig);
/// Where observations go: to this host's estimators, or to the cell's.
std::function<void(Observation)> to_fusion(const SystemContext& context, const System& system,
                                           LatencyHistogram* latency);

/// Of a camera's stream.
EncoderOptions encoder_options(const Installation& installation, const CameraConfig& camera);

}  // namespace sightline
