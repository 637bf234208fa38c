// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/object_detector.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "detection_term.hpp"
#include "joint_search.hpp"
#include "pose_fit.hpp"
#include "sightline/observe/background_model.hpp"
#include "silhouette_search.hpp"
#include "template_bank.hpp"

namespace sightline {
namespace {

constexpr Duration kTogether = std::chrono::milliseconds(100);
constexpr double kMapShrink = 4;         // picture pixels per pixel of the maps
constexpr double kScaleStep = 1.25;      // between the distances that are tried
constexpr double kLeastDiameter = 45;    // [px] smaller objects are not looked for
constexpr double kLeastSilhouette = 20;  // [px] the same by its silhouette
constexpr double kMostOfPicture = 0.8;   // of its height
constexpr size_t kVerified = 400, kClimbed = 60;
constexpr size_t kSilhouettes = 12;                   // of these, that are fitted
constexpr size_t kFewerHits = 8, kFewerVerified = 3;  // times, where only what is new is searched
constexpr double kClear = 1.5;                        // of the evidence that is asked for
constexpr double kLeastNew = 3e-4;                    // share of the picture that is worth a look
constexpr int kNearForeground = 3;  // [half-size px] edges so near to what is new count
constexpr double kScanReach = 7, kTurnedReach = 5;  // [half-size px]
// What clutter gives: share of agreeing lines times unlikeness of the colours.
constexpr double kClutterEvidence = 0.35;
constexpr double kLeastCameraEvidence = 0.08;
constexpr std::array<double, 4> kFollowShares = {1.0, 0.5, 1.5, 0.0};  // of the motion so far
constexpr double kTwistPrice = 0.01;  // for each squared sigma of the twist
constexpr double kTwistLinear = 1.0, kTwistAngular = 3.5;

// The frame of one camera as the detector keeps it.
struct Seen {
  FrameInfo info;
  SmallPicture picture;
  bool valid = false;
  ForegroundMap foreground;
  bool has_foreground = false;
};

struct Judged {
  PoseFit fit;
  double evidence = 0;                     // of outline and proposal
  double outline = 0;                      // of the outline alone
  int cameras = 0;                         // that see the outline
  const ProposedPose* proposal = nullptr;  ///< null: fitted to edges
};

double camera_evidence(const CameraFit& fit) {
  return std::max(0.0, fit.share() * fit.inside_outside - kClutterEvidence);
}

// Where the optical axes of two or more cameras meet best.
std::optional<Eigen::Vector3d> focus_of(const std::vector<DetectorCamera>& cameras) {
  if (cameras.size() < 2) return std::nullopt;
  Eigen::Matrix3d system = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const DetectorCamera& camera : cameras) {
    const Rigid3& pose = camera.calibration.world_from_camera;
    const Eigen::Vector3d axis = pose.rotation_matrix().col(2);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    system += across;
    right += across * pose.translation;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> widths(system, Eigen::EigenvaluesOnly);
  if (widths.eigenvalues()[0] < 0.05) return std::nullopt;  // (nearly) parallel
  return Eigen::Vector3d(system.ldlt().solve(right));
}

Status check(const DetectorOptions& o, size_t cameras) {
  const auto refuse = [](const char* what) {
    return make_error(ErrorCode::kInvalidInput, "detector", "{}", what);
  };
  if (cameras == 0) return refuse("no camera to look through");
  if (!(o.nearest >= 0) || !(o.farthest >= 0) || (o.farthest > 0 && o.farthest <= o.nearest)) {
    return refuse("nearest and farthest must be distances in metres, nearest first");
  }
  if (!(o.accept > 0) || !(o.margin > 0 && o.margin <= 1)) {
    return refuse("accept must be positive, margin above 0 and at most 1");
  }
  if (o.refined < 1 || o.scan_hits < 10 || !(o.sigma_px > 0) ||
      !(o.independent > 0 && o.independent <= 1)) {
    return refuse("refined, scan_hits, sigma_px and independent must be positive");
  }
  return {};
}

}  // namespace

class ObjectDetector::Impl {
 public:
  Impl(ObjectId object, std::shared_ptr<const ViewpointModel> views,
       std::vector<DetectorCamera> cameras, const DetectorOptions& options)
      : object_(object),
        options_(options),
        bank_(std::move(views)),
        silhouettes_(bank_),
        cameras_(std::move(cameras)),
        seen_(cameras_.size()) {
    choose_scales();
    find_turns();
  }

  void add_frame(CameraId camera, const Frame& frame, const ForegroundMap* foreground) {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (cameras_[i].id == camera) remember(frame, i, foreground);
    }
  }

  Detection detect() {
    Detection out;
    const bool focused = !everywhere_next_ && sees_something_new();
    if (!look(out.time, focused)) return out;
    make_maps();
    const size_t seed = choose_seed(focused);
    out.time = seen_[active_[seed]].info.capture;
    set_times(out.time);
    std::vector<Judged> judged;
    const PoseFitter fitter(bank_.model(), fit_cameras_);
    if (focused) add_silhouettes(fitter, judged);
    // Silhouettes have been tried from all sides: where one is beyond doubt, edges add nothing.
    const bool clear = std::any_of(judged.begin(), judged.end(), [&](const Judged& pose) {
      return acceptable(pose) && pose.evidence > kClear * options_.accept;
    });
    if (!clear) {
      for (const JointPose& pose : search_edges(seed, focused)) {
        judged.push_back(judge(fitter.fit(pose.world_from_object, Vector6::Zero(), kScanReach)));
      }
    }
    add_turned(fitter, judged);
    decide(judged, out);
    everywhere_next_ = focused && out.poses.empty();
    return out;
  }

  Detection judge(const Proposals& proposals) {
    Detection out;
    if (proposals.poses.empty() || !look(out.time, false)) return out;
    out.time = proposals.time;
    set_times(out.time);
    std::vector<Judged> judged;
    const PoseFitter fitter(bank_.model(), fit_cameras_);
    for (const ProposedPose& proposal : proposals.poses) {
      Judged pose = judge(fitter.look(proposal.world_from_object, proposal.twist));
      pose.proposal = &proposal;
      pose.evidence += proposal.evidence;
      judged.push_back(std::move(pose));
    }
    add_turned(fitter, judged);
    decide(judged, out);
    return out;
  }

  Detection follow(const Detection& earlier) {
    Detection out;
    if (earlier.poses.empty() || !look(out.time, false)) return out;
    make_maps();
    set_times(out.time);
    const PoseFitter fitter(bank_.model(), fit_cameras_);
    const JointSearch search(bank_, search_cameras_);
    const double radius = bank_.model().radius();
    std::vector<Judged> judged;
    for (const DetectedPose& pose : earlier.poses) {
      // Motion changes: from where it may have come to, the maps lead on.
      for (const double share : kFollowShares) {
        const double seconds = share * to_seconds(out.time - earlier.time);
        const JointPose start{pose.world_from_object * Rigid3::exp(pose.twist * seconds), 0};
        JointPose moved = search.climb(start, JointSearch::Spread::kFar, 0.2, 0.35 * radius, 3);
        moved = search.climb(moved, JointSearch::Spread::kNear, 0.08, 0.12 * radius, 3);
        judged.push_back(judge(fitter.fit(moved.world_from_object, pose.twist, kScanReach)));
        if (silhouette_cameras_.empty()) continue;
        moved = climb_silhouettes(start.world_from_object, 0.2, 0.35 * radius);
        judged.push_back(judge(fitter.fit(moved.world_from_object, pose.twist, kScanReach)));
      }
    }
    decide(judged, out);
    return out;
  }

 private:
  void choose_scales() {
    const auto focus = focus_of(cameras_);
    const double diameter = 2 * bank_.model().radius();
    for (const DetectorCamera& camera : cameras_) {
      const auto& lens = camera.calibration.model.parameters();
      double farthest = lens.fx * diameter / kLeastDiameter;
      double nearest = lens.fx * diameter / (kMostOfPicture * lens.height);
      if (focus) {
        const double usual = (*focus - camera.calibration.world_from_camera.translation).norm();
        nearest = std::max(nearest, 0.5 * usual);
        farthest = std::min(farthest, 1.7 * usual);
      }
      if (options_.nearest > 0) nearest = options_.nearest;
      if (options_.farthest > 0) farthest = options_.farthest;
      double smallest = lens.fx * diameter / kLeastSilhouette;
      if (focus) {
        const double usual = (*focus - camera.calibration.world_from_camera.translation).norm();
        smallest = std::min(smallest, 1.7 * usual);
      }
      if (options_.farthest > 0) smallest = options_.farthest;
      silhouette_reach_.push_back({nearest, std::max(nearest, smallest)});
      farthest = std::max(farthest, nearest);
      const double ratio = std::log(farthest / nearest) / std::log(kScaleStep);
      const int steps = std::clamp(static_cast<int>(std::ceil(ratio)), 1, 12);
      std::vector<float> scales;
      for (int i = 0; i < steps; ++i) {
        const double distance = nearest * std::pow(farthest / nearest, (i + 0.5) / steps);
        scales.push_back(static_cast<float>(lens.fx / (kMapShrink * distance)));
      }
      const double reach = 1.1 * bank_.model().radius() * static_cast<double>(scales.front());
      margin_ = std::max(margin_, static_cast<int>(std::ceil(reach)) + 2);
      scales_.push_back(std::move(scales));
    }
  }

  // Ways to turn the object over that may leave its look as it is: quarter and half turns about
  // its principal axes.
  void find_turns() {
    const ViewpointModel& model = bank_.model();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < model.size(); ++i) {
      for (const ContourSample& sample : model.view(i).contour) {
        const Eigen::Vector3d from_center = sample.point.cast<double>() - model.center();
        spread += from_center * from_center.transpose();
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
    Eigen::Matrix3d axes = principal.eigenvectors();
    if (axes.determinant() < 0) axes.col(2) *= -1;
    for (int first = 0; first < 6; ++first) {
      for (int second = 0; second < 6; ++second) {
        if (first / 2 == second / 2) continue;
        Eigen::Matrix3d turn;
        turn.col(0) = (first % 2 == 0 ? 1 : -1) * Eigen::Vector3d::Unit(first / 2);
        turn.col(1) = (second % 2 == 0 ? 1 : -1) * Eigen::Vector3d::Unit(second / 2);
        turn.col(2) = turn.col(0).cross(turn.col(1));
        if (turn.isIdentity()) continue;
        turns_.emplace_back(axes * turn * axes.transpose());
      }
    }
  }

  // The best pose, turned over about the object's middle in all ways. What is symmetric then has
  // rivals, although the search may have come upon one of its poses only.
  void add_turned(const PoseFitter& fitter, std::vector<Judged>& judged) const {
    const auto best =
        std::max_element(judged.begin(), judged.end(),
                         [](const Judged& a, const Judged& b) { return a.evidence < b.evidence; });
    if (best == judged.end() || !acceptable(*best)) return;
    const Rigid3 pose = best->fit.world_from_object;
    const Vector6 twist = best->fit.twist;
    const Eigen::Vector3d& center = bank_.model().center();
    for (const Eigen::Quaterniond& turn : turns_) {
      const Rigid3 turned_object(turn, center - turn * center);
      const Vector6 turned_twist = turned_object.inverse().adjoint() * twist;
      judged.push_back(judge(fitter.fit(pose * turned_object, turned_twist, kTurnedReach)));
    }
  }

  void remember(const Frame& frame, size_t index, const ForegroundMap* foreground) {
    const CameraModel& model = cameras_[index].calibration.model;
    Seen& seen = seen_[index];
    if (frame.info().status == FrameStatus::kDamaged || frame.info().width != model.width() ||
        frame.info().height != model.height())
      return;
    seen.info = frame.info();
    const PlaneView luma = frame.half_grey();
    const I420View full = frame.i420();
    seen.picture.width = luma.width;
    seen.picture.height = luma.height;
    const std::array<PlaneView, 3> planes = {luma, full.u, full.v};
    for (size_t k = 0; k < 3; ++k) {
      auto& to = seen.picture.planes[k];
      to.resize(static_cast<size_t>(luma.width) * static_cast<size_t>(luma.height));
      for (int y = 0; y < luma.height; ++y) {
        std::copy_n(planes[k].row(y), luma.width,
                    to.data() + static_cast<size_t>(y) * static_cast<size_t>(luma.width));
      }
    }
    seen.valid = true;
    seen.has_foreground = foreground != nullptr && foreground->width == seen.picture.width &&
                          foreground->height == seen.picture.height;
    if (seen.has_foreground) seen.foreground = *foreground;
  }

  // As many cameras as are needed to believe a pose see something new.
  bool sees_something_new() const {
    const auto known = std::count_if(seen_.begin(), seen_.end(), [](const Seen& seen) {
      return seen.valid && seen.has_foreground && seen.foreground.share > kLeastNew;
    });
    return static_cast<size_t>(known) >= std::min<size_t>(2, cameras_.size());
  }

  // Edges of all cameras that take part; false without any. `newest`: capture of the newest.
  // `focused`: those of the background are left out, where it is known.
  bool look(Time& newest, bool focused) {
    active_.clear();
    newest = Time{};
    for (const Seen& seen : seen_) {
      if (seen.valid) newest = std::max(newest, seen.info.capture);
    }
    for (size_t i = 0; i < seen_.size(); ++i) {
      if (seen_[i].valid && newest - seen_[i].info.capture <= kTogether) active_.push_back(i);
    }
    edges_.resize(active_.size());
    search_cameras_.resize(active_.size());
    fit_cameras_.resize(active_.size());
    for (size_t i = 0; i < active_.size(); ++i) {
      const CalibratedCamera& camera = cameras_[active_[i]].calibration;
      const SmallPicture& picture = seen_[active_[i]].picture;
      edges_[i].compute(picture);
      const ForegroundMap* foreground =
          seen_[active_[i]].has_foreground ? &seen_[active_[i]].foreground : nullptr;
      near_.resize(active_.size());
      near_[i].clear();
      if (focused && foreground != nullptr) {
        spread_foreground(*foreground, near_[i]);
        edges_[i].keep_where(near_[i]);
      }
      SearchCamera& search = search_cameras_[i];
      search.camera = &camera;
      search.camera_from_world = camera.world_from_camera.inverse();
      search.shrink = kMapShrink;
      fit_cameras_[i] = {&camera, search.camera_from_world, &picture, &edges_[i], 0, foreground};
    }
    find_silhouette_cameras();
    return !active_.empty();
  }

  // What searching and climbing need beside the edges.
  void make_maps() {
    for (size_t i = 0; i < active_.size(); ++i) {
      for (int spread = 0; spread < SearchCamera::kSpreads; ++spread) {
        search_cameras_[i].maps[static_cast<size_t>(spread)].compute(edges_[i], spread + 1,
                                                                     margin_);
      }
    }
  }

  void find_silhouette_cameras() {
    silhouette_cameras_.clear();
    for (const size_t i : active_) {
      if (!seen_[i].has_foreground) continue;
      const CalibratedCamera& camera = cameras_[i].calibration;
      silhouette_cameras_.push_back({&camera,
                                     camera.world_from_camera.inverse(),
                                     &seen_[i].foreground,
                                     silhouette_reach_[i][0],
                                     silhouette_reach_[i][1],
                                     {},
                                     {}});
      silhouette_cameras_.back().sum_up();
    }
    if (silhouette_cameras_.size() < std::min<size_t>(2, cameras_.size())) {
      silhouette_cameras_.clear();
    }
  }

  // Pixels that are not background, and those around them.
  static void spread_foreground(const ForegroundMap& map, std::vector<uint8_t>& near) {
    const auto width = static_cast<size_t>(map.width);
    near.assign(map.classes.size(), 0);
    for (int y = 0; y < map.height; ++y) {
      const uint8_t* row = map.row(y);
      for (int x = 0; x < map.width; ++x) {
        if (row[x] == ForegroundMap::kBackground) continue;
        const int top = std::max(0, y - kNearForeground);
        const int bottom = std::min(map.height - 1, y + kNearForeground);
        const int left = std::max(0, x - kNearForeground);
        const int right = std::min(map.width - 1, x + kNearForeground);
        for (int v = top; v <= bottom; ++v) {
          uint8_t* to = near.data() + static_cast<size_t>(v) * width;
          std::fill(to + left, to + right + 1, uint8_t{1});
        }
      }
    }
  }

  // The next camera; where only what is new is searched, one that shows something.
  size_t choose_seed(bool focused) {
    for (size_t i = 0; focused && i < active_.size(); ++i) {
      const Seen& seen = seen_[active_[next_seed_ % active_.size()]];
      if (!seen.has_foreground || seen.foreground.share > 0) break;
      ++next_seed_;
    }
    return next_seed_++ % active_.size();
  }

  // Where in the maps of the searched camera the middle of the object may be: on what is new.
  std::vector<std::array<int, 2>> places_to_scan(size_t seed, const ScanRange& range) const {
    const std::vector<uint8_t>& near = near_[seed];
    if (near.empty()) return {};
    const int width = edges_[seed].width(), height = edges_[seed].height();
    const auto reach =
        static_cast<int>(0.5 * bank_.model().radius() * static_cast<double>(range.scales.front()));
    std::vector<std::array<int, 2>> rows(static_cast<size_t>(height / 2), {width / 2, 0});
    for (int y = 0; y + 1 < height; ++y) {
      const auto row = near.begin() + static_cast<ptrdiff_t>(y) * width;
      const auto first = std::find(row, row + width, 1);
      if (first == row + width) continue;
      const auto last =
          std::find(std::make_reverse_iterator(row + width), std::make_reverse_iterator(row), 1);
      const int left = static_cast<int>(first - row) / 2 - reach;
      const int right = static_cast<int>(last.base() - row) / 2 + reach + 1;
      for (int v = std::max(0, y / 2 - reach); v <= std::min(height / 2 - 1, y / 2 + reach); ++v) {
        auto& to = rows[static_cast<size_t>(v)];
        to = {std::max(0, std::min(to[0], left)), std::min(width / 2, std::max(to[1], right))};
      }
    }
    return rows;
  }

  // Poses whose outlines and creases find edges in all cameras, best first.
  std::vector<JointPose> search_edges(size_t seed, bool focused) const {
    const double radius = bank_.model().radius();
    const JointSearch search(bank_, search_cameras_);
    ScanRange range;
    range.scales = scales_[active_[seed]];
    range.most = focused ? options_.scan_hits / kFewerHits : options_.scan_hits;
    if (focused) range.rows = places_to_scan(seed, range);
    const auto hits = search.scan_camera(seed, range);
    std::vector<JointPose> poses =
        search.verify(seed, hits, range, focused ? kVerified / kFewerVerified : kVerified);
    drop_alike(poses, 0.08 * radius, 0.1);
    for (JointPose& pose : poses) {
      pose = search.climb(pose, JointSearch::Spread::kFar, 0.15, 0.25 * radius, 2);
    }
    drop_alike(poses, 0.12 * radius, 0.12);
    if (poses.size() > kClimbed) poses.resize(kClimbed);
    for (JointPose& pose : poses) {
      pose = search.climb(pose, JointSearch::Spread::kNear, 0.08, 0.12 * radius, 3);
    }
    drop_alike(poses, 0.12 * radius, 0.12);
    if (poses.size() > static_cast<size_t>(options_.refined)) {
      poses.resize(static_cast<size_t>(options_.refined));
    }
    return poses;
  }

  JointPose climb_silhouettes(const Rigid3& start, double turn, double shift) const {
    return climb_pose(start, bank_.model().center(), turn, shift, 3, [&](const Rigid3& pose) {
      return silhouettes_.score(silhouette_cameras_, pose, 2);
    });
  }

  // Each as it is and moved on to the edges.
  void add_silhouettes(const PoseFitter& fitter, std::vector<Judged>& judged) const {
    if (silhouette_cameras_.empty()) return;
    const JointSearch search(bank_, search_cameras_);
    const double radius = bank_.model().radius();
    for (const JointPose& pose : silhouettes_.search(silhouette_cameras_, kSilhouettes)) {
      const JointPose on_edges =
          search.climb(pose, JointSearch::Spread::kNear, 0.08, 0.12 * radius, 3);
      for (const Rigid3& start : {pose.world_from_object, on_edges.world_from_object}) {
        judged.push_back(judge(fitter.fit(start, Vector6::Zero(), kScanReach)));
      }
    }
  }

  void set_times(Time reference) {
    for (size_t i = 0; i < active_.size(); ++i) {
      fit_cameras_[i].seconds = to_seconds(seen_[active_[i]].info.capture - reference);
      search_cameras_[i].seconds = fit_cameras_[i].seconds;
    }
  }

  Judged judge(PoseFit fit) const {
    Judged out;
    for (const CameraFit& camera : fit.cameras) {
      const double evidence = camera_evidence(camera);
      out.evidence += evidence;
      if (evidence >= kLeastCameraEvidence) ++out.cameras;
    }
    out.evidence -= kTwistPrice * (fit.twist.head<3>().squaredNorm() / std::pow(kTwistAngular, 2) +
                                   fit.twist.tail<3>().squaredNorm() / std::pow(kTwistLinear, 2));
    out.outline = out.evidence;
    out.fit = std::move(fit);
    return out;
  }

  // The outline has to agree in two cameras, or at all with what was proposed: of the two poses of
  // a flat thing in one picture the wrong one may have as many features.
  bool acceptable(const Judged& judged) const {
    if (judged.proposal != nullptr && judged.proposal->evidence >= options_.accept / 2) {
      return judged.outline >= kLeastCameraEvidence;
    }
    const size_t needed = std::min<size_t>(2, active_.size());
    return judged.evidence >= options_.accept * static_cast<double>(needed) / 2 &&
           static_cast<size_t>(judged.cameras) >= needed;
  }

  // Edges take what lies so close together to the same pose; what features found apart is apart.
  bool alike_poses(const Judged& a, const Judged& b) const {
    const Eigen::Vector3d& center = bank_.model().center();
    const double away =
        (a.fit.world_from_object * center - b.fit.world_from_object * center).norm();
    const double turned = rotation_angle(a.fit.world_from_object, b.fit.world_from_object);
    const bool proposed = a.proposal != nullptr && b.proposal != nullptr;
    return away < (proposed ? 0.25 : 0.5) * bank_.model().radius() &&
           turned < (proposed ? 0.12 : 0.5);
  }

  // One test for all: enough evidence, and more than any other by the margin, or it is one of
  // several.
  void decide(std::vector<Judged>& judged, Detection& out) const {
    std::stable_sort(judged.begin(), judged.end(),
                     [](const Judged& a, const Judged& b) { return a.evidence > b.evidence; });
    std::vector<const Judged*> accepted;
    if (judged.empty()) return;
    if (judged.front().proposal != nullptr && !acceptable(judged.front())) {
      out.runner_up = judged.front().evidence;
      return;
    }
    for (const Judged& pose : judged) {
      const bool alike = std::any_of(accepted.begin(), accepted.end(), [&](const Judged* other) {
        return alike_poses(pose, *other);
      });
      if (alike) continue;
      // A proposal that no outline speaks for is no answer, but leaves the answer in doubt.
      const bool possible = (acceptable(pose) || pose.proposal != nullptr) &&
                            pose.evidence >= options_.margin * judged.front().evidence;
      if (possible && accepted.size() < 8) {
        accepted.push_back(&pose);
      } else {
        out.runner_up = std::max(out.runner_up, pose.evidence);
      }
    }
    for (const Judged* pose : accepted) {
      out.poses.push_back(
          {pose->fit.world_from_object, pose->fit.twist, pose->evidence, pose->cameras});
    }
    if (!accepted.empty()) observe(accepted, out);
  }

  void observe(const std::vector<const Judged*>& poses, Detection& out) const {
    for (size_t i = 0; i < active_.size(); ++i) {
      if (!measured_by(*poses.front(), i)) continue;
      const FrameInfo& info = seen_[active_[i]].info;
      Observation observation;
      observation.object = object_;
      observation.camera = cameras_[active_[i]].id;
      observation.epoch = info.epoch;
      observation.sequence = info.sequence;
      observation.capture = info.capture;
      observation.capture_error = info.capture_error;
      std::vector<FrozenTerm> terms;
      int residuals = 0;
      for (const Judged* pose : poses) {
        const Rigid3 here = pose->fit.at(fit_cameras_[i].seconds);
        LinearizedTerm term = measured(*pose, i, here);
        if (!terms.empty()) {  // alike as far as this picture knows
          term.cost = observation.hypotheses.front().cost;
          term.residuals = residuals;
        }
        residuals = term.residuals;
        terms.emplace_back(here, term);
        observation.hypotheses.push_back({here, term.cost});
      }
      observation.terms.push_back(std::make_shared<const DetectionTerm>(std::move(terms)));
      out.observations.push_back(std::move(observation));
    }
    std::stable_sort(
        out.observations.begin(), out.observations.end(),
        [](const Observation& a, const Observation& b) { return a.capture < b.capture; });
  }

  // Whether the active camera has something to say of the pose.
  bool measured_by(const Judged& pose, size_t camera) const {
    if (pose.proposal == nullptr) {
      return camera_evidence(pose.fit.cameras[camera]) >= kLeastCameraEvidence;
    }
    return pose.proposal->terms[active_[camera]] != nullptr;
  }

  LinearizedTerm measured(const Judged& pose, size_t camera, const Rigid3& here) const {
    if (pose.proposal != nullptr && pose.proposal->terms[active_[camera]] != nullptr) {
      return pose.proposal->terms[active_[camera]]->linearize(here);
    }
    return measured(pose.fit.cameras[camera]);
  }

  // The lines' information in the noise they have, and as if they were no more than they are
  // worth. All cameras were fitted together, so none pulls.
  LinearizedTerm measured(const CameraFit& fit) const {
    LinearizedTerm out;
    const double sigma = options_.sigma_px / 2;  // of half-size pixels
    out.information = fit.term.information * (options_.independent / (sigma * sigma));
    out.residuals = std::max(6, static_cast<int>(options_.independent * fit.agreeing));
    out.cost = 0.5 * out.residuals;
    out.quality = fit.share();
    return out;
  }

  const ObjectId object_;
  const DetectorOptions options_;
  const TemplateBank bank_;
  const SilhouetteSearch silhouettes_;
  const std::vector<DetectorCamera> cameras_;
  std::vector<std::vector<float>> scales_;               ///< by camera, [px/m of the maps]
  std::vector<std::array<double, 2>> silhouette_reach_;  ///< by camera, nearest and farthest [m]
  int margin_ = 0;
  std::vector<Eigen::Quaterniond> turns_;
  std::vector<Seen> seen_;
  size_t next_seed_ = 0;
  bool everywhere_next_ = false;  ///< a search of what is new has found nothing

  // Of the detection under way, by active camera.
  std::vector<size_t> active_;
  std::vector<EdgePicture> edges_;
  std::vector<SearchCamera> search_cameras_;
  std::vector<FitCamera> fit_cameras_;
  std::vector<std::vector<uint8_t>> near_;            ///< what is new; empty: everything counts
  std::vector<SilhouetteCamera> silhouette_cameras_;  ///< those that know their background
};

Result<std::unique_ptr<ObjectDetector>> ObjectDetector::create(
    ObjectId object, std::shared_ptr<const ViewpointModel> views,
    std::vector<DetectorCamera> cameras, const DetectorOptions& options) {
  SL_RETURN_IF_ERROR(check(options, cameras.size()));
  return std::unique_ptr<ObjectDetector>(new ObjectDetector(
      std::make_unique<Impl>(object, std::move(views), std::move(cameras), options)));
}

ObjectDetector::ObjectDetector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ObjectDetector::~ObjectDetector() = default;

void ObjectDetector::add_frame(CameraId camera, const Frame& frame,
                               const ForegroundMap* foreground) {
  impl_->add_frame(camera, frame, foreground);
}
Detection ObjectDetector::detect() { return impl_->detect(); }
Detection ObjectDetector::judge(const Proposals& proposals) { return impl_->judge(proposals); }
Detection ObjectDetector::follow(const Detection& earlier) { return impl_->follow(earlier); }

}  // namespace sightline
