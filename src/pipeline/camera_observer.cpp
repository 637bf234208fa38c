// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/camera_observer.hpp"

#include <algorithm>
#include <iterator>

#include "pipeline/view/rolling_view.hpp"
#include "pipeline/view/turning_view.hpp"
#include "sightline/pipeline/mesh_color_renderer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/pipeline/mesh_print_renderer.hpp"
#include "sightline/pipeline/rig_parts.hpp"

namespace sightline {

using namespace pipeline;

namespace {

// For silhouettes of some dozen cells: a fifth of a cell off at most.
std::shared_ptr<const RenderMesh> coarse_mesh(const RigObject& object) {
  constexpr double kError = 0.006;  // [radii]
  std::shared_ptr<const RenderMesh> out = object.mesh;
  if (!object.levels) return out;
  for (const LevelOfDetail::Level& level : object.levels->levels()) {
    if (level.error < kError * object.views->radius()) out = level.mesh;
  }
  return out;
}

std::vector<TrackedObject> tracked_objects(const Rig& rig, CameraId camera) {
  std::vector<TrackedObject> objects;
  for (const RigObject& object : rig.objects) {
    if (!object.description.modalities.appearance()) continue;
    const bool symmetric = !object.shape_symmetry.rotations.empty();
    const auto& geometry = rig.cameras[camera.index()];
    objects.push_back({object.named.id, object.views, object.description.modalities,
                       mesh_depth_renderer_factory(object.mesh, geometry), object.shape_symmetry,
                       symmetric || object.printed ? object.samples : nullptr, object.printed,
                       object.printed ? mesh_print_renderer_factory(object.painted, geometry)
                                      : PrintRendererFactory(),
                       mesh_depth_renderer_factory(coarse_mesh(object)),
                       object.painted && object.shape_symmetry.has_few_rotations()
                           ? mesh_color_renderer_factory(object.painted, geometry)
                           : ColorRendererFactory()});
  }
  return objects;
}

std::unique_ptr<RollingView> rolling_view(const CalibratedCamera& camera, const Rig& rig) {
  if (camera.readout_s == 0) return nullptr;
  std::vector<Eigen::Vector3d> centers;
  for (const RigObject& object : rig.objects) {
    centers.push_back(object.mesh ? object.mesh->center.cast<double>()
                                  : Eigen::Vector3d(Eigen::Vector3d::Zero()));
  }
  return std::make_unique<RollingView>(camera, std::move(centers));
}

// Two modalities start from slightly different poses of one frame; the poses of a symmetric shape
// are much farther apart [rad].
constexpr double kSamePose = 0.5;

double max_cost(const std::vector<PoseHypothesis>& hypotheses) {
  return std::max_element(hypotheses.begin(), hypotheses.end(),
                          [](const auto& a, const auto& b) { return a.cost < b.cost; })
      ->cost;
}

// Two modalities measure independently, so the costs (-log likelihoods) of a pose add up. A pose
// that one of them does not name is for it as unlikely as the least likely one that it does.
void add_evidence(const std::vector<PoseHypothesis>& from, std::vector<PoseHypothesis>& to) {
  if (from.empty()) return;
  if (to.empty()) {
    to = from;
    return;
  }
  const size_t named = to.size();
  const double max_from = max_cost(from), max_to = max_cost(to);
  for (PoseHypothesis& hypothesis : to) hypothesis.cost += max_from;
  for (const PoseHypothesis& hypothesis : from) {
    size_t nearest = 0;
    const auto off = [&](size_t i) {
      return rotation_angle(to[i].world_from_object, hypothesis.world_from_object);
    };
    for (size_t i = 1; i < named; ++i) {
      if (off(i) < off(nearest)) nearest = i;
    }
    if (off(nearest) < kSamePose) {
      to[nearest].cost += hypothesis.cost - max_from;
    } else {
      to.push_back({hypothesis.world_from_object, hypothesis.cost + max_to});
    }
  }
}

}  // namespace

Result<std::unique_ptr<CameraObserver>> CameraObserver::create(const Installation& installation,
                                                               const Rig& rig, CameraId camera) {
  SL_ASSIGN(auto fiducials, make_observer(installation, rig, camera));
  std::vector<TrackedObject> objects = tracked_objects(rig, camera);
  SL_CHECK(camera.index() < installation.cameras.size(), "camera id of another installation");
  const CameraConfig& config = installation.cameras[camera.index()];
  std::unique_ptr<TurningView> turning;
  SceneDepth scene;
  if (config.calibration.axes) {
    turning = std::make_unique<TurningView>(config.calibration.world_from_camera,
                                            rig.cameras.at(camera.index())->rays(), rig.scene);
    if (!objects.empty() && !rig.scene->empty()) scene = make_scene_depth(turning->scene_depth());
  } else if (!objects.empty()) {
    scene = make_scene_depth(rig, camera);
  }
  TrackerOptions options = installation.tracker;
  if (config.gamma > 0) options.gamma = config.gamma;
  SL_ASSIGN(auto tracker, ObjectTracker::create(config.calibration, camera, std::move(objects),
                                                options, std::move(scene)));
  return std::unique_ptr<CameraObserver>(new CameraObserver(camera, std::move(fiducials),
                                                            std::move(tracker), std::move(turning),
                                                            rolling_view(config.calibration, rig)));
}

CameraObserver::CameraObserver(CameraId camera, std::unique_ptr<FiducialObserver> fiducials,
                               std::unique_ptr<ObjectTracker> tracker,
                               std::unique_ptr<TurningView> turning,
                               std::unique_ptr<RollingView> rolling)
    : camera_(camera),
      fiducials_(std::move(fiducials)),
      tracker_(std::move(tracker)),
      turning_(std::move(turning)),
      rolling_(std::move(rolling)) {}
CameraObserver::~CameraObserver() = default;

void CameraObserver::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                          std::vector<Observation>& out) {
  const size_t first = out.size();
  if (found_) {
    for (FoundView& view : found_->take(camera_)) tracker_->note_found(std::move(view));
  }
  if (rolling_) {
    rolling_->look(frame.info(), tracks);
    tracks = rolling_->tracks();
  }
  if (turning_) {
    if (!turning_->look(frame.info(), tracks)) return;
    tracks = turning_->tracks();
  }
  fiducials_->step(frame, tracks, out);
  tracker_->step(frame, tracks, out);
  merge_observations(first, out);
  if (turning_) turning_->bring_back(std::span(out).subspan(first));
  if (rolling_) rolling_->bring_back(std::span(out).subspan(first));
}

void merge_observations(size_t first, std::vector<Observation>& observations) {
  for (size_t i = first; i < observations.size(); ++i) {
    Observation& kept = observations[i];
    for (size_t j = observations.size() - 1; j > i; --j) {
      Observation& other = observations[j];
      if (other.object != kept.object) continue;
      // What sees the object by its markers is not blind because its outline is not seen.
      if (kept.terms.empty() != other.terms.empty()) {
        if (kept.terms.empty()) kept.picture.reset();
        if (other.terms.empty()) other.picture.reset();
      }
      std::move(other.terms.begin(), other.terms.end(), std::back_inserter(kept.terms));
      std::move(other.hypotheses.begin(), other.hypotheses.end(),
                std::back_inserter(kept.hypotheses));
      add_evidence(other.symmetric_hypotheses, kept.symmetric_hypotheses);
      if (!kept.picture) kept.picture = other.picture;
      observations.erase(observations.begin() + static_cast<ptrdiff_t>(j));
    }
  }
}

}  // namespace sightline
