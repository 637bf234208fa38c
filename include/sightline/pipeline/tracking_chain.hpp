// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/object_fusion.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/room_watch.hpp"
#include "sightline/pipeline/timed_search.hpp"

namespace sightline {

/// From frames to tracks in one thread and on the frames' own clock, set by set: observe every
/// frame with the tracks known so far, search for what nobody sees, fuse. The daemon runs the same
/// parts on threads of their own. A set is made of all frames of one capture time.
class TrackingChain {
 public:
  /// Frames of `cameras` are observed. `search` may be null; `timing` says when its results enter.
  static Result<std::unique_ptr<TrackingChain>> create(const Installation& installation,
                                                       const Rig& rig,
                                                       std::span<const CameraId> cameras,
                                                       std::unique_ptr<ObjectSearch> search,
                                                       const SearchTiming& timing = {});

  /// Begins the set of frames that were captured at `now`. What a search has come to before that
  /// is fused.
  void begin(Time now);
  /// Appends what a frame says: one observation per object, without terms for those that nothing
  /// can measure. A frame of a camera that does not observe says nothing of any.
  void observe(const CameraFrame& seen);
  /// Begins a search where that is due and none is under way; false: it was not. If searches are
  /// instant, what is found in frames of this set replaces observations that saw nothing, what is
  /// found in earlier ones is fused at once.
  bool search(std::span<const CameraFrame> frames);
  /// ObjectSearch::hint(); false also where nothing is searched for.
  bool hint(ObjectId object, const SearchHint& hint) {
    return search_ && search_->hint(object, hint);
  }
  /// Ends the set: one report for each object, in order of ObjectId; valid until the next call.
  std::span<const UpdateReport> fuse();

  /// The observations of this set, for those who put in their own.
  std::vector<Observation>& set() { return set_; }
  const std::vector<PoseTrackPtr>& tracks() const { return fusion_->tracks(); }
  const ObjectFusion& fusion() const { return *fusion_; }
  /// fusion().has_verdict(), or one by what stands still around a camera, of this set.
  bool has_verdict() const { return room_verdict_ || fusion_->has_verdict(); }
  /// Null: the camera does not observe.
  CameraObserver* observer(CameraId camera) { return observers_.at(camera.index()).get(); }
  bool found() const { return found_; }  ///< the newest instant search found something
  /// What searches have been charged with.
  Duration search_time() const { return timed_ ? timed_->charged() : Duration(0); }
  std::unique_ptr<ObjectSearch> take_search();

 private:
  TrackingChain() = default;
  bool search_at_once(std::span<const CameraFrame> frames);
  void take_doubts();

  std::vector<NamedObject> objects_;
  std::vector<std::unique_ptr<CameraObserver>> observers_;  // by CameraId; null: does not observe
  std::unique_ptr<ObjectSearch> search_;                    // null: nothing to search for
  std::unique_ptr<TimedSearch> timed_;                      // of that; null: it takes no time
  std::vector<std::unique_ptr<RoomWatch>> rooms_;           // by CameraId; null: is not watched
  std::unique_ptr<ObjectFusion> fusion_;
  std::vector<Observation> set_;
  bool found_ = false, room_verdict_ = false;
};

}  // namespace sightline
