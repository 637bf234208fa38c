// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibrate/capture/advice.hpp"
#include "calibrate/capture/camera_record.hpp"
#include "calibrate/capture/sight_window.hpp"

namespace sightline::calibrate {

/// What a guide knows, and its decisions.
struct GuideState {
  CaptureGuideOptions options;
  CalibrationViews views;
  std::vector<CameraRecord> records;
  std::vector<SightWindow> windows;
  std::vector<CameraProgress> progress;
  std::vector<CameraNeeds> needs;
  PairCounts pairs;
  size_t last_camera = 0;  ///< of which something was taken last
  std::optional<RigReport> report;
  size_t report_sets = 0;

  GuideState(const CalibrationTarget& target, const std::vector<ViewedCamera>& cameras,
             const std::vector<CameraPrior>& priors, const CaptureGuideOptions& chosen);

  /// What all cameras that see the target now saw of it, by camera; empty unless it is to be had.
  using Sets = std::vector<std::optional<SteadyView>>;
  CaptureStep find_set(const TargetSight& sight, Sets& set) const;
  CaptureStep find_still(Time now, Duration still, Sets& set, bool& brief) const;
  CaptureStep find_moment(const TargetSight& sight, Sets& set) const;
  Status check(const Sets& set) const;
  void take(const Sets& set);
  void note_seen(const std::vector<size_t>& seen_by);
  void update();
  /// That the next advice is for; past the last if none lacks anything.
  size_t next_camera() const;
  CaptureAdvice report_advice() const;
  const std::string& name(size_t camera) const { return views.cameras[camera].name; }
};

/// The camera's picture, with where `next` wants the target.
std::string coverage_svg(const GuideState& guide, size_t camera, const CaptureAdvice& next);
/// Of all cameras; `share` of what is needed.
std::string capture_page(const GuideState& guide, const CaptureAdvice& next, double share,
                         bool over);

}  // namespace sightline::calibrate
