// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>

#include "system/system_builder.hpp"

namespace sightline {

/// Takes the metrics of cameras, virtual cameras and objects that only `gone` has.
void remove_metrics(Registry& registry, const Installation& gone, const Installation& stays);

/// Puts a prepared system in the place of the one that runs: devices, ports and streams go from the
/// old to the new. One thread at a time; readers see the old system until the new one is published.
class SystemExchange {
 public:
  SystemExchange(const SystemContext& context, const System& old, SystemDraft draft)
      : context_(context), old_(old), draft_(std::move(draft)), next_(draft_.system) {}

  /// What may still fail before anything stops: ports that have to be handed over. After an Error
  /// the old system runs as before, if old_is_whole().
  Status acquire();
  /// False if a port that was given up for the new system could not be had again.
  bool old_is_whole() const { return old_is_whole_; }
  /// An Error here is a broken promise of acquire() or of the machine (no more threads): neither
  /// system is whole then.
  Status switch_over();
  /// The new system, complete but for its points.
  const System& system() const { return next_; }
  /// After it is published: what only the old system used ends, metrics of what is gone go.
  void retire_old();
  /// Last: it takes a moment to make, and nobody waits for it.
  std::shared_ptr<PointsWorker> start_points();

 private:
  Status hand_over_http();
  Status hand_over_rtsp();
  Status resume_rtsp();
  Status move_streams();
  void stop_leaving();
  void keep_output(const std::shared_ptr<StreamOutput>& output, const std::string& name, bool ends);
  void exchange_stages();
  void rename_poses();
  Status start_cameras();
  void start_following();
  Status start_views();
  void start_search();
  void start_actions();
  void start_mqtt();
  void start_cell();
  void keep_last_poses();
  void watch_calibration();
  /// The stream that a worker of this name had, if its images are of the same size and rate.
  Result<std::shared_ptr<StreamOutput>> output_of(const std::string& name,
                                                  const EncoderOptions& options);
  Result<std::shared_ptr<RtspStream>> add_stream(const std::string& name,
                                                 const EncoderOptions& options);
  bool server_stays() const { return next_.rtsp == old_.rtsp; }

  const SystemContext& context_;
  const System& old_;
  SystemDraft draft_;
  System& next_;
  std::map<std::string, std::shared_ptr<StreamOutput>> outputs_;  // of workers that were stopped
  bool old_is_whole_ = true;
};

}  // namespace sightline
