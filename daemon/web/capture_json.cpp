// SPDX-License-Identifier: Apache-2.0
#include "web/capture_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "web/utc_text.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

const char* to_string(CapturePhase phase) {
  switch (phase) {
    case CapturePhase::kOff:
      return "off";
    case CapturePhase::kRunning:
      return "running";
    case CapturePhase::kSolving:
      return "solving";
    case CapturePhase::kDone:
      return "done";
    case CapturePhase::kFailed:
      return "failed";
  }
  return "";
}

double rounded(double value) { return std::round(value * 1000) / 1000; }

Json camera_json(const CaptureShown& shown, size_t index) {
  const CameraProgress& p = shown.state.progress[index];
  const ViewedCamera& camera = shown.cameras[index];
  const CoverageCells& cells = shown.coverage[index];
  Json json{{"name", camera.name},
            {"width", camera.width},
            {"height", camera.height},
            {"images", p.images},
            {"seen", p.seen},
            {"views", p.views},
            {"views_needed", p.lens_known ? shown.needs.known_views : shown.needs.views},
            {"lens_known", p.lens_known},
            {"coverage", rounded(p.coverage)},
            {"depth_ratio", rounded(p.depth_ratio)},
            {"tilted",
             {{"left", p.tilted[0]},
              {"right", p.tilted[1]},
              {"top", p.tilted[2]},
              {"bottom", p.tilted[3]}}},
            {"complete", p.complete},
            {"share", rounded(p.share)},
            {"columns", cells.columns},
            {"rows", cells.rows},
            {"cells", cells.corners}};
  const std::string& problem = shown.state.cameras[index].problem;
  if (!problem.empty()) json["problem"] = problem;
  return json;
}

/// Where the target is wanted next, if that is in one camera's picture.
void add_wanted(const CaptureShown& shown, Json& json) {
  const CaptureAdvice& advice = shown.state.advice;
  if (shown.phase != CapturePhase::kRunning || advice.kind != CaptureAdvice::Kind::kShow) return;
  if (advice.camera >= shown.cameras.size()) return;
  json["wanted"] = {{"camera", shown.cameras[advice.camera].name}};
  if (!advice.region) return;
  json["wanted"]["column"] = advice.region->column;
  json["wanted"]["row"] = advice.region->row;
}

}  // namespace

std::string capture_json(const CaptureShown& shown) {
  Json json{{"state", to_string(shown.phase)}};
  if (shown.phase == CapturePhase::kOff) return json.dump() + "\n";
  json["words"] = shown.words;
  json["hint"] = shown.hint;
  json["share"] = rounded(std::clamp(shown.state.share, 0.0, 1.0));
  json["sets"] = shown.state.sets;
  json["target"] = shown.target;
  json["moving"] = shown.moving;
  json["readouts"] = shown.readouts;
  json["keep_lenses"] = shown.keep_lenses;
  json["folder"] = shown.folder.string();
  json["since"] = utc_text(shown.since_utc_ns);
  add_wanted(shown, json);
  json["cameras"] = Json::array();
  for (size_t c = 0; c < shown.cameras.size(); ++c) {
    json["cameras"].push_back(camera_json(shown, c));
  }
  json["links_needed"] = shown.needs.links;
  json["links"] = Json::array();
  for (const LinkReport& link : shown.links) {
    json["links"].push_back({{"cameras", {shown.cameras[link.a].name, shown.cameras[link.b].name}},
                             {"sets", link.sets}});
  }
  if (shown.grade) json["grade"] = sightline::to_string(*shown.grade);
  if (shown.grade) json["remarks"] = shown.remarks;
  // What cameras and files are called need not be UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string capture_targets_json(const std::vector<NamedTarget>& targets) {
  Json json = Json::array();
  for (const NamedTarget& one : targets) {
    json.push_back({{"name", one.name}, {"words", one.target.describe()}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace sightline
