// SPDX-License-Identifier: Apache-2.0
#include "web/calibration_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "sightline/base/files.hpp"
#include "system/system_status.hpp"

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
  if (watch.patches > 0) json["room_patches"] = watch.patches;
  if (watch.state == CalibrationState::kUnfit) {
    if (!watch.looks_like.empty()) json["looks_like"] = watch.looks_like;
    if (watch.zoom != 1) json["zoom"] = watch.zoom;
  }
  if (watch.state != CalibrationState::kUnknown && watch.state != CalibrationState::kInOrder) {
    json["since_utc_ns"] = utc_ns_of(watch.since);
  }
  if (is_wrong(watch.state)) {
    json["since_start"] = watch.since_start;
    json["by_room"] = watch.by_scene;
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

std::filesystem::path calibration_report_file(const Installation& installation) {
  return installation.calibration.parent_path() / "report.html";
}

std::string calibration_json(const System& system, const ConfigReport& config) {
  const Installation& now = system.installation;
  const auto watches = system.fusion ? system.fusion->calibration() : nullptr;
  Json json{{"file", now.calibration.string()},
            {"content", feed_names(system).calibration},
            {"watched", watches && system.calibration},
            {"report", config.calibration_report},
            {"cameras", Json::array()}};
  bool proposed = false;
  for (size_t i = 0; i < now.cameras.size(); ++i) {
    const CalibratedCamera& camera = now.cameras[i].calibration;
    Json entry{{"name", now.cameras[i].name},
               {"width", camera.model.width()},
               {"height", camera.model.height()},
               {"rms_px", camera.rms_px}};
    if (watches && system.calibration && i < watches->size() && observes(now.cameras[i].role)) {
      add_calibration((*watches)[i], camera.world_from_camera, system.calibration->proposal(),
                      entry);
      proposed = proposed || is_wrong((*watches)[i].state);
    }
    json["cameras"].push_back(std::move(entry));
  }
  if (proposed && !system.calibration->proposal().empty()) {
    json["proposal"] = system.calibration->proposal().string();
  }
  return json.dump(2) + "\n";
}

HttpReply report_reply(const std::filesystem::path& file, const std::string& missing) {
  constexpr size_t kMostBytes = 32 << 20;
  auto text = read_file(file, kMostBytes);
  if (!text) return HttpReply::error(404, missing);
  HttpReply reply{200, "text/html; charset=utf-8", *std::move(text)};
  // A file that somebody put there: it may show itself, and nothing else.
  reply.headers.emplace_back(
      "Content-Security-Policy",
      "default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
      "sandbox; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
  return reply;
}

}  // namespace sightline
