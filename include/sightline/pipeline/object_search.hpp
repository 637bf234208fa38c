// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "sightline/observe/detect/color_verifier.hpp"
#include "sightline/observe/detect/detection_policy.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "sightline/observe/features/feature_detector.hpp"
#include "sightline/observe/scene/background_model.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/pipeline/search/found_views.hpp"
#include "sightline/pipeline/search/pose_proof.hpp"
#include "sightline/pipeline/search/print_check.hpp"

namespace sightline {

namespace pipeline {
class FoundFrames;
}

/// Searches for the objects whose pose is not known: says when a search is due and runs it on the
/// newest frames, with the backgrounds of the cameras. The same for replay, in step, and for the
/// daemon, on a thread of its own. One thread at a time.
class ObjectSearch {
 public:
  /// Null where there is nothing to search for: searching is off, no camera observes, or every
  /// object is found by its markers.
  static Result<std::unique_ptr<ObjectSearch>> create(const Installation& installation,
                                                      const Rig& rig);

  ~ObjectSearch();

  /// What it finds is offered there from now on, for those who track it.
  void offer_to(std::shared_ptr<FoundViews> views);
  /// True if a search for some object is due at `now` (see search()), or a check of one whose pose
  /// is known. Cheap.
  bool due(Time now, std::span<const PoseTrackPtr> tracks) const;
  /// Takes a frame of this camera; only the newest of each counts. Learns the background from it if
  /// that is due, and compares it with the background while an object is missing.
  void add_frame(CameraId camera, const Frame& frame, std::span<const PoseTrackPtr> tracks);
  /// False for a moment at the start, while cameras have given no frame yet that are about to: one
  /// alone of several would be believed too easily. After `kFirstFrames` two of them are enough,
  /// after `kAloneAfter` one is: the others are down.
  bool complete(Time now) const;
  /// Learns from a frame that is not searched; learns() says whether one of this time would be
  /// used. `known` objects are left out.
  bool learns(CameraId camera, Time capture) const;
  void learn(CameraId camera, const Frame& frame, std::span<const PoseTrackPtr> tracks);
  /// Searches for the object that has waited longest of those that are due: without a pose, or
  /// coasting for longer than `kBlindAfter`, not searched for within the interval (later, if it has
  /// not been found for 10 s: DetectConfig::max_load). One at a time, so that none is old news when
  /// the other is found. The observations are at the capture times of the frames, in order of time.
  ///
  /// If no search is due, or it is doubted, it checks the object whose check is due: whether the
  /// images show it where its track is, and rather in another orientation. Where checks in a row
  /// show the same other orientation clearly enough, that is returned; where two speak against the
  /// pose without naming another one, it is searched for everywhere, and returned if it is found
  /// elsewhere. Such observations refute the pose in force.
  std::vector<Observation> search(Time now, std::span<const PoseTrackPtr> tracks);
  /// The same poses in newer frames, one of a camera at most, which came while the search ran.
  /// Replaces what search() returned; empty if they are not found there. Then the next call goes on
  /// from where they were found last. Nothing is learned of the background: now is waiting.
  std::vector<Observation> follow(std::span<const FramePtr> frames,
                                  std::span<const PoseTrackPtr> tracks);

  /// Checks what search() has found, where follow() has found it last: in the same frames, so that
  /// nobody has to wait for others. Changes doubts() only; what that leaves doubted is checked as
  /// it is tracked. A tenth of a search.
  void check_found();

  /// Says where an object is, for the searches for it up to `until`; it is looked for there first,
  /// in kHintTries searches at most, and then everywhere. Takes the place of an earlier hint.
  /// False: it is not searched for. Any thread.
  bool hint(ObjectId object, const SearchHint& hint, Time until = Time::max());
  /// Drops the hint and what earlier searches have found of the object. Any thread.
  bool forget(ObjectId object);

  /// Checks so far, and poses that they have refuted.
  struct Checks {
    uint64_t done = 0, refuted = 0;
  };
  Checks checks() const { return checks_; }
  /// Whether the last check of an object spoke against its pose, but not clearly enough to refute
  /// it, or the object is nearly round and no check has been yet. By object.
  struct Doubt {
    ObjectId object;
    bool doubted = false;
  };
  std::vector<Doubt> doubts() const;
  /// Objects that have gone out of view since the last call: what comes back is doubted until its
  /// first check, as if it were new.
  std::vector<ObjectId> note_unseen(std::span<const PoseTrackPtr> tracks);
  /// What searching and following have done so far.
  SearchWork work() const;

  static constexpr Duration kBlindAfter = std::chrono::milliseconds(150);
  static constexpr int kHintTries = 20;
  static constexpr Duration kFirstFrames = std::chrono::milliseconds(100);
  static constexpr Duration kAloneAfter = std::chrono::seconds(1);

 private:
  struct Told {
    SearchHint hint;
    Time until{};
    int tries = 0;  ///< so far
  };
  /// An object that is searched for.
  struct Target {
    ObjectId object;
    DetectionPolicy policy;
    std::shared_ptr<const ViewpointModel> views;
    std::unique_ptr<ObjectDetector> detector = nullptr;
    std::unique_ptr<ColorVerifier> colors = nullptr;      ///< null: the mesh has none
    std::unique_ptr<FeatureDetector> features = nullptr;  ///< tried first; null: none were trained
    bool by_features = false;                             ///< `found` by those
    Time last{};
    bool searched = false;
    Detection found = {};
    std::optional<Told> told = {};
    bool printed = false;  ///< see RigObject
    AlikeObject alike = {};
    std::optional<DetectedPose> handed = {};  ///< last of those that were handed out
    Time handed_at{};                         ///< capture that it is of
    bool refutes = false;  ///< `found` is another orientation than that of the track
    PoseProof proof = {};
    PrintCheck print = {};
    Time checked{};        ///< last
    Time missing_since{};  ///< first of the searches in a row that have not found it
    Duration pause{0};     ///< from `last` to the next search
  };
  /// What other threads have said since the last search; no hint: forget.
  struct Message {
    ObjectId object;
    std::optional<Told> told;
  };
  ObjectSearch();
  Status add_target(const Installation& installation, const RigObject& object,
                    const std::vector<DetectorCamera>& cameras);
  bool due(const Target& target, Time now, std::span<const PoseTrackPtr> tracks) const;
  static bool missing(const Target& target, Time now, std::span<const PoseTrackPtr> tracks);
  bool tell(Message message);
  /// add_frame(), but for the background.
  void show(CameraId camera, const Frame& frame, std::span<const PoseTrackPtr> tracks);
  void take_messages();
  void search(Target& target, Time now, std::span<const PoseTrackPtr> tracks,
              std::vector<Observation>& out);
  /// Whether a search has found a target where its track has it. Elsewhere: it refutes that.
  static bool found_where_tracked(Target& target, std::span<const PoseTrackPtr> tracks);
  static bool doubted(const Target& target);
  bool check_due(const Target& target, Time now, std::span<const PoseTrackPtr> tracks) const;
  void check(Target& target, Time now, std::span<const PoseTrackPtr> tracks,
             std::vector<Observation>& out);
  /// What the check of a pose has found instead; nothing: nothing.
  Detection check_shape(Target& target, const PoseEstimate& pose, Time now,
                        std::span<const PoseTrackPtr> tracks);
  Detection check_print(Target& target, const Rigid3& pose);
  /// Whether a pose that does not stand out is found again about its place.
  static void search_about(Target& target, const PoseEstimate& pose,
                           const OrientationComparison& compared, Time now);
  /// Hands out what was found of a target.
  void hand_out(Target& target, std::vector<Observation>& out) const;
  static bool differs(const Target& target, const Rigid3& pose, const Detection& found);
  /// Tells the detector of a target where those are that look the same, also where one has just
  /// been found, and how many are missing.
  void set_others(Target& target, Time now, std::span<const PoseTrackPtr> tracks);
  /// Whether an object that looks the same, and was found before, is where this one is said to be.
  bool doubles(const Target& target, const Rigid3& pose, Time now,
               std::span<const PoseTrackPtr> tracks) const;
  /// Where else the second of two at one place is; nothing: nowhere.
  Detection look_for_double(Target& target, Time now);
  static bool look_alike(const Target& a, const Target& b);
  Detection look_where_told(Target& target, Time now);
  static Detection by_features(Target& target, PoseProposals proposals);
  Detection look_everywhere(Target& target);
  /// Until the next search for it, after one that did such work and found target.found.
  Duration pause_after(Target& target, Time now, const SearchWork& work) const;
  /// Objects whose place is known at a time; `coasting`: also those that are only
  /// predicted or not believed.
  void find_known(Time time, std::span<const PoseTrackPtr> tracks, bool coasting);

  Duration interval_{};
  double max_load_ = 1;
  std::vector<DetectorCamera> cameras_;
  std::unique_ptr<pipeline::FoundFrames> found_frames_;  ///< null: nobody is offered any
  std::vector<CameraId> delivered_;                      ///< cameras that have given a frame
  Time first_frame_{};
  SearchWork feature_work_;
  Checks checks_;
  std::vector<Target> targets_;
  std::vector<std::unique_ptr<BackgroundModel>> backgrounds_;  ///< by CameraId; null: none
  std::vector<KnownObject> known_;
  ForegroundMap foreground_;
  mutable std::mutex mutex_;  ///< guards messages_
  std::vector<Message> messages_;
};

}  // namespace sightline
