// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "calibrate/report/correlations.hpp"
#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/assess.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

const char* name_of(LensModel lens) {
  return lens == LensModel::kFisheye    ? "fisheye"
         : lens == LensModel::kRational ? "rational"
                                        : "brown_conrady";
}

/// Pairs that the views hardly tell apart.
Json correlations(const SolvedCamera& solved) {
  Json list = Json::array();
  for (const calibrate::Correlation& one : calibrate::telling_correlations(solved)) {
    list.push_back({{"a", one.a}, {"b", one.b}, {"correlation", one.value}});
  }
  return list;
}

Json sigma_json(const ProjectionSigma& sigma) {
  return {{"distance_m", sigma.distance},
          {"center_px", sigma.center},
          {"edge_px", sigma.edge},
          {"worst_px", sigma.worst}};
}

Json camera_json(const SolvedCamera& solved, const CameraReport& report) {
  Json json{{"name", report.name},
            {"grade", to_string(report.grade)},
            {"remarks", report.remarks},
            {"model", name_of(solved.camera.model.parameters().lens)},
            {"lens_known", solved.lens_known},
            {"views", solved.views},
            {"corners", solved.corners},
            {"rejected", solved.rejected},
            {"rms_px", solved.camera.rms_px},
            {"coverage", report.coverage},
            {"tilt_deg", report.tilt_deg},
            {"depth_ratio", report.depth_ratio},
            {"working_distance_m", report.working_distance},
            {"time_offset_s", solved.time_offset_s},
            {"readout_s", solved.camera.readout_s},
            {"place_sigma_mm", report.place_sigma_mm},
            {"place_sigma_deg", report.place_sigma_deg}};
  if (report.held_out_px) json["held_out_px"] = *report.held_out_px;
  if (report.split_half) {
    const SplitHalf& h = *report.split_half;
    json["split_half"] = {{"center_mm", h.center_mm},
                          {"rotation_deg", h.rotation_deg},
                          {"median_px", h.median_px},
                          {"worst_px", h.worst_px},
                          {"median_mm", h.median_mm},
                          {"worst_mm", h.worst_mm},
                          {"columns", h.columns},
                          {"rows", h.rows},
                          {"px", h.px}};
  }
  if (report.sigma) {
    Json& json_sigma = json["projection_sigma"] = sigma_json(*report.sigma);
    json_sigma["columns"] = report.sigma->columns;
    json_sigma["rows"] = report.sigma->rows;
    json_sigma["px"] = report.sigma->values;
    json_sigma["by_distance"] = Json::array();
    for (const auto& sigma : {report.sigma_near, report.sigma, report.sigma_far}) {
      if (sigma) json_sigma["by_distance"].push_back(sigma_json(*sigma));
    }
  }
  for (const ParameterEstimate& e : solved.estimates) {
    json["parameters"].push_back({{"name", e.name}, {"value", e.value}, {"sigma", e.sigma}});
  }
  json["correlations"] = correlations(solved);
  return json;
}

}  // namespace

std::string report_json(const CalibrationViews& views, const RigSolution& solution,
                        const RigReport& report, const std::string& epoch) {
  Json json{{"epoch", epoch},
            {"grade", to_string(report.grade)},
            {"target", views.target.describe()},
            {"rms_px", solution.rms_px},
            {"sigma_px", solution.sigma_px},
            {"corners", solution.corners},
            {"rejected", solution.rejected},
            {"sets", views.sets},
            {"bend_mm", {1e3 * solution.bend.x(), 1e3 * solution.bend.y()}},
            {"bend_sigma_mm", {1e3 * solution.bend_sigma.x(), 1e3 * solution.bend_sigma.y()}}};
  if (report.held_out_px) json["held_out_px"] = *report.held_out_px;
  if (report.rigidity) {
    const RigidityReport& r = *report.rigidity;
    json["rigidity"] = {{"rms_mm", r.rms_mm},
                        {"adjacent_mm", r.adjacent_mm},
                        {"scale", r.scale},
                        {"distances", r.distances}};
  }
  json["cameras"] = Json::array();
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    json["cameras"].push_back(camera_json(solution.cameras[c], report.cameras[c]));
  }
  json["links"] = Json::array();
  for (const LinkReport& link : report.links) {
    json["links"].push_back({{"a", report.cameras[link.a].name},
                             {"b", report.cameras[link.b].name},
                             {"sets", link.sets}});
  }
  json["weakest_links"] = Json::array();
  for (const size_t i : report.weakest) json["weakest_links"].push_back(json["links"][i]);
  return json.dump(2) + "\n";
}

}  // namespace sightline
