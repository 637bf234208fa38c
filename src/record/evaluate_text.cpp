// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "sightline/record/evaluate.hpp"

namespace sightline {
namespace {

using nlohmann::ordered_json;

constexpr std::array kStates = {TrackState::kSearching, TrackState::kTracking,
                                TrackState::kDegraded, TrackState::kCoasting, TrackState::kLost};

std::string error_line(const std::string& name, const ErrorSummary& e) {
  return fmt::format("  {:<10} {:>6} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f}\n", name,
                     e.count, e.median_mm, e.p95_mm, e.max_mm, e.median_deg, e.p95_deg, e.max_deg);
}

double share_of(size_t part, size_t all) {
  return all == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(all);
}

ordered_json to_json(const ErrorSummary& e) {
  return {{"count", e.count},    {"median_mm", e.median_mm},   {"p95_mm", e.p95_mm},
          {"max_mm", e.max_mm},  {"median_deg", e.median_deg}, {"p95_deg", e.p95_deg},
          {"max_deg", e.max_deg}};
}

ordered_json to_json(const NormalizedError& e) {
  return {{"count", e.count},
          {"translation", e.translation},
          {"rotation", e.rotation},
          {"beyond", e.beyond}};
}

ordered_json to_json(const ObjectEvaluation& object) {
  ordered_json states = ordered_json::object(), rows = ordered_json::object();
  ordered_json normalized = ordered_json::object();
  for (const TrackState state : kStates) {
    const std::string name(to_string(state));
    rows[name] = object.state_rows[static_cast<size_t>(state)];
    const auto found = object.by_state.find(state);
    if (found != object.by_state.end()) states[name] = to_json(found->second);
    const auto claimed = object.normalized.find(state);
    if (claimed != object.normalized.end()) normalized[name] = to_json(claimed->second);
  }
  ordered_json wrong = ordered_json::array();
  for (const Time time : object.wrong_claims) wrong.push_back(to_ns(time));
  ordered_json out = {{"object", object.object},
                      {"logged_as", object.logged_as},
                      {"rows", object.rows},
                      {"state_rows", rows},
                      {"errors", to_json(object.all)},
                      {"errors_by_state", states},
                      {"normalized_by_state", normalized},
                      {"success", object.success()},
                      {"judged", object.judged},
                      {"within", object.within},
                      {"outside_truth", object.outside_truth},
                      {"wrong_claims", object.wrong_claims.size()},
                      {"wrong_claim_times_ns", wrong},
                      {"truth_times", object.truth_times},
                      {"covered", object.covered},
                      {"coverage", object.coverage()}};
  if (object.up_to_symmetry) {
    out["up_to_symmetry"] = {{"errors", to_json(object.up_to_symmetry->all)},
                             {"within", object.up_to_symmetry->within},
                             {"wrong_claims", object.up_to_symmetry->wrong_claims}};
  }
  return out;
}

}  // namespace

std::string to_text(const Evaluation& evaluation) {
  std::string text;
  for (const auto& object : evaluation.objects) {
    const bool own_name = object.logged_as == object.object;
    text += fmt::format("object {}{}: {} rows, {} with a pose and truth\n", object.object,
                        own_name ? "" : fmt::format(" (logged as {})", object.logged_as),
                        object.rows, object.all.count);
    text +=
        fmt::format("  {:<10} {:>6} {:>29} {:>29}\n", "", "", "translation [mm]", "rotation [deg]");
    text += fmt::format("  {:<10} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "state", "rows",
                        "median", "p95", "max", "median", "p95", "max");
    text += error_line("all", object.all);
    for (const auto& [state, errors] : object.by_state) {
      text += error_line(std::string(to_string(state)), errors);
    }
    for (const TrackState state : {TrackState::kSearching, TrackState::kLost}) {
      text += fmt::format("  {:<10} {:>6}\n", std::string(to_string(state)),
                          object.state_rows[static_cast<size_t>(state)]);
    }
    for (const auto& [state, e] : object.normalized) {
      text += fmt::format(
          "  {:<10} squared error over claimed variance {:.2f}, {:.2f} (honest: 1 to 3); {:.1f} % "
          "of rows beyond\n",
          std::string(to_string(state)), e.translation, e.rotation, 100 * e.beyond);
    }
    text += fmt::format("  within 5 cm + 5 deg {:.1f} % ({} of {})\n", 100.0 * object.success(),
                        object.within, object.judged);
    if (object.up_to_symmetry) {
      text += error_line("symmetric", object.up_to_symmetry->all);
      text += fmt::format("  symmetric: within 5 cm + 5 deg {:.1f} % ({} of {}), wrong claims {}\n",
                          share_of(object.up_to_symmetry->within, object.judged),
                          object.up_to_symmetry->within, object.judged,
                          object.up_to_symmetry->wrong_claims);
    }
    text += fmt::format("  wrong claims {}, outside the truth {}, coverage {:.1f} % ({} of {})\n",
                        object.wrong_claims.size(), object.outside_truth, 100.0 * object.coverage(),
                        object.covered, object.truth_times);
  }
  for (const auto& name : evaluation.without_truth) {
    text += fmt::format("object {}: no truth\n", name);
  }
  return text;
}

std::string to_json(const Evaluation& evaluation) {
  ordered_json objects = ordered_json::array();
  for (const auto& object : evaluation.objects) objects.push_back(to_json(object));
  const ordered_json all = {{"keyframes", evaluation.keyframes},
                            {"objects", objects},
                            {"without_truth", evaluation.without_truth}};
  // Names come from files: bytes that are not UTF-8 are replaced instead of thrown over.
  return all.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace sightline
