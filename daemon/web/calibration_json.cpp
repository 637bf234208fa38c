// SPDX-License-Identifier: Apache-2.0
#include "web/calibration_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegrees = 180 / std::numbers::pi;

Json rows(const double* values, int count, int columns) {
  Json out = Json::array();
  for (int i = 0; i < count; i += columns) {
    Json row = Json::array();
    for (int k = 0; k < columns; ++k) row.push_back(values[i + k]);
    out.push_back(std::move(row));
  }
  return out;
}

}  // namespace

void add_calibration(const CameraWatch& watch, const Rigid3& world_from_camera,
                     const std::filesystem::path& proposal, Json& camera) {
  Json json{{"state", to_string(watch.state)},
            {"compared_s", std::round(watch.compared_s * 10) / 10},
            {"vote", watch.vote}};
  if (is_wrong(watch.state) || watch.state == CalibrationState::kDisputed) {
    json["since_utc_ns"] = utc_ns_of(watch.since);
  }
  if (is_wrong(watch.state)) {
    json["since_start"] = watch.since_start;
    json["turned_deg"] = watch.correction.head<3>().norm() * kDegrees;
    json["shifted_mm"] = watch.correction.tail<3>().norm() * 1e3;
    // Row-major; the covariance is symmetric.
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> proposed =
        (world_from_camera * Rigid3::exp(watch.correction)).matrix();
    json["proposed"] = {{"world_from_camera", rows(proposed.data(), 16, 4)},
                        {"calibrated_from_now", rows(watch.correction.data(), 6, 6)[0]},
                        {"covariance", rows(watch.covariance.data(), 36, 6)}};
    if (!proposal.empty()) json["proposed"]["file"] = proposal.string();
  }
  if (watch.state == CalibrationState::kDrifting) {
    json["drift_deg_per_hour"] = watch.rate.head<3>().norm() * kDegrees * 3600;
    json["drift_mm_per_hour"] = watch.rate.tail<3>().norm() * 1e3 * 3600;
  }
  camera["calibration"] = std::move(json);
}

}  // namespace sightline
