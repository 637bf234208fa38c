// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <numbers>

#include "sightline/calibrate/axes_report.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegree = std::numbers::pi / 180;

Json setting_json(const SolvedSetting& s) {
  Json json{{"recording", s.recording},
            {"time_s", s.time_s},
            {"moving", s.moving},
            {"used", s.used},
            {"pan_deg", s.pan_deg},
            {"tilt_deg", s.tilt_deg},
            {"pan_rate_deg_s", s.pan_rate_deg_s},
            {"tilt_rate_deg_s", s.tilt_rate_deg_s},
            {"zoom", s.zoom},
            {"images", s.images},
            {"corners", s.corners},
            {"rms_px", s.rms_px},
            {"pan_error_deg", s.angle_error_deg[0]},
            {"tilt_error_deg", s.angle_error_deg[1]}};
  if (s.held_out_px) json["held_out_px"] = *s.held_out_px;
  if (s.held_out_deg) json["held_out_deg"] = *s.held_out_deg;
  if (s.held_out_mm) json["held_out_mm"] = *s.held_out_mm;
  return json;
}

Json estimate_json(const AxesEstimate& e) {
  Json json{{"name", e.name}, {"unit", e.unit}, {"value", e.value}, {"sigma", e.sigma}};
  if (!e.held.empty()) json["held"] = e.held;
  return json;
}

}  // namespace

std::string axes_report_json(const AxesSolution& s, const AxesReport& r, const std::string& epoch) {
  const CameraAxes& axes = *s.camera.axes;
  Json json{{"epoch", epoch},
            {"camera", s.camera.name},
            {"grade", to_string(r.grade)},
            {"remarks", r.remarks},
            {"world", s.world},
            {"settings_at_rest", r.at_rest},
            {"settings_left_out", s.settings_left_out},
            {"images_in_motion", r.in_motion},
            {"corners", s.corners},
            {"rejected", s.rejected},
            {"rms_px", s.rms_px},
            {"sigma_px", s.sigma_px},
            {"reading_sigma_deg", s.reading_sigma / kDegree},
            {"latency_s", axes.latency_s},
            {"latency_sigma_s", axes.latency_sigma_s},
            {"jitter_s", s.jitter_s},
            {"pan_scale", axes.pan_scale},
            {"tilt_scale", axes.tilt_scale},
            {"backlash_deg", axes.backlash / kDegree},
            {"direction_sigma_deg", r.direction_deg},
            {"direction_sigma_worst_deg", r.direction_worst_deg},
            {"place_sigma_mm", r.place_mm},
            {"place_sigma_worst_mm", r.place_worst_mm},
            {"motion_deg", r.motion_deg},
            {"distance_m", r.distance},
            {"pan_range_deg", {r.pan_from_deg, r.pan_to_deg}},
            {"tilt_range_deg", {r.tilt_from_deg, r.tilt_to_deg}}};
  if (r.held_out_px) json["held_out_px"] = *r.held_out_px;
  if (r.held_out_deg) json["held_out_deg"] = *r.held_out_deg;
  if (r.held_out_mm) json["held_out_mm"] = *r.held_out_mm;
  json["estimates"] = Json::array();
  for (const AxesEstimate& e : s.estimates) json["estimates"].push_back(estimate_json(e));
  json["zoom"] = Json::array();
  for (const ZoomLens& lens : axes.zoom) {
    json["zoom"].push_back({{"setting", lens.setting},
                            {"fx", lens.fx},
                            {"fy", lens.fy},
                            {"cx", lens.cx},
                            {"cy", lens.cy},
                            {"sigma", lens.sigma}});
  }
  json["latency_curve"] = {{"latency_s", s.latency.latency_s}, {"rms_deg", s.latency.rms_deg}};
  json["settings"] = Json::array();
  for (const SolvedSetting& setting : s.settings) json["settings"].push_back(setting_json(setting));
  return json.dump(2) + "\n";
}

}  // namespace sightline
