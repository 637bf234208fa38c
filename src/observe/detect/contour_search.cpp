// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/contour_search.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "observe/detect/colors/color_silhouettes.hpp"
#include "observe/detect/colors/contour_colors.hpp"
#include "observe/detect/colors/pose_pool.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/sector_contrast.hpp"

namespace sightline::observe {
namespace {

// The contrast that a fit may tell is another one than that of contours.
constexpr FitEffort kFullFit{8, kSampleStep, false};
constexpr FitEffort kFollowingFit{8, kSampleStep, false, true, kRestOfSearch};
constexpr FitEffort kQuickFit{5, kScreenedStep, false, false, kRestOfSearch, true};
// A twist that only the small differences of the cameras' capture times tell is six more numbers
// for a wrong pose to fit by: wrong ones ended at 10 rad/s and 1.5 to 3 m/s (medians).
constexpr FitEffort kSearchFit{8, kSampleStep, false, false, kRestOfSearch};

void note(DetectionTrace* trace, const char* name, const std::vector<JointPose>& poses) {
  if (trace == nullptr) return;
  DetectionTrace::Stage stage{name, {}, trace->clock != nullptr ? trace->clock() : 0};
  for (const JointPose& pose : poses) {
    stage.candidates.push_back({pose.world_from_object, pose.score});
  }
  trace->stages.push_back(std::move(stage));
}

void note(DetectionTrace* trace, const char* name, const std::vector<ContourPose>& poses) {
  if (trace == nullptr) return;
  DetectionTrace::Stage stage{name, {}, trace->clock != nullptr ? trace->clock() : 0};
  stage.fitted = true;
  for (const ContourPose& pose : poses) {
    stage.candidates.push_back({pose.fit.motion.world_from_object, pose.score});
  }
  trace->stages.push_back(std::move(stage));
}

// Of each place some, and of other places too: those are the rivals that it has to beat.
class PromisingPoses {
 public:
  PromisingPoses(const Eigen::Vector3d& center, double radius) : center_(center), radius_(radius) {}

  /// Unless it is one of them, or its place has enough.
  void add(const RigMotion& motion) {
    const Rigid3& here = motion.world_from_object;
    size_t same_place = 0;
    for (const RigMotion& other : motions_) {
      const double distance = (other.world_from_object * center_ - here * center_).norm();
      if (distance < kSameFitDistance * radius_ &&
          rotation_angle(other.world_from_object, here) < kSameFitAngle)
        return;
      if (distance < kOtherPlace * radius_) ++same_place;
    }
    if (same_place < kMaxOfPlace) motions_.push_back(motion);
  }

  size_t size() const { return motions_.size(); }
  const std::vector<RigMotion>& motions() const { return motions_; }

 private:
  const Eigen::Vector3d center_;
  const double radius_;
  std::vector<RigMotion> motions_;
};

std::vector<double> agreement_of(const std::vector<ContourPose>& poses, const MeshColors& colors,
                                 const Executor& executor) {
  std::vector<double> out(poses.size());
  executor(poses.size(),
           [&](size_t i) { out[i] = colors.agreement(poses[i].fit.motion.world_from_object); });
  return out;
}

// Product of score and colors; none where the mesh has none.
std::vector<double> with_colors(const std::vector<ContourPose>& poses, const MeshColors* colors,
                                const Executor& executor) {
  if (colors == nullptr) return {};
  std::vector<double> out = agreement_of(poses, *colors, executor);
  for (size_t i = 0; i < out.size(); ++i) out[i] = std::max(0.0, out[i]) * poses[i].rank;
  return out;
}

// By their ranks as the colors of the mesh weigh them; the ranks stay.
void sort_with_colors(std::vector<ContourPose>& poses, const MeshColors* colors,
                      const Executor& executor) {
  if (colors == nullptr) return;
  const std::vector<double> weights =
      color_weights(agreement_of(poses, *colors, executor), kLeastColorsOfSpots);
  std::vector<size_t> order(poses.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return weights[a] * poses[a].rank > weights[b] * poses[b].rank;
  });
  std::vector<ContourPose> sorted;
  sorted.reserve(poses.size());
  for (const size_t i : order) sorted.push_back(std::move(poses[i]));
  poses = std::move(sorted);
}

// How much a pose explains, where no second camera tells depth: see kExtentPower.
double extent(const View& view, const CameraModel& lens, double distance) {
  const double width = std::sqrt(static_cast<double>(view.area));
  return std::pow(lens.parameters().fx * width / (distance * kUsualSizePx), kExtentPower);
}

}  // namespace

void sort_by_rank(std::vector<ContourPose>& poses) {
  std::stable_sort(poses.begin(), poses.end(),
                   [](const ContourPose& a, const ContourPose& b) { return a.rank > b.rank; });
}

double joint_score(std::vector<double> cameras) {
  const size_t needed = std::min<size_t>(2, cameras.size());
  std::erase_if(cameras, [](double score) { return score < 0; });
  if (cameras.empty() || cameras.size() < needed) return 0;
  std::sort(cameras.begin(), cameras.end(), std::greater<>());
  if (cameras.size() > 2) cameras.pop_back();
  return std::accumulate(cameras.begin(), cameras.end(), 0.0) / static_cast<double>(cameras.size());
}

double joint_rank(const std::vector<double>& cameras, size_t of) {
  if (cameras.size() < std::min<size_t>(2, of) || cameras.empty()) return 0;
  return std::accumulate(cameras.begin(), cameras.end(), 0.0) / static_cast<double>(cameras.size());
}

ContourPose ContourSearch::scored(const DetectorFrames& frames, PoseFit fit,
                                  size_t sample_step) const {
  const ViewpointModel& model = bank_.model();
  ContourPose out{std::move(fit), {}, 0, 0, 1};
  std::vector<double> ranks;
  for (size_t i = 0; i < frames.size(); ++i) {
    const Rigid3 here = out.fit.motion.at(frames.fit_cameras()[i].seconds);
    const bool rough = out.fit.cameras[i].pixel_size > frames.fit_cameras()[i].pixel_size;
    const FitCamera& camera = fitter_.look(frames.fit_cameras()[i], here, rough);
    const CameraModel& lens = camera.camera->model;
    const Rigid3 camera_from_object = camera.camera_from_world * here;
    const auto pixel = lens.project(camera_from_object * model.center());
    out.cameras.push_back(-1);
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() >= lens.width() ||
        pixel->y() >= lens.height())
      continue;
    const View view = model.view(model.nearest(camera_from_object));
    const double contrast =
        sector_contrast(view, lens, camera_from_object, *camera.image, sample_step);
    const double share = out.fit.cameras[i].share();
    out.cameras.back() = share * contrast;
    // By how many lines agree first: clutter gives contrast, too, but seldom edges all around.
    ranks.push_back(share * share * contrast);
    if (frames.size() == 1) {
      out.extent = extent(view, frames.fit_cameras()[i].camera->model,
                          (camera_from_object * model.center()).norm());
    }
  }
  out.score = joint_score(out.cameras);
  out.rank = out.extent * joint_rank(ranks, frames.size());
  return out;
}

ContourPose ContourSearch::evaluate(const DetectorFrames& frames, const RigMotion& motion) const {
  return scored(frames, fitter_.evaluate(frames.fit_cameras(), motion), kSampleStep);
}

std::vector<ContourPose> ContourSearch::fit(const DetectorFrames& frames,
                                            std::span<const RigMotion> starts, double reach,
                                            const FitEffort& effort) const {
  std::vector<ContourPose> fits(starts.size());
  executor_(starts.size(), [&](size_t i) {
    PoseFit fit = fitter_.fit(frames.fit_cameras(), starts[i], reach, effort);
    fits[i] = scored(frames, std::move(fit), effort.sample_step);
  });
  sort_by_rank(fits);
  return fits;
}

std::vector<ContourPose> ContourSearch::fit(const DetectorFrames& frames,
                                            std::span<const RigMotion> starts) const {
  std::vector<ContourPose> fits = fit(frames, starts, kSearchReach, kFollowingFit);
  reorient(frames, fits, nullptr);
  return fits;
}

std::vector<RigMotion> ContourSearch::best_turned(const DetectorFrames& frames,
                                                  const RigMotion& motion) const {
  std::vector<RigMotion> turned = fitter_.turned(motion);
  std::vector<double> ranks(turned.size());
  executor_(turned.size(), [&](size_t i) {
    PoseFit here = fitter_.lines(frames.fit_cameras(), turned[i], kScreenedStep);
    ranks[i] = scored(frames, std::move(here), kScreenedStep).rank;
  });
  std::vector<size_t> order(turned.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return ranks[a] > ranks[b]; });
  std::vector<RigMotion> out;
  for (size_t i = 0; i < std::min(kMaxTurned, order.size()); ++i) out.push_back(turned[order[i]]);
  return out;
}

std::vector<ContourPose> ContourSearch::compare(const DetectorFrames& frames,
                                                const RigMotion& motion,
                                                std::span<const RigMotion> others) const {
  std::vector<RigMotion> starts = best_turned(frames, motion);
  starts.insert(starts.begin(), others.begin(), others.end());
  std::vector<ContourPose> fits = fit(frames, starts, kSearchReach, kFullFit);
  // As it is, too: a fit may leave it.
  fits.push_back(evaluate(frames, motion));
  for (ContourPose& near : fit(frames, std::span(&motion, 1), kFinalReach, kFullFit)) {
    fits.push_back(std::move(near));
  }
  sort_by_rank(fits);
  reorient(frames, fits, nullptr);
  return fits;
}

std::vector<ContourPose> ContourSearch::fit_promising(const DetectorFrames& frames,
                                                      std::span<const RigMotion> starts,
                                                      double reach, double known,
                                                      const MeshColors* colors) const {
  const std::vector<ContourPose> quick = fit(frames, starts, reach, kQuickFit);
  if (quick.empty()) return {};
  const std::vector<double> colored = with_colors(quick, colors, executor_);
  std::vector<size_t> order(quick.size());
  std::iota(order.begin(), order.end(), size_t{0});
  PromisingPoses promising(bank_.model().center(), bank_.model().radius());
  const double enough = kPromising * kPromising * std::max(known, quick.front().rank);
  const double most_colored =
      colored.empty() ? 0 : *std::max_element(colored.begin(), colored.end());
  const size_t by_score = most_colored > 0 ? kMaxPromising / 2 : kMaxPromising;
  for (const size_t i : order) {
    if (quick[i].rank < enough || promising.size() == by_score) break;
    promising.add(quick[i].fit.motion);
  }
  if (most_colored > 0) {
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return colored[a] > colored[b]; });
    for (const size_t i : order) {
      if (colored[i] < kPromising * most_colored || promising.size() == kMaxPromising) break;
      promising.add(quick[i].fit.motion);
    }
  }
  return fit(frames, promising.motions(), kFinalReach, kSearchFit);
}

// One camera knows depth by size only, and what is small there is found by chance far more often
// than what is large: each distance gets its share of what goes on.
std::vector<JointPose> ContourSearch::of_each_distance(const DetectorFrames& frames,
                                                       std::vector<JointPose> poses, size_t max,
                                                       const KeepPoses& keep) const {
  if (frames.size() > 1) return keep(std::move(poses), max);
  const Rigid3& camera_from_world = frames.search_cameras().front().camera_from_world;
  return keep_of_each_distance(poses, camera_from_world.inverse().translation,
                               bank_.model().center(), max, keep);
}

// Those that stand out where they are, before anything is fitted.
std::vector<JointPose> ContourSearch::screened(const DetectorFrames& frames,
                                               std::vector<JointPose> poses,
                                               const MeshColors* colors,
                                               DetectionTrace* trace) const {
  const double radius = bank_.model().radius();
  const JointSearch joint(bank_, frames.search_cameras(), executor_);
  joint.climb(poses, JointSearch::Spread::kFar, 0.15, 0.25 * radius, 0);
  add_agreement(colors, poses, executor_);
  poses = of_each_distance(frames, std::move(poses), kMaxClimbedOn, keep_best);
  joint.climb(poses, JointSearch::Spread::kFar, 0.075, 0.125 * radius, 1);
  sort_by_score(poses);
  poses = thinned(poses, bank_.model().center(), 0.1 * radius, 0.12, kMaxPool);
  note(trace, "climbed", poses);
  add_agreement(colors, poses, executor_);
  poses = of_each_distance(frames, std::move(poses), kMaxScreened, keep_best);
  executor_(poses.size(), [&](size_t i) {
    const RigMotion resting{poses[i].world_from_object, Vector6::Zero()};
    PoseFit here = fitter_.lines(frames.fit_cameras(), resting, kScreenedStep);
    poses[i].score = scored(frames, std::move(here), kScreenedStep).rank;
  });
  sort_by_score(poses);
  note(trace, "screened", poses);
  return keep_best(std::move(poses), frames.size() == 1 ? kMaxContourFitsOfOne : kMaxContourFits);
}

// Rivals of the best: the same turned about its principal axes, and where a slightly other start
// leads to.
void ContourSearch::add_variants(const DetectorFrames& frames, std::vector<ContourPose>& fits,
                                 const MeshColors* colors) const {
  const Eigen::Vector3d& center = bank_.model().center();
  if (fits.empty()) return;
  const size_t best = std::min(kContourVariants, fits.size());
  std::vector<RigMotion> starts;
  for (size_t i = 0; i < best; ++i) {
    const RigMotion motion = fits[i].fit.motion;
    for (const RigMotion& rotated : fitter_.rotated(motion)) starts.push_back(rotated);
    for (int axis = 0; axis < 3; ++axis) {
      for (const double angle : {kVariantAngle, -kVariantAngle}) {
        const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(axis)));
        RigMotion start = motion;
        start.world_from_object = motion.world_from_object * Rigid3(turn, center - turn * center);
        starts.push_back(start);
      }
    }
  }
  for (ContourPose& variant :
       fit_promising(frames, starts, kRotatedReach, fits.front().rank, colors)) {
    fits.push_back(std::move(variant));
  }
}

std::vector<ContourPose> ContourSearch::search(const DetectorFrames& frames,
                                               std::vector<JointPose> verified,
                                               const MeshColors* colors, DetectionTrace* trace,
                                               size_t pool) const {
  const double step = 0.25 * bank_.model().radius();
  add_agreement(colors, verified, executor_);
  const Eigen::Vector3d& center = bank_.model().center();
  std::vector<JointPose> poses = of_each_distance(
      frames, std::move(verified), pool, [&](std::vector<JointPose> some, size_t max) {
        return best_of_cells(std::move(some), center, step, 0.25, max);
      });
  note(trace, "pool", poses);
  std::vector<RigMotion> starts;
  for (const JointPose& pose : screened(frames, std::move(poses), colors, trace)) {
    starts.push_back({pose.world_from_object, Vector6::Zero()});
  }
  std::vector<ContourPose> fits = fit_promising(frames, starts, kSearchReach, 0, colors);
  sort_with_colors(fits, colors, executor_);
  note(trace, "fitted", fits);
  add_variants(frames, fits, colors);
  sort_by_rank(fits);
  sort_with_colors(fits, colors, executor_);
  note(trace, "varied", fits);
  reorient(frames, fits, colors);
  if (trace != nullptr) {
    std::vector<ContourPose> shown = fits;
    sort_with_colors(shown, colors, executor_);
    note(trace, "final", shown);
  }
  return fits;
}

void ContourSearch::reorient(const DetectorFrames& frames, std::vector<ContourPose>& fits,
                             const MeshColors* mesh_colors) const {
  if (fits.empty() || fits.front().score < kMinReoriented) return;
  const ContourPose best = fits.front();
  const ColorSilhouettes colors(frames, bank_.model(), best.fit.motion, best.cameras);
  const Eigen::Vector3d center = best.fit.motion.world_from_object * bank_.model().center();
  std::vector<RigMotion> starts;
  for (const JointPose& pose :
       silhouettes_.orientations(colors.cameras(), center, kMaxReoriented)) {
    starts.push_back({pose.world_from_object, Vector6::Zero()});
  }
  for (ContourPose& pose : fit_promising(frames, starts, kSearchReach, best.rank, mesh_colors)) {
    fits.push_back(std::move(pose));
  }
  std::vector<double> overlaps(fits.size(), -1);
  executor_(fits.size(), [&](size_t i) {
    const RigMotion& motion = fits[i].fit.motion;
    if ((motion.world_from_object * bank_.model().center() - center).norm() >
        kOtherPlace * bank_.model().radius())
      return;
    overlaps[i] = colors.overlap(silhouettes_, motion);
  });
  const double most = *std::max_element(overlaps.begin(), overlaps.end());
  for (size_t i = 0; i < fits.size(); ++i) {
    if (overlaps[i] < 0 || most <= 0) continue;
    fits[i].score *= overlaps[i] / most;
    fits[i].rank *= overlaps[i] / most;
  }
  sort_by_rank(fits);
}

}  // namespace sightline::observe
