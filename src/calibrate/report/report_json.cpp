// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <nlohmann/json.hpp>

#include "calibrate/solve/lens_projection.hpp"
#include "sightline/calibrate/assess.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kTellingCorrelation = 0.9;

const char* name_of(LensModel lens) {
  return lens == LensModel::kFisheye    ? "fisheye"
         : lens == LensModel::kRational ? "rational"
                                        : "brown_conrady";
}

/// Pairs of lens parameters that the views hardly tell apart.
Json correlations(const SolvedCamera& solved) {
  Json list = Json::array();
  for (size_t i = 0; i < solved.estimates.size(); ++i) {
    for (size_t j = i + 1; j < solved.estimates.size(); ++j) {
      const double value =
          solved.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) /
          (solved.estimates[i].sigma * solved.estimates[j].sigma);
      if (std::abs(value) < kTellingCorrelation) continue;
      list.push_back({{"a", solved.estimates[i].name},
                      {"b", solved.estimates[j].name},
                      {"correlation", value}});
    }
  }
  return list;
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
            {"place_sigma_mm", report.place_sigma_mm},
            {"place_sigma_deg", report.place_sigma_deg}};
  if (report.held_out_px) json["held_out_px"] = *report.held_out_px;
  if (report.split_half) {
    const SplitHalf& h = *report.split_half;
    json["split_half"] = {{"center_mm", h.center_mm},
                          {"rotation_deg", h.rotation_deg},
                          {"median_px", h.median_px},
                          {"worst_px", h.worst_px},
                          {"median_mm", h.median_mm}};
  }
  if (report.sigma) {
    json["projection_sigma"] = {{"center_px", report.sigma->center},
                                {"worst_px", report.sigma->worst},
                                {"columns", report.sigma->columns},
                                {"rows", report.sigma->rows},
                                {"px", report.sigma->values}};
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
  return json.dump(2) + "\n";
}

}  // namespace sightline
