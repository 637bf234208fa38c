// SPDX-License-Identifier: Apache-2.0
#include "sequence.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <ctime>
#include <numbers>

#include "images.hpp"
#include "shot_store.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/record/evaluate.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::bench {
namespace {

constexpr double kFailMm = 50, kFailDeg = 5;

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

Result<Installation> installation_of(const Condition& condition, const test::SceneRig& rig,
                                     bool silhouettes) {
  std::error_code ignored;
  const auto folder = std::filesystem::temp_directory_path() / "sightline_bench_tracking";
  std::filesystem::create_directories(folder, ignored);
  SL_ASSIGN(const auto file, test::write_object(folder, rig.options().name,
                                                rig.options().shape->mesh(), condition.symmetry));
  Installation installation;
  installation.name = condition.name;
  installation.detect.silhouettes = silhouettes;
  ObjectConfig object;
  SL_ASSIGN(object.description, read_object_file(file));
  installation.objects.push_back(std::move(object));
  for (const CalibratedCamera& calibration : rig.cameras()) {
    installation.cameras.push_back({.name = calibration.name,
                                    .recording = {},
                                    .recorded_as = {},
                                    .calibration = calibration,
                                    .overlay = {},
                                    .place = {}});
  }
  return installation;
}

/// The product's own chain over one sequence.
class Chain {
 public:
  static Result<std::unique_ptr<Chain>> create(const Condition& condition,
                                               const test::SceneRig& rig, bool silhouettes) {
    auto chain = std::unique_ptr<Chain>(new Chain());
    SL_ASSIGN(chain->installation_, installation_of(condition, rig, silhouettes));
    chain->told_ = condition.told;
    SL_ASSIGN(chain->rig_, load_rig(chain->installation_));
    if (condition.start == Start::kCold) {
      SL_ASSIGN(chain->search_, ObjectSearch::create(chain->installation_, chain->rig_));
    }
    SL_RETURN_IF_ERROR(chain->restart());
    return chain;
  }

  /// Forgets everything but what the search has learned.
  Status restart() {
    std::vector<CameraId> cameras;
    for (uint32_t i = 0; i < installation_.cameras.size(); ++i) cameras.emplace_back(i);
    auto search = chain_ ? chain_->take_search() : std::move(search_);
    SL_ASSIGN(chain_, TrackingChain::create(installation_, rig_, cameras, std::move(search),
                                            SearchTiming{.instant = true}));
    return {};
  }

  void begin(Time now) { chain_->begin(now); }
  void observe(const FramePtr& frame) { chain_->observe({frame->info().camera, frame}); }
  void put(Observation observation) { chain_->set().push_back(std::move(observation)); }
  Observation start(const FramePtr& shot, const Rigid3& pose) {
    const Frame& frame = *shot;
    ObjectTracker& tracker = chain_->observer(frame.info().camera)->tracker();
    const Rigid3 camera_from_world =
        installation_.cameras[frame.info().camera.index()].calibration.world_from_camera.inverse();
    tracker.note_found({ObjectId(0), shot, camera_from_world * pose, false});
    Matrix6 covariance = Matrix6::Identity() * 0.01 * 0.01;
    covariance.diagonal().tail<3>().setConstant(0.002 * 0.002);
    Observation out = tracker.propose(frame, ObjectId(0), pose, covariance);
    if (!told_) return out;
    // Given is also which of the poses it is that look alike.
    out.symmetric_hypotheses = {{pose, 0}};
    for (const Rigid3& turn : rig_.objects[0].shape_symmetry.rotations) {
      out.symmetric_hypotheses.push_back({pose * turn, 40});
    }
    return out;
  }
  /// Searches where that is due, in no time: the figures are of what is found, not of when.
  bool search(const std::vector<FramePtr>& frames) {
    std::vector<CameraFrame> seen;
    for (const FramePtr& frame : frames) seen.push_back({frame->info().camera, frame});
    return chain_->search(seen);
  }
  /// The newest search found something.
  bool found() const { return chain_->found(); }
  UpdateReport fuse() { return chain_->fuse().front(); }

  const Installation& installation() const { return installation_; }
  const Rig& rig() const { return rig_; }
  const std::vector<PoseTrackPtr>& tracks() const { return chain_->tracks(); }

 private:
  Chain() = default;
  Installation installation_;
  Rig rig_;
  std::unique_ptr<ObjectSearch> search_;  // until there is a chain
  std::unique_ptr<TrackingChain> chain_;
  bool told_ = true;
};

Sample judge(const PoseEstimate& estimate, const Rigid3& truth, const Rigid3& world_from_camera,
             const SymmetryOption& symmetry) {
  Sample sample;
  sample.time = estimate.time;
  sample.state = estimate.state;
  sample.failed = true;
  if (!has_pose(estimate.state)) return sample;
  const Rigid3& pose = estimate.world_from_object;
  const Rigid3 alike = nearest_symmetric(truth, pose, symmetry);
  sample.mm = 1e3 * translation_distance(alike, pose);
  sample.deg = rotation_angle(alike, pose) * 180 / std::numbers::pi;
  const Eigen::Vector3d in_camera =
      world_from_camera.rotation.conjugate() * (pose.translation - truth.translation);
  sample.lateral_mm = 1e3 * in_camera.head<2>().norm();
  sample.depth_mm = 1e3 * std::abs(in_camera.z());
  const Vector6 off = difference(pose, alike);
  sample.nees = off.dot(estimate.pose_covariance().ldlt().solve(off));
  sample.failed = sample.mm > kFailMm || sample.deg > kFailDeg;
  return sample;
}

}  // namespace

Result<Played> play(const Condition& condition, uint64_t seed, const PlayOptions& options) {
  ShotStore store(rig_of(condition, seed), options.shots, condition.name);
  const test::SceneRig& rig = store.rig();
  SL_ASSIGN(const auto chain, Chain::create(condition, rig, options.silhouettes));
  const ObjectDescription& object = chain->rig().objects[0].description;
  const SymmetryOption symmetry{object.symmetry, object.symmetry_axis, object.symmetry_order};
  SL_ASSIGN(auto images, Images::create(chain->installation(), chain->rig(),
                                        options.sheets.empty() ? 0 : rig.shots().size()));
  Played played;
  played.faces = rig.options().shape->mesh().faces.size();
  bool start = condition.start == Start::kHeld;
  size_t next = 0;
  for (const auto& shots : rig.sets()) {
    chain->begin(shots.front().stamp);
    double visible = 0;
    std::vector<FramePtr> frames;
    for (const test::SceneShot& shot : shots) {
      const bool always = rig.options().cards.empty() && condition.enters == Duration(0);
      visible = std::max(visible, always ? 1 : rig.visible_share(shot));
      frames.push_back(store.shoot(next++));
      if (start) {
        chain->put(chain->start(frames.back(), rig.truth(shot.true_capture)));
        continue;
      }
      const double before = cpu_ms();
      chain->observe(frames.back());
      played.step_ms.push_back(cpu_ms() - before);
    }
    const double before_search = cpu_ms();
    if (chain->search(frames)) {
      ++played.searches;
      const double took = cpu_ms() - before_search;
      played.detect_ms += took;
      if (chain->found()) played.find_ms.push_back(took);
    }
    const double before = cpu_ms();
    const UpdateReport report = chain->fuse();
    played.fuse_ms.push_back(cpu_ms() - before);
    Sample sample = judge(report.estimate, rig.truth(shots.front().true_capture),
                          rig.cameras().front().world_from_camera, symmetry);
    sample.started = start;
    sample.visible = visible;
    const bool outside = shots.front().true_capture < rig.options().start + condition.enters;
    if (!outside || has_pose(sample.state)) played.samples.push_back(sample);
    for (const FramePtr& frame : frames) SL_RETURN_IF_ERROR(images->show(*frame, chain->tracks()));
    // A camera of a free-running rig that starts alone is given the true pose until all have been.
    const bool had_start = start;
    start = condition.start == Start::kHeld && sample.failed;
    if (start && !had_start) SL_RETURN_IF_ERROR(chain->restart());
  }
  played.detect_ms /= static_cast<double>(std::max<size_t>(played.searches, 1));
  if (!options.sheets.empty()) {
    const std::string name = fmt::format("{}_{}", condition.name, seed);
    SL_RETURN_IF_ERROR(images->write(options.sheets / (name + ".png")));
    SL_RETURN_IF_ERROR(write_error_plot(options.sheets / (name + "_errors.png"), played.samples));
  }
  return played;
}

}  // namespace sightline::bench
