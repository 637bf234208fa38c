// SPDX-License-Identifier: Apache-2.0
#include "detect/set_search.hpp"

#include <algorithm>

#include "sightline/base/time.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/record/replay.hpp"

namespace sightline::cli {
namespace {

struct Tolerance {
  double distance, angle;  // [m], [rad]
  double depth;            // of the distance, where one camera looks alone
};
constexpr Tolerance kRight{0.03, 0.26, 0.06};
// Of what is not fitted yet, and leads there: the scan steps by 15 deg and a quarter of the
// distance.
constexpr Tolerance kLeadsThere{0.048, 0.42, 0.15};
constexpr Duration kMaxTruthGap = std::chrono::milliseconds(200);

// By how much a proposed pose may be off when the trackers look at it.
Matrix6 proposal_covariance() {
  Matrix6 covariance = Matrix6::Identity() * 0.02 * 0.02;
  covariance.diagonal().tail<3>().setConstant(0.004 * 0.004);
  return covariance;
}

std::vector<DetectorCamera> detector_cameras(const Installation& installation) {
  std::vector<DetectorCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    if (!observes(installation.cameras[i].role)) continue;
    cameras.push_back({CameraId(static_cast<uint32_t>(i)), installation.cameras[i].calibration});
  }
  return cameras;
}

// Searches the frames of one object, set by set.
class SetSearcher {
 public:
  static Result<std::unique_ptr<SetSearcher>> create(const Installation& installation,
                                                     std::vector<TruthRow> truth, bool key_frames,
                                                     bool foreign,
                                                     const SetSearchOptions& options) {
    std::unique_ptr<SetSearcher> made(new SetSearcher());
    made->installation_ = installation;
    made->cameras_ = detector_cameras(installation);
    made->truth_ = std::move(truth);
    made->max_gap_ = key_frames ? Duration(0) : kMaxTruthGap;
    made->foreign_ = foreign;
    made->moving_ = options.moving;
    made->explain_ = options.explain;
    SL_ASSIGN(made->rig_, load_rig(made->installation_));
    if (options.explain) SL_RETURN_IF_ERROR(made->prepare_explanation());
    return made;
  }

  SearchedObject object() const { return {shape().named.name, &installation_, &rig_}; }
  bool has_truth(Time time) const { return truth_at(truth_, time, max_gap_).has_value(); }

  Result<SetResult> search(const std::vector<FramePtr>& frames, Time now) {
    SL_ASSIGN(const auto search, ObjectSearch::create(installation_, rig_));
    if (!search) {
      return make_error(ErrorCode::kInvalidInput, installation_.file.string(),
                        "no camera looks for objects");
    }
    const auto add = [&](const FramePtr& frame) {
      if (frame) search->add_frame(frame->info().camera, *frame, {});
    };
    std::for_each(before_.begin(), before_.end(), add);
    std::for_each(frames.begin(), frames.end(), add);
    if (moving_) before_ = frames;
    SetResult out;
    out.time = now;
    const double cpu = process_cpu_ms();
    const Time start = MonotonicClock::now();
    const std::vector<Observation> found = search->search(now, {});
    out.wall_ms = 1e3 * to_seconds(MonotonicClock::now() - start);
    out.cpu_ms = process_cpu_ms() - cpu;
    if (!found.empty()) out.found = found.back().hypotheses;
    out.truth = truth_at(truth_, found.empty() ? now : found.back().capture, max_gap_);
    out.verdict = verdict(out);
    if (explain_) out.explanation = explain(frames);
    return out;
  }

 private:
  SetSearcher() = default;
  const RigObject& shape() const { return rig_.objects.front(); }

  bool right(const Rigid3& truth, const Rigid3& pose, const Tolerance& within = kRight) const {
    const Eigen::Vector3d center = truth * shape().views->center();
    Eigen::Vector3d error = pose * shape().views->center() - center;
    if (cameras_.size() == 1) {
      const Eigen::Vector3d ray =
          center - cameras_.front().calibration.world_from_camera.translation;
      const double depth = error.dot(ray) / ray.squaredNorm();
      if (std::abs(depth) < within.depth) error -= depth * ray;
    }
    if (error.norm() >= within.distance) return false;
    return shape().views->angle_up_to_symmetry(truth, pose) < within.angle;
  }

  Verdict verdict(const SetResult& result) const {
    if (result.found.empty()) return Verdict::kNothing;
    if (foreign_) return Verdict::kWrong;
    if (!result.truth) return Verdict::kNotComparable;
    const bool any = std::any_of(
        result.found.begin(), result.found.end(),
        [&](const PoseHypothesis& pose) { return right(*result.truth, pose.world_from_object); });
    if (!any) return Verdict::kWrong;
    return result.found.size() == 1 ? Verdict::kRight : Verdict::kAmong;
  }

  Status prepare_explanation() {
    if (shape().samples) {
      SL_ASSIGN(colors_, ColorVerifier::create(*shape().samples, cameras_));
    }
    for (const DetectorCamera& camera : cameras_) {
      SL_ASSIGN(auto observer, CameraObserver::create(installation_, rig_, camera.id));
      observers_.push_back(std::move(observer));
    }
    DetectorOptions options = installation_.detect.detector;
    options.volume = installation_.scene.volume;
    SL_ASSIGN(detector_, ObjectDetector::create(shape().named.id, shape().views, cameras_, options,
                                                run_in_parallel));
    return {};
  }

  Explanation explain(const std::vector<FramePtr>& frames) {
    Explanation out;
    out.trace.clock = process_cpu_ms;
    out.trace.moving = moving_;
    for (const FramePtr& frame : frames) {
      if (!frame) continue;
      detector_->add_frame(frame->info().camera, *frame);
      if (colors_) colors_->add_frame(frame->info().camera, *frame);
    }
    const double start = process_cpu_ms();
    detector_->explain(out.trace, colors_.get());
    for (auto& stage : out.trace.stages) stage.at_ms -= start;
    const auto truth = truth_at(truth_, out.trace.time, max_gap_);
    if (truth) {
      rank(*truth, out);
      out.at_truth = explained(*truth, out.trace.time, frames);
    }
    find_best(truth, out);
    if (out.best) out.at_best = explained(*out.best, out.trace.time, frames);
    return out;
  }

  void rank(const Rigid3& truth, Explanation& out) const {
    for (const auto& stage : out.trace.stages) {
      const auto& poses = stage.candidates;
      const auto first = std::find_if(poses.begin(), poses.end(), [&](const auto& pose) {
        return right(truth, pose.world_from_object, stage.fitted ? kRight : kLeadsThere);
      });
      out.ranks.emplace_back();
      if (first != poses.end()) out.ranks.back() = static_cast<size_t>(first - poses.begin());
    }
  }

  void find_best(const std::optional<Rigid3>& truth, Explanation& out) const {
    if (out.trace.stages.empty() || out.trace.stages.back().candidates.empty()) return;
    const auto& poses = out.trace.stages.back().candidates;
    const Rigid3& best = poses.front().world_from_object;
    const Eigen::Vector3d center = best * shape().views->center();
    const auto rival = std::find_if(poses.begin(), poses.end(), [&](const auto& pose) {
      return (pose.world_from_object * shape().views->center() - center).norm() >
             shape().views->radius();
    });
    out.best = best;
    out.best_score = poses.front().score;
    out.rival_score = rival == poses.end() ? 0 : rival->score;
    if (!truth) return;
    out.best_is_right = right(*truth, best);
    out.best_is_near_turn =
        !out.best_is_right &&
        std::ranges::any_of(shape().views->near_rotations(),
                            [&](const Rigid3& turn) { return right(*truth * turn, best); });
  }

  ExplainedPose explained(const Rigid3& pose, Time time, const std::vector<FramePtr>& frames) {
    ExplainedPose out;
    out.stages = detector_->assess(pose);
    if (colors_) out.colors = colors_->correlation(pose, Vector6::Zero(), time);
    const auto cameras = detector_cameras(installation_);
    for (size_t i = 0; i < cameras.size(); ++i) {
      const size_t camera = cameras[i].id.index();
      if (!frames[camera]) continue;
      ObjectTracker& tracker = observers_[i]->tracker();
      tracker.propose(*frames[camera], shape().named.id, pose, proposal_covariance());
      const ObjectTracker::TrackResult& result = tracker.last_result(0);
      out.trackers.push_back({installation_.cameras[camera].name, result.lines_used,
                              result.lines_total, result.edges_used, result.points_used,
                              result.seen});
    }
    return out;
  }

  Installation installation_;
  std::vector<DetectorCamera> cameras_;
  Rig rig_;
  std::vector<TruthRow> truth_;
  Duration max_gap_{};
  bool foreign_ = false, moving_ = false, explain_ = false;
  std::vector<FramePtr> before_;              // searched before, if what moves is looked for
  std::unique_ptr<ObjectDetector> detector_;  // this and what follows: to explain
  std::unique_ptr<ColorVerifier> colors_;     // null: the mesh has none
  std::vector<std::unique_ptr<CameraObserver>> observers_;
};

Status use_cameras(const SetSearchOptions& options, Installation& installation) {
  for (const std::string& name : options.cameras) {
    const bool known = std::any_of(installation.cameras.begin(), installation.cameras.end(),
                                   [&](const CameraConfig& camera) { return camera.name == name; });
    if (known) continue;
    return make_error(ErrorCode::kInvalidInput, options.recording.string(),
                      "there is no camera \"{}\"", name);
  }
  for (CameraConfig& camera : installation.cameras) {
    const auto& names = options.cameras;
    const bool takes_part =
        names.empty() || std::find(names.begin(), names.end(), camera.name) != names.end();
    if (!takes_part) camera.role = CameraRole::kStream;
  }
  return {};
}

// What is looked for: the recording's objects, or the one that is not there.
Result<std::vector<ObjectConfig>> wanted_objects(const SetSearchOptions& options,
                                                 const Installation& installation) {
  std::vector<ObjectConfig> objects = installation.objects;
  if (!options.object.empty()) {
    std::erase_if(objects, [&](const ObjectConfig& object) {
      return object.description.name != options.object;
    });
  }
  if (objects.empty()) {
    return make_error(ErrorCode::kInvalidInput, options.recording.string(),
                      "there is no object \"{}\"", options.object);
  }
  if (!options.object_file.empty()) {
    objects.resize(1);
    SL_ASSIGN(objects.front().description, read_object_file(options.object_file));
  }
  for (ObjectConfig& object : objects) object.description.modalities = {false, true, true, true};
  return objects;
}

// Empty where the recording has no truth.
Result<std::vector<TruthRow>> truth_of(const std::filesystem::path& file,
                                       const std::string& object) {
  if (!std::filesystem::exists(file)) return std::vector<TruthRow>();
  SL_ASSIGN(std::vector<TruthRow> rows, read_truth(file));
  std::erase_if(rows, [&](const TruthRow& row) { return row.object != object; });
  std::stable_sort(rows.begin(), rows.end(),
                   [](const TruthRow& a, const TruthRow& b) { return a.time < b.time; });
  return rows;
}

Status play(const SetSearchOptions& options, const std::shared_ptr<const Recording>& recording,
            SetSearcher& searcher, bool needs_truth, size_t every, const OnSet& on_set) {
  const Installation& installation = *searcher.object().installation;
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, time_offsets(*recording, installation),
                                             axis_histories(*recording, installation)));
  std::vector<FramePtr> newest(recording->cameras.size());
  for (size_t judged = 0, done = 0; done < options.limit;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) return {};
    for (const FramePtr& frame : *frames) newest[frame->info().camera.index()] = frame;
    const Time now = frames->front()->info().capture;
    const bool complete =
        std::all_of(newest.begin(), newest.end(), [](const FramePtr& frame) { return !!frame; });
    if (!complete || (needs_truth && !searcher.has_truth(now)) || judged++ % every != 0) continue;
    SL_ASSIGN(const SetResult result, searcher.search(newest, now));
    on_set(searcher.object(), result, newest);
    ++done;
  }
  return {};
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNothing:
      return "nothing";
    case Verdict::kRight:
      return "right";
    case Verdict::kAmong:
      return "right among hypotheses";
    case Verdict::kWrong:
      return "WRONG";
    case Verdict::kNotComparable:
      return "found";
  }
  return "?";
}

Status search_sets(const SetSearchOptions& options, const OnSet& on_set) {
  SL_ASSIGN(Recording opened, open_recording(options.recording));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, recording_installation(options.recording));
  SL_RETURN_IF_ERROR(use_cameras(options, installation));
  SL_ASSIGN(const std::vector<ObjectConfig> objects, wanted_objects(options, installation));
  installation.detect.silhouettes = false;
  const bool foreign = !options.object_file.empty();
  const auto key_frames = options.recording / "keyframes.csv";
  const bool sparse = std::filesystem::exists(key_frames);
  for (const ObjectConfig& object : objects) {
    installation.objects = {object};
    SL_ASSIGN(std::vector<TruthRow> truth,
              truth_of(sparse ? key_frames : options.recording / "truth.csv",
                       foreign ? "" : object.description.name));
    const bool has_truth = !truth.empty();
    SL_ASSIGN(auto searcher,
              SetSearcher::create(installation, std::move(truth), sparse, foreign, options));
    SL_RETURN_IF_ERROR(play(options, recording, *searcher, has_truth,
                            sparse && has_truth ? 1 : options.every, on_set));
  }
  return {};
}

}  // namespace sightline::cli
