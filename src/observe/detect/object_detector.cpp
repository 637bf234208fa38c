// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/detect/object_detector.hpp"

#include <algorithm>
#include <optional>

#include "observe/detect/check_options.hpp"
#include "observe/detect/colors/contour_colors.hpp"
#include "observe/detect/colors/mesh_colors.hpp"
#include "observe/detect/contour_search.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/judge/assess_pose.hpp"
#include "observe/detect/judge/compare_orientations.hpp"
#include "observe/detect/judge/contour_belief.hpp"
#include "observe/detect/judge/detection_judge.hpp"
#include "observe/detect/judge/log_search.hpp"
#include "observe/detect/judge/measure_twists.hpp"
#include "observe/detect/judge/second_to_best.hpp"
#include "observe/detect/judge/taken_places.hpp"
#include "observe/detect/plan/search_distances.hpp"
#include "observe/detect/plan/search_order.hpp"
#include "observe/detect/pose_fit.hpp"
#include "observe/detect/pose_scan.hpp"
#include "observe/detect/pose_verification.hpp"
#include "observe/detect/silhouette_search.hpp"
#include "observe/detect/template_bank.hpp"

namespace sightline {

using namespace observe;

class ObjectDetector::Impl {
  using Where = DetectorFrames::Where;

 public:
  Impl(ObjectId object, std::shared_ptr<const ViewpointModel> views,
       std::vector<DetectorCamera> cameras, std::vector<SearchSize> sizes,
       const DetectorOptions& options, const Executor& executor)
      : options_(options),
        executor_(executor),
        bank_(std::move(views)),
        silhouettes_(bank_),
        distances_(search_distances(cameras, model().radius(), options)),
        frames_(std::move(cameras), options, executor, std::move(sizes)),
        scan_(bank_, distances_, options.scan_hits, executor),
        verification_(bank_, silhouettes_, executor),
        fitter_(model(), executor),
        contours_(bank_, silhouettes_, fitter_, executor),
        judge_(object, options, model().center(), model().radius()),
        belief_(model(), judge_),
        order_(model().center(), model().radius()) {
    frames_.show_at_its_size(distances_, fitter_.width());
  }

  void add_frame(CameraId camera, const Frame& frame, const ForegroundMap* foreground) {
    frames_.add(camera, frame, foreground);
    newest_ = std::max(newest_, frame.info().capture);
    forget_told();
  }

  void prepare(const ColorVerifier& colors) { color_templates_.emplace(bank_, colors.samples()); }

  void set_others(std::vector<KnownObject> known, size_t alike) {
    taken_.set(std::move(known));
    judge_.expect(alike);
  }

  Detection detect_at(const SearchHint& hint) {
    Detection out;
    forget_told();
    hint_ = hint;
    // Of many poses at a place in an image some fit: those elsewhere have to be known, too.
    const auto* pose = std::get_if<Rigid3>(&hint);
    if (pose == nullptr || !frames_.select(Where::kEverywhere)) return out;
    frames_.compute_responses(distances_.map_margin, DetectorFrames::Edges::kAll);
    out.time = frames_.newest();
    const auto cameras = frames_.silhouette_cameras(distances_);
    for (const Rigid3& moved : verification_.follow(frames_, cameras, *pose)) {
      told_.push_back({moved, Vector6::Zero()});
    }
    std::vector<JudgedPose> judged;
    fit_and_judge(told_, judged);
    add_rotated(judged);
    judge_.decide(frames_, judged, out);
    return out;
  }

  Detection detect(const ColorVerifier* colors) {
    Detection out;
    const Where where = order_.next(frames_, belief_.waiting(), hint_.has_value());
    if (!frames_.select(where)) return out;
    frames_.compute_responses(distances_.map_margin, DetectorFrames::Edges::kBorders);
    const size_t scanned = scan_.next_camera(frames_, where);
    out.time = frames_.info(scanned).capture;
    frames_.set_reference(out.time);
    std::vector<JudgedPose> judged;
    if (where == Where::kForeground) {
      const auto cameras = frames_.silhouette_cameras(distances_);
      std::vector<RigMotion> starts;
      for (const Rigid3& pose : verification_.by_silhouettes(frames_, cameras)) {
        starts.push_back({pose, Vector6::Zero()});
      }
      fit_and_judge(starts, judged);
    }
    // Silhouettes have been tried from all sides: where one is beyond doubt, edges add nothing.
    const bool clear = std::any_of(judged.begin(), judged.end(), [&](const JudgedPose& pose) {
      return judge_.clear(pose, frames_.size());
    });
    std::vector<ContourPose> contours;
    if (!clear) {
      const auto mesh_colors = colors_of(colors);
      contours = search_contours(scan_.scan(frames_, scanned, where, mesh_colors.get()),
                                 mesh_colors.get());
      for (const ContourPose& pose : contours) {
        judged.push_back(judge_.judge(fitter_.with_contrast(frames_.fit_cameras(), pose.fit)));
      }
    }
    add_rotated(judged);
    judge_.decide(frames_, judged, out);
    if (colors != nullptr) weigh_by_colors(*colors, out.time, kLeastColors, contours);
    const Detection by_contour =
        belief_.believe(frames_, contours, where, out.time, colors,
                        [&](const Detection& found) { return as_told(found); });
    if (out.poses.empty() || belief_.contradicts(out, frames_, contours, colors)) {
      out = by_contour;
    } else {
      out.by_contour = same_place(out, by_contour);
      if (out.by_contour) out.contour_score = by_contour.contour_score;
    }
    order_.note(where, !out.poses.empty(), belief_.waiting() != nullptr);
    log_search({judge_.object(), "searched", where}, model(), contours, out, belief_.waiting());
    looks_again_ = true;  // what is found here may yet be refused by its colors or its track
    forget_told();
    return out;
  }

  void forget() {
    belief_.clear();
    looks_again_ = false;
  }

  bool waits() const {
    const Detection* found = looks_again_ ? belief_.promising() : nullptr;
    return found != nullptr && newest_ > found->time &&
           to_seconds(newest_ - found->time) <= kMaxSecondsBetweenWeak;
  }

  Detection look_again(const ColorVerifier* colors) {
    Detection out;
    if (!waits()) return out;
    looks_again_ = false;
    const Detection before = *belief_.promising();
    const Where where = order_.next(frames_, &before, false);
    const Eigen::Vector3d center = before.poses.front().world_from_object * model().center();
    const auto contours = contours_about(center, before.time, where, colors, out.time);
    out = belief_.believe_again(frames_, contours, where, out.time, colors);
    if (!out.poses.empty()) order_.note(where, true, false);
    log_search({judge_.object(), "looked again", where}, model(), contours, out, belief_.waiting());
    forget_told();
    return out;
  }

  PlaceSearch search_about(const RigMotion& motion, Time time, const ColorVerifier* colors) {
    PlaceSearch out;
    Time at{};
    const Eigen::Vector3d center = motion.world_from_object * model().center();
    const auto contours = contours_about(center, time, Where::kEverywhere, colors, at);
    if (contours.empty()) return out;
    const Rigid3 moved = Rigid3::exp(motion.twist * to_seconds(at - time));
    out.rank = contours.front().rank;
    out.second = second_to_best(model(), contours);
    out.same = is_same(model(), contours.front(), motion.world_from_object * moved);
    return out;
  }

  void explain(DetectionTrace& trace, const ColorVerifier* colors) {
    const bool moving = trace.moving && frames_.show_motion();
    const Where where = moving ? Where::kMotion : Where::kEverywhere;
    if (!frames_.select(where)) return;
    frames_.compute_responses(distances_.map_margin, DetectorFrames::Edges::kBorders);
    const size_t scanned = scan_.next_camera(frames_, where);
    trace.time = frames_.info(scanned).capture;
    frames_.set_reference(trace.time);
    const auto mesh_colors = colors_of(colors);
    const ScanResult hits = scan_.scan(frames_, scanned, where, mesh_colors.get());
    trace.stages.push_back({"scan", scan_.poses(frames_, hits), trace.clock ? trace.clock() : 0});
    std::vector<ContourPose> poses = contours_.search(
        frames_, verification_.by_edges(frames_, hits), mesh_colors.get(), &trace, kMaxPool);
    sort_by_rank(poses);
    if (colors != nullptr) weigh_by_colors(*colors, trace.time, kLeastColors, poses);
    if (!poses.empty()) belief_.explain(poses, colors, trace);
  }

  PoseAssessment assess(const Rigid3& world_from_object) const {
    return assess_pose(bank_, frames_, fitter_, contours_, judge_, world_from_object);
  }

  Detection judge(const PoseProposals& proposals) {
    Detection out;
    if (proposals.poses.empty() || !frames_.select(Where::kEverywhere)) return out;
    out.time = proposals.time;
    frames_.set_reference(out.time);
    std::vector<JudgedPose> judged;
    for (const ProposedPose& pose : proposals.poses) {
      if (!possible(pose.world_from_object)) continue;
      const RigMotion motion{pose.world_from_object, pose.twist};
      judged.push_back(judge_.judge(fitter_.evaluate(frames_.fit_cameras(), motion), &pose));
    }
    add_rotated(judged);
    judge_.decide(frames_, judged, out);
    return out;
  }

  Detection follow(const Detection& earlier) {
    Detection out;
    if (earlier.poses.empty() || !frames_.select(Where::kEverywhere)) return out;
    frames_.compute_responses(distances_.map_margin, DetectorFrames::Edges::kAll);
    out.time = frames_.newest();
    const auto cameras = frames_.silhouette_cameras(distances_);
    std::vector<JudgedPose> judged;
    std::vector<RigMotion> starts;
    // By contours other orientations are tried at every step, so that few are worth following.
    const size_t poses = earlier.by_contour ? kMaxFollowedByContour : earlier.poses.size();
    const size_t shares = earlier.by_contour ? kContourFollowShares : kFollowShares.size();
    for (size_t i = 0; i < std::min(poses, earlier.poses.size()); ++i) {
      const DetectedPose& pose = earlier.poses[i];
      for (size_t k = 0; k < (pose.twist.isZero() ? 1 : shares); ++k) {
        const double seconds = kFollowShares[k] * to_seconds(out.time - earlier.time);
        const Rigid3 start = pose.world_from_object * Rigid3::exp(pose.twist * seconds);
        for (const Rigid3& moved : verification_.follow(frames_, cameras, start)) {
          starts.push_back({moved, pose.twist});
        }
      }
    }
    frames_.magnify_about(starts, model());
    // Edges cost less; where they do not tell, contours do: what edges had found has to score more.
    fit_and_judge(starts, judged);
    judge_.decide(frames_, judged, out);
    if (out.poses.empty()) {
      const double enough = earlier.by_contour ? kMinFollowedContour : kMinContourScore;
      judge_.decide_by_contour(frames_, contours_.fit(frames_, starts), enough, kMaxContourRival,
                               out);
    }
    out.by_contour = earlier.by_contour;
    out.contour_score = earlier.contour_score;
    measure_twists(earlier, out);
    return out;
  }

  OrientationComparison compare_orientations(const RigMotion& motion, Time time,
                                             const ColorVerifier* colors) {
    if (!frames_.select(Where::kEverywhere)) return {};
    frames_.set_reference(time);
    return observe::compare_orientations({model(), frames_, fitter_, contours_, judge_}, motion,
                                         time, colors);
  }

  SearchWork work() const {
    SearchWork sum = bank_.work().sum();
    sum += fitter_.work().sum();
    sum += frames_.work();
    return sum;
  }

 private:
  const ViewpointModel& model() const { return bank_.model(); }

  void fit_and_judge(std::span<const RigMotion> starts, std::vector<JudgedPose>& judged) const {
    for (PoseFit& fit : fitter_.fit(frames_.fit_cameras(), starts, kSearchReach,
                                    {.moved = true, .rest = kRestOfSearch})) {
      if (!possible(fit.motion.world_from_object)) continue;
      judged.push_back(judge_.judge(std::move(fit)));
    }
  }

  // Of the mesh, in the frames that are searched; null: it has none.
  std::unique_ptr<const MeshColors> colors_of(const ColorVerifier* colors) {
    if (colors == nullptr) return nullptr;
    if (!color_templates_) prepare(*colors);
    std::vector<const HalfSizeImage*> images;
    for (size_t i = 0; i < frames_.size(); ++i) images.push_back(&frames_.image(i));
    return std::make_unique<const MeshColors>(bank_, *color_templates_, frames_.search_cameras(),
                                              images, executor_);
  }

  // By contours, best first: of what is about the place that was the object's middle at `time`, in
  // the newest image of the next camera, `at` that time. `at` untouched: none shows it.
  std::vector<ContourPose> contours_about(const Eigen::Vector3d& center, Time time, Where where,
                                          const ColorVerifier* colors, Time& at) {
    if (!frames_.select(where)) return {};
    frames_.compute_responses(distances_.map_margin, DetectorFrames::Edges::kBorders);
    const auto place = scan_.next_place(frames_, where, center, time);
    if (!place) return {};
    at = frames_.info(place->camera).capture;
    frames_.set_reference(at);
    const auto mesh_colors = colors_of(colors);
    std::vector<ContourPose> contours =
        search_contours(scan_.scan_about(frames_, *place), mesh_colors.get(), kPoolOfPlace);
    if (colors != nullptr) weigh_by_colors(*colors, at, kLeastColors, contours);
    return contours;
  }

  double center_distance(const Rigid3& a, const Rigid3& b) const {
    return (a * model().center() - b * model().center()).norm();
  }

  // It is in the volume in which the object can be, and nothing else is there.
  bool possible(const Rigid3& pose) const {
    return (!options_.volume || options_.volume->contains(pose * model().center())) &&
           !taken_.take(model(), pose, frames_.search_cameras());
  }

  void forget_told() {
    told_.clear();
    hint_.reset();
  }

  // Whether it was found where somebody said it is. A place in an image says too little for that.
  bool as_told(const Detection& found) const {
    const auto* told = hint_ ? std::get_if<Rigid3>(&*hint_) : nullptr;
    if (told == nullptr) return false;
    const Rigid3& pose = found.poses.front().world_from_object;
    return center_distance(*told, pose) < kOtherPlace * model().radius() &&
           rotation_angle(*told, pose) < kSameFittedAngle;
  }

  // Of what a scan about the place in an image that somebody told of has found.
  std::vector<JointPose> verified_about(const ImageHint& hint) const {
    for (size_t i = 0; i < frames_.size(); ++i) {
      if (frames_.cameras()[frames_.camera_index(i)].id != hint.camera) continue;
      const SearchSize& size = frames_.size_of(i);
      const ImagePlace place{i, size.searched(hint.pixel), hint.radius_px / size.shrink};
      return verification_.by_edges(frames_, scan_.scan_about(frames_, place));
    }
    return {};
  }

  // By contours, what somebody told of among it. Best first.
  std::vector<ContourPose> search_contours(const ScanResult& hits, const MeshColors* colors,
                                           size_t pool = kMaxPool) const {
    std::vector<JointPose> verified = verification_.by_edges(frames_, hits);
    if (const auto* place = hint_ ? std::get_if<ImageHint>(&*hint_) : nullptr) {
      const std::vector<JointPose> about = verified_about(*place);
      verified.insert(verified.begin(), about.begin(), about.end());
    }
    std::erase_if(verified, [&](const JointPose& pose) {
      const Rigid3& at = pose.world_from_object;
      // Steps from near the volume may lead into it.
      return (options_.volume &&
              options_.volume->distance(at * model().center()) > model().radius()) ||
             taken_.take(model(), at, frames_.search_cameras());
    });
    std::vector<ContourPose> poses =
        contours_.search(frames_, std::move(verified), colors, nullptr, pool);
    std::erase_if(poses, [&](const ContourPose& pose) {
      return !possible(pose.fit.motion.world_from_object);
    });
    for (ContourPose& pose : contours_.fit(frames_, told_)) poses.push_back(std::move(pose));
    sort_by_rank(poses);
    return poses;
  }

  bool same_place(const Detection& a, const Detection& b) const {
    if (a.poses.empty() || b.poses.empty()) return false;
    const Rigid3 &one = a.poses.front().world_from_object, &two = b.poses.front().world_from_object;
    return center_distance(one, two) < kOtherPlace * model().radius() / 2 &&
           rotation_angle(one, two) < kSameFittedAngle;
  }

  // Rivals of the best pose. What is symmetric then has them, although the search may have come
  // upon one of its poses only.
  void add_rotated(std::vector<JudgedPose>& judged) const {
    const auto best = std::max_element(
        judged.begin(), judged.end(),
        [](const JudgedPose& a, const JudgedPose& b) { return a.evidence < b.evidence; });
    if (best == judged.end() || !judge_.acceptable(*best, frames_.size())) return;
    for (PoseFit& fit : fitter_.fit_rotated(frames_.fit_cameras(), best->fit.motion)) {
      judged.push_back(judge_.judge(std::move(fit)));
    }
  }

  const DetectorOptions options_;
  const Executor executor_;
  const TemplateBank bank_;
  const SilhouetteSearch silhouettes_;
  const SearchDistances distances_;
  DetectorFrames frames_;
  PoseScan scan_;
  const PoseVerification verification_;
  const PoseFitter fitter_;
  const ContourSearch contours_;
  DetectionJudge judge_;
  TakenPlaces taken_;
  std::optional<ColorTemplates> color_templates_;  ///< made when they are first asked for
  std::optional<SearchHint> hint_;                 ///< for the next detect()
  std::vector<RigMotion> told_;  ///< what came nearest to such a pose, in these frames
  ContourBelief belief_;
  SearchOrder order_;
  Time newest_{};             ///< capture of the newest frame
  bool looks_again_ = false;  ///< what waits has not been looked at since it was found
};

Result<std::unique_ptr<ObjectDetector>> ObjectDetector::create(
    ObjectId object, std::shared_ptr<const ViewpointModel> views,
    std::vector<DetectorCamera> cameras, const DetectorOptions& options, Executor executor) {
  SL_RETURN_IF_ERROR(check(options, cameras.size()));
  auto sizes = shrink_to_search(cameras, views->radius(), options);
  return std::unique_ptr<ObjectDetector>(new ObjectDetector(std::make_unique<Impl>(
      object, std::move(views), std::move(cameras), std::move(sizes), options, executor)));
}

ObjectDetector::ObjectDetector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ObjectDetector::~ObjectDetector() = default;

void ObjectDetector::prepare(const ColorVerifier& colors) { impl_->prepare(colors); }
void ObjectDetector::set_others(std::vector<KnownObject> known, size_t alike) {
  impl_->set_others(std::move(known), alike);
}
void ObjectDetector::add_frame(CameraId camera, const Frame& frame,
                               const ForegroundMap* foreground) {
  impl_->add_frame(camera, frame, foreground);
}
Detection ObjectDetector::detect_at(const SearchHint& hint) { return impl_->detect_at(hint); }
Detection ObjectDetector::detect(const ColorVerifier* colors) { return impl_->detect(colors); }
void ObjectDetector::forget() { impl_->forget(); }
bool ObjectDetector::waits() const { return impl_->waits(); }
Detection ObjectDetector::look_again(const ColorVerifier* colors) {
  return impl_->look_again(colors);
}
void ObjectDetector::explain(DetectionTrace& trace, const ColorVerifier* colors) {
  impl_->explain(trace, colors);
}
PoseAssessment ObjectDetector::assess(const Rigid3& world_from_object) const {
  return impl_->assess(world_from_object);
}
Detection ObjectDetector::judge(const PoseProposals& proposals) { return impl_->judge(proposals); }
Detection ObjectDetector::follow(const Detection& earlier) { return impl_->follow(earlier); }
OrientationComparison ObjectDetector::compare_orientations(const Rigid3& world_from_object,
                                                           const Vector6& twist, Time time,
                                                           const ColorVerifier* colors) {
  return impl_->compare_orientations({world_from_object, twist}, time, colors);
}
PlaceSearch ObjectDetector::search_about(const Rigid3& world_from_object, const Vector6& twist,
                                         Time time, const ColorVerifier* colors) {
  return impl_->search_about({world_from_object, twist}, time, colors);
}
SearchWork ObjectDetector::work() const { return impl_->work(); }

}  // namespace sightline
