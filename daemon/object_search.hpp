// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "rig.hpp"
#include "sightline/observe/background_model.hpp"
#include "sightline/observe/feature_detector.hpp"
#include "sightline/observe/object_detector.hpp"
#include "sightline/observe/surface_look.hpp"

namespace sightline {

/// Looks for the objects that nobody knows the place of: says when a search is due and runs it. The
/// same for replay, in step, and for the daemon, on a thread of its own. One thread at a time.
class ObjectSearch {
 public:
  /// Null where there is nothing to search for: searching is off, no camera observes, or every
  /// object is found by its markers. Loads or makes the viewpoint models.
  static Result<std::unique_ptr<ObjectSearch>> create(const Installation& installation,
                                                      const Rig& rig,
                                                      const std::filesystem::path& cache);

  /// True if some object wants to be searched for at `now` (see search()). Cheap.
  bool due(Time now, std::span<const PoseTrackPtr> tracks) const;
  /// Takes a frame of this camera; only the newest of each counts. Learns the background from it if
  /// that is due, and compares it with the background while an object is wanted.
  void add_frame(CameraId camera, const Frame& frame, std::span<const PoseTrackPtr> tracks);
  /// Learns from a frame that is not searched; learns() says whether one of this time would be
  /// used. `known` objects are left out.
  bool learns(CameraId camera, Time capture) const;
  void learn(CameraId camera, const Frame& frame, std::span<const PoseTrackPtr> tracks);
  /// Searches for every object that is due: one without a pose, or coasting for longer than
  /// `kBlindAfter`, not searched for within the interval. The observations are at the capture times
  /// of the frames, in order of time.
  std::vector<Observation> search(Time now, std::span<const PoseTrackPtr> tracks);
  /// The same poses in newer frames, which may have come while the search ran. Replaces what
  /// search() returned; empty if they are not there any more.
  std::vector<Observation> follow();

  static constexpr Duration kBlindAfter = std::chrono::milliseconds(150);

 private:
  struct Wanted {
    ObjectId object;
    std::shared_ptr<const ViewpointModel> views;
    std::unique_ptr<ObjectDetector> detector;
    std::unique_ptr<SurfaceLook> look;          ///< null: the mesh has no colours
    std::unique_ptr<FeatureDetector> features;  ///< tried first; null: none were taught
    bool by_print = false;                      ///< `found` by those
    Lookalikes lookalikes;
    Time last{};
    bool searched = false;
    Detection found;
  };
  ObjectSearch() = default;
  bool due(const Wanted& wanted, Time now, std::span<const PoseTrackPtr> tracks) const;
  static bool missing(const Wanted& wanted, Time now, std::span<const PoseTrackPtr> tracks);
  /// Objects whose place is known at a time; `coasting`: also those that are only predicted.
  void find_known(Time time, std::span<const PoseTrackPtr> tracks, bool coasting);
  static Detection found_by_print(Wanted& wanted, const Proposals& proposals);

  Duration interval_{};
  double accept_ = 0;
  std::vector<Wanted> wanted_;
  std::vector<std::unique_ptr<BackgroundModel>> backgrounds_;  ///< by CameraId; null: none
  std::vector<KnownObject> known_;
  ForegroundMap foreground_;
};

}  // namespace sightline
