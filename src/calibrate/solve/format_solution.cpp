// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/solve.hpp"

namespace sightline {

using namespace calibrate;

std::string format_solution(const RigSolution& solution, const std::string& date,
                            const std::string& remark) {
  std::vector<CalibratedCamera> cameras;
  std::vector<CalibrationSigmas> sigmas;
  for (const SolvedCamera& solved : solution.cameras) {
    CalibrationSigmas s;
    const int count = coefficient_count(solved.camera.model.parameters().lens);
    if (!solved.lens_known) s.distortion.assign(static_cast<size_t>(count), 0);
    for (size_t i = 0; i < solved.estimates.size(); ++i) {
      const int column = solved.lens_columns[i];
      const double sigma = solved.estimates[i].sigma;
      double* const first[] = {&s.fx, &s.fy, &s.cx, &s.cy};
      if (column < 4) *first[column] = sigma;
      if (column >= 4 && column < kTimeOffset && !s.distortion.empty()) {
        s.distortion[static_cast<size_t>(column - 4)] = sigma;
      }
    }
    const Vector6 place = solved.place_covariance().diagonal().cwiseSqrt();
    s.rotation = place.head<3>();
    s.translation = place.tail<3>();
    cameras.push_back(solved.camera);
    sigmas.push_back(std::move(s));
  }
  return format_calibration(cameras, sigmas, date, remark);
}

}  // namespace sightline
