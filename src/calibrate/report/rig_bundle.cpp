// SPDX-License-Identifier: Apache-2.0
#include "calibrate/report/rig_bundle.hpp"

namespace sightline::calibrate {

Bundle rig_bundle(const CalibrationViews& views, const RigSolution& solution) {
  Bundle bundle;
  bundle.target = &views.target;
  bundle.bend = solution.bend;
  for (const SolvedCamera& solved : solution.cameras) {
    BundleCamera camera;
    camera.lens = solved.camera.model.parameters().lens;
    camera.values = lens_vector(solved.camera.model);
    camera.height = solved.camera.model.height();
    camera.values[kTimeOffset] = solved.time_offset_s;
    camera.values[kReadout] = solved.camera.readout_s;
    camera.world_from_camera = solved.camera.world_from_camera;
    camera.place_free = false;
    bundle.cameras.push_back(camera);
  }
  for (const auto& pose : solution.world_from_target) {
    bundle.world_from_target.push_back(pose.value_or(Rigid3()));
  }
  for (size_t v = 0; v < views.views.size(); ++v) {
    const TargetView& view = views.views[v];
    std::vector<char> used(view.corners.size(), 1);
    if (v < solution.used.size()) used = solution.used[v];
    bundle.views.push_back({&view, view.camera, view.set, std::move(used)});
  }
  return bundle;
}

}  // namespace sightline::calibrate
