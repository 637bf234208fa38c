// SPDX-License-Identifier: Apache-2.0
// How well the cameras of a recording without ground truth agree: each camera is left out in turn,
// the others estimate the pose, and the corners that the one left out measured are predicted with
// it.
//   leave_one_out RECORDING [--json]
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "sightline/observe/terms/reprojection_term.hpp"
#include "sightline/pipeline/object_fusion.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/rig_parts.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

constexpr size_t kEnoughCorners = 6;  // a frame counts as seeing the board from here on

struct Sight {
  Observation observation;
  std::shared_ptr<const ReprojectionTerm> corners;  // null: not seen
};

// Everything every camera measured, in the order of capture: detection does not depend on who is
// left out.
Result<std::vector<Sight>> observe_all(const Installation& installation, const Rig& rig,
                                       std::shared_ptr<const Recording> recording) {
  std::vector<std::unique_ptr<FiducialObserver>> observers;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    SL_ASSIGN(auto observer, make_observer(installation, rig, CameraId(static_cast<uint32_t>(i))));
    observers.push_back(std::move(observer));
  }
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, time_offsets(*recording, installation),
                                             axis_histories(*recording, installation)));
  std::vector<Sight> sights;
  std::vector<Observation> made;
  for (;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) return sights;
    for (const FramePtr& frame : *frames) {
      made.clear();
      observers[frame->info().camera.index()]->step(*frame, {}, made);
      for (Observation& observation : made) {
        if (observation.object != ObjectId(0)) continue;
        std::shared_ptr<const ReprojectionTerm> corners;
        if (!observation.terms.empty()) {
          corners = std::dynamic_pointer_cast<const ReprojectionTerm>(observation.terms.front());
        }
        sights.push_back({std::move(observation), std::move(corners)});
      }
    }
  }
}

struct Errors {
  std::vector<double> px;
  double quantile(double q) {
    if (px.empty()) return 0;
    const auto at = static_cast<size_t>(q * static_cast<double>(px.size() - 1));
    std::nth_element(px.begin(), px.begin() + static_cast<ptrdiff_t>(at), px.end());
    return px[at];
  }
};

// Root mean square distance between measured corners and those of the pose [px]; negative if a
// corner does not project.
double corner_error(const ReprojectionTerm& term, const Rigid3& world_from_object) {
  const CalibratedCamera& camera = term.camera();
  const Rigid3 camera_from_object = camera.world_from_camera.inverse() * world_from_object;
  double sum = 0;
  for (const PointMatch& match : term.matches()) {
    const auto pixel = camera.model.project(camera_from_object * match.point_in_object);
    if (!pixel) return -1;
    sum += (*pixel - match.pixel).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(term.matches().size()));
}

struct CameraResult {
  std::string name;
  size_t frames = 0, seen = 0, tracking = 0, without_pose = 0;
  Errors interpolated, predicted;
};

// The board alone, by its corners: its shape plays no part.
Result<std::unique_ptr<ObjectFusion>> make_fusion(const Installation& installation) {
  const NamedObject object{ObjectId(0), installation.objects.front().description.name};
  return ObjectFusion::create(installation.estimator, {&object, 1}, {});
}

// The states of the complete rig at the frames in which each camera itself sees the board.
Status count_states(const Installation& installation, const std::vector<Sight>& sights,
                    std::vector<CameraResult>& results) {
  SL_ASSIGN(const auto fusion, make_fusion(installation));
  for (const Sight& sight : sights) {
    const UpdateReport& report = fusion->process({&sight.observation, 1}).front();
    CameraResult& result = results[sight.observation.camera.index()];
    ++result.frames;
    if (!sight.corners || sight.corners->matches().size() < kEnoughCorners) continue;
    ++result.seen;
    result.tracking += report.estimate.state == TrackState::kTracking;
  }
  return {};
}

// The pose at `time` by all that the others measured around it: of the estimates up to a round of
// free-running cameras away, moved to `time`, the one that is known best there. A track holds what
// was known at each time, so a neighbor that heard one camera more may know better.
std::optional<PoseEstimate> best_known(const PoseTrack& track, Time time,
                                       const MotionNoise& noise) {
  constexpr Duration kRound = std::chrono::milliseconds(40);
  std::optional<PoseEstimate> best;
  for (const PoseEstimate& estimate : track.history()) {
    if (!has_pose(estimate.state) || estimate.state == TrackState::kCoasting) continue;
    if (estimate.time < time - kRound || estimate.time > time + kRound) continue;
    const PoseEstimate moved = predict(estimate, time, noise);
    if (!best || moved.pose_covariance().trace() < best->pose_covariance().trace()) best = moved;
  }
  if (best) return best;
  const PoseAt between = track.at(time);
  const bool inside =
      between.source == PoseSource::kInterpolated || between.source == PoseSource::kEstimated;
  return inside ? std::optional(between.estimate) : std::nullopt;
}

Status leave_out(const Installation& installation, const std::vector<Sight>& sights,
                 CameraId left_out, CameraResult& result) {
  SL_ASSIGN(const auto fusion, make_fusion(installation));
  std::vector<const Sight*> waiting;  // until the others have been past their time
  const auto settle = [&](Time now) {
    while (!waiting.empty() &&
           waiting.front()->observation.capture + std::chrono::milliseconds(60) < now) {
      const Sight& sight = *waiting.front();
      const auto pose =
          best_known(*fusion->tracks()[0], sight.observation.capture, installation.estimator.noise);
      const double error = pose ? corner_error(*sight.corners, pose->world_from_object) : -1;
      if (error >= 0) {
        result.interpolated.px.push_back(error);
      } else {
        ++result.without_pose;
      }
      waiting.erase(waiting.begin());
    }
  };
  for (const Sight& sight : sights) {
    if (sight.observation.camera != left_out) {
      fusion->process({&sight.observation, 1});
      settle(sight.observation.capture);
      continue;
    }
    if (!sight.corners || sight.corners->matches().size() < kEnoughCorners) continue;
    waiting.push_back(&sight);
    const PoseAt live = fusion->tracks()[0]->at(sight.observation.capture);
    if (live.source == PoseSource::kNone) continue;
    const double error = corner_error(*sight.corners, live.estimate.world_from_object);
    if (error >= 0) result.predicted.px.push_back(error);
  }
  return {};
}

Result<std::vector<CameraResult>> measure(const std::filesystem::path& folder) {
  SL_ASSIGN(Recording opened, open_recording(folder));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(const Installation installation, recording_installation(folder));
  SL_ASSIGN(const Rig rig, load_rig(installation));
  SL_ASSIGN(const auto sights, observe_all(installation, rig, recording));
  std::vector<CameraResult> results(installation.cameras.size());
  for (size_t i = 0; i < results.size(); ++i) results[i].name = installation.cameras[i].name;
  SL_RETURN_IF_ERROR(count_states(installation, sights, results));
  for (size_t i = 0; i < results.size(); ++i) {
    const CameraId left_out(static_cast<uint32_t>(i));
    SL_RETURN_IF_ERROR(leave_out(installation, sights, left_out, results[i]));
  }
  return results;
}

void print_text(std::vector<CameraResult>& results) {
  fmt::print(
      "                                 corners predicted from the other cameras [px]\n"
      "                                 at the frame's time   live (prediction only)\n"
      "camera    frames seen tracking   median   p95          median   p95    no pose\n");
  for (CameraResult& r : results) {
    fmt::print("{:<9} {:6} {:4} {:8} {:8.2f} {:5.2f} {:15.2f} {:5.2f} {:10}\n", r.name, r.frames,
               r.seen, r.tracking, r.interpolated.quantile(0.5), r.interpolated.quantile(0.95),
               r.predicted.quantile(0.5), r.predicted.quantile(0.95), r.without_pose);
  }
}

void print_json(std::vector<CameraResult>& results) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (CameraResult& r : results) {
    json.push_back({{"camera", r.name},
                    {"frames", r.frames},
                    {"seen", r.seen},
                    {"tracking", r.tracking},
                    {"without_pose", r.without_pose},
                    {"median_px", r.interpolated.quantile(0.5)},
                    {"p95_px", r.interpolated.quantile(0.95)},
                    {"live_median_px", r.predicted.quantile(0.5)},
                    {"live_p95_px", r.predicted.quantile(0.95)}});
  }
  fmt::print("{}\n", json.dump(2));
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  using namespace sightline;
  if (argc < 2) {
    std::fprintf(stderr, "usage: leave_one_out RECORDING [--json]\n");
    return 2;
  }
  auto results = measure(argv[1]);
  if (!results) {
    std::fprintf(stderr, "leave_one_out: %s\n", results.error().message().c_str());
    return exit_code(results.error());
  }
  const bool json = argc > 2 && std::strcmp(argv[2], "--json") == 0;
  json ? print_json(*results) : print_text(*results);
  return 0;
}
