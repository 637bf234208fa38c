// SPDX-License-Identifier: Apache-2.0
// calibrate_rig CAMERAS [SETS_PER_CAMERA [FACES]]: solves a synthetic ring, each target seen by few
// cameras, and prints time, errors against the claimed sigmas, and how far the ring has drifted
// (JSON). With FACES, of a pillar with fixed tags in the middle, each set is seen by two neighbors
// only; it may be 0.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "calibrate/synthetic_views.hpp"

int main(int argc, char** argv) {
  using namespace sightline;
  const size_t cameras = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 24;
  const size_t sets = cameras * (argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 25);
  const size_t faces = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 0;
  const test::SyntheticRig rig = test::make_rig({.cameras = cameras,
                                                 .sets = sets,
                                                 .noise_px = 0.3,
                                                 .pillar = faces,
                                                 .two_at_a_time = argc > 3});
  const auto start = std::chrono::steady_clock::now();
  const auto solution = solve_rig(rig.views, {});
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (!solution) {
    std::fprintf(stderr, "%s\n", solution.error().message().c_str());
    return 1;
  }
  double worst_mm = 0, worst_deg = 0, squares = 0, count = 0, worst_sigma_mm = 0, beyond = 0;
  for (size_t c = 0; c < cameras; ++c) {
    const SolvedCamera& solved = solution->cameras[c];
    if (!solved.has_place) continue;
    const Rigid3& truth = rig.truth[c].world_from_camera;
    const Vector6 d = difference(solved.camera.world_from_camera, truth);
    const Vector6 sigma = solved.place_covariance().diagonal().cwiseSqrt();
    for (int i = 0; i < 6; ++i) {
      squares += d[i] * d[i] / (sigma[i] * sigma[i]);
      beyond += std::abs(d[i]) > 3 * sigma[i];
      count += 1;
    }
    worst_mm =
        std::max(worst_mm, 1e3 * translation_distance(solved.camera.world_from_camera, truth));
    worst_deg =
        std::max(worst_deg, 57.29578 * rotation_angle(solved.camera.world_from_camera, truth));
    worst_sigma_mm = std::max(worst_sigma_mm, 1e3 * sigma.tail<3>().maxCoeff());
  }
  const nlohmann::ordered_json json{{"cameras", cameras},
                                    {"sets", sets},
                                    {"faces", faces},
                                    {"corners", solution->corners},
                                    {"seconds", seconds},
                                    {"iterations", solution->iterations},
                                    {"rms_px", solution->rms_px},
                                    {"worst_place_mm", worst_mm},
                                    {"worst_turn_deg", worst_deg},
                                    {"worst_claimed_sigma_mm", worst_sigma_mm},
                                    {"mean_square_of_normalized_errors", squares / count},
                                    {"share_beyond_3_sigma", beyond / count}};
  std::printf("%s\n", json.dump(2).c_str());
  return 0;
}
