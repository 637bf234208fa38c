// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.hpp"
#include "detect/search_sheet.hpp"
#include "detect/set_search.hpp"
#include "report.hpp"
#include "sightline/record/overlay_video.hpp"

namespace sightline::cli {
namespace {

using Json = nlohmann::ordered_json;

struct DetectCommandOptions {
  SetSearchOptions search;
  std::filesystem::path contact_sheet;  ///< PNG; empty: none
  bool json = false;
};

// The value below which the share `q` lies; 0 of nothing.
double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(q * static_cast<double>(values.size() - 1))];
}

constexpr double kScored = 0.5;  // what a search may believe

// What has become of the truth, over all sets of one object.
struct StageTotals {
  size_t searches = 0;
  std::vector<size_t> ranks;  // of the searches that still had a right pose
};

struct ObjectTotals {
  size_t searches = 0;
  std::map<Verdict, size_t> verdicts;
  std::vector<double> cpu, wall;  // [ms]
  std::vector<std::string> stage_names;
  std::map<std::string, StageTotals> stages;
  size_t best_right = 0, explained = 0;
  std::vector<double> truth_seen;  // cameras whose tracker sees the true pose
  // SearchEvidence::second_share of the bests that score kScored.
  std::vector<double> second_of_right, second_of_wrong;

  void add(const SetResult& result) {
    ++searches;
    ++verdicts[result.verdict];
    cpu.push_back(result.cpu_ms);
    wall.push_back(result.wall_ms);
    if (result.explanation) add(*result.explanation);
  }

 private:
  void add(const Explanation& explanation) {
    if (explanation.best_score >= kScored) {
      (explanation.best_is_right ? second_of_right : second_of_wrong)
          .push_back(explanation.trace.best.second_share);
    }
    if (!explanation.at_truth) return;
    ++explained;
    best_right += explanation.best_is_right;
    double seen = 0;
    for (const TrackerView& view : explanation.at_truth->trackers) seen += view.seen;
    truth_seen.push_back(seen);
    for (size_t i = 0; i < explanation.trace.stages.size(); ++i) {
      const std::string& name = explanation.trace.stages[i].name;
      if (!stages.contains(name)) stage_names.push_back(name);
      StageTotals& stage = stages[name];
      ++stage.searches;
      if (explanation.ranks[i]) stage.ranks.push_back(*explanation.ranks[i]);
    }
  }
};

Json to_json(const ExplainedPose& pose) {
  const PoseAssessment& s = pose.stages;
  Json json{{"response_spread", s.spread_response},
            {"response", s.sharp_response},
            {"edge_share", s.edge_share},
            {"contrast", s.contrast},
            {"contour", s.contour},
            {"evidence", s.evidence},
            {"colors", pose.colors}};
  for (const TrackerView& view : pose.trackers) {
    json["trackers"].push_back({{"camera", view.camera},
                                {"seen", view.seen},
                                {"lines_used", view.lines_used},
                                {"lines_total", view.lines_total},
                                {"edges_used", view.edges_used},
                                {"points_used", view.points_used}});
  }
  return json;
}

Json to_json(const Rigid3& pose) {
  const Eigen::Vector3d& t = pose.translation;
  const Eigen::Quaterniond& q = pose.rotation;
  return {{"t_m", {t.x(), t.y(), t.z()}}, {"q_wxyz", {q.w(), q.x(), q.y(), q.z()}}};
}

Json to_json(const Explanation& explanation) {
  Json json{{"best_score", explanation.best_score},
            {"rival_score", explanation.rival_score},
            {"evidence",
             {{"edge_share", explanation.trace.best.edge_share},
              {"score", explanation.trace.best.score},
              {"rival_share", explanation.trace.best.rival_share},
              {"second_share", explanation.trace.best.second_share},
              {"colors", explanation.trace.best.colors}}},
            {"log_odds", explanation.trace.log_odds}};
  for (size_t i = 0; i < explanation.trace.stages.size(); ++i) {
    const auto& stage = explanation.trace.stages[i];
    Json row{{"stage", stage.name}, {"poses", stage.candidates.size()}, {"cpu_ms", stage.at_ms}};
    if (!explanation.ranks.empty()) {
      row["rank"] = explanation.ranks[i] ? Json(*explanation.ranks[i]) : Json();
    }
    json["stages"].push_back(row);
  }
  if (explanation.best) json["best"] = to_json(*explanation.best);
  if (explanation.at_truth) {
    json["best_is_right"] = explanation.best_is_right;
    json["best_is_near_turn"] = explanation.best_is_near_turn;
    json["at_truth"] = to_json(*explanation.at_truth);
  }
  if (explanation.at_best) json["at_best"] = to_json(*explanation.at_best);
  return json;
}

Json to_json(const SetResult& result) {
  Json json{{"t_ns", result.time.time_since_epoch().count()},
            {"verdict", to_string(result.verdict)},
            {"cpu_ms", result.cpu_ms},
            {"wall_ms", result.wall_ms}};
  for (const PoseHypothesis& pose : result.found) {
    json["found"].push_back(to_json(pose.world_from_object));
  }
  if (result.truth) json["truth"] = to_json(*result.truth);
  if (result.explanation) json["explanation"] = to_json(*result.explanation);
  return json;
}

void print(const char* name, const ExplainedPose& pose) {
  const PoseAssessment& s = pose.stages;
  fmt::print(
      "  {:<10} edge maps {:.2f} spread, {:.2f} sharp; edges {:.2f}, contrast {:.2f}; contour "
      "{:.2f}; evidence {:.2f}; colors {:.2f}; tracker",
      name, s.spread_response, s.sharp_response, s.edge_share, s.contrast, s.contour, s.evidence,
      pose.colors);
  for (const TrackerView& view : pose.trackers) {
    fmt::print(" {} {}/{}{}", view.camera, view.lines_used, view.lines_total,
               view.seen ? "" : " (not seen)");
  }
  fmt::print("\n");
}

void print(const Explanation& explanation) {
  fmt::print("  rank of the truth:");
  for (size_t i = 0; i < explanation.trace.stages.size(); ++i) {
    const auto& stage = explanation.trace.stages[i];
    const bool has_rank = !explanation.ranks.empty() && explanation.ranks[i];
    fmt::print(" {} {} of {} ({:.0f} ms)", stage.name,
               has_rank ? fmt::format("{}", *explanation.ranks[i]) : "-", stage.candidates.size(),
               stage.at_ms);
  }
  fmt::print("\n");
  if (explanation.at_truth) print("truth:", *explanation.at_truth);
  if (!explanation.at_best) return;
  print(explanation.best_is_right ? "best (ok):" : "best:", *explanation.at_best);
  fmt::print(
      "  score of the best {:.2f}, of the best at another place {:.2f} of that; rank of another "
      "pose at its place {:.2f} of its own; log odds {:.1f}\n",
      explanation.best_score,
      explanation.best_score > 0 ? explanation.rival_score / explanation.best_score : 0.0,
      explanation.trace.best.second_share, explanation.trace.log_odds);
}

void print(const std::string& object, const SetResult& result) {
  fmt::print("{:.3f} s {}: {}{}, {:.0f} ms of CPU, {:.0f} ms\n",
             to_seconds(result.time.time_since_epoch()), object, to_string(result.verdict),
             result.found.size() > 1 ? fmt::format(" ({})", result.found.size()) : "",
             result.cpu_ms, result.wall_ms);
  if (result.explanation) print(*result.explanation);
  std::fflush(stdout);
}

size_t count(const ObjectTotals& totals, Verdict verdict) {
  const auto found = totals.verdicts.find(verdict);
  return found == totals.verdicts.end() ? 0 : found->second;
}

void print_second_shares(const char* which, const std::vector<double>& shares) {
  if (shares.empty()) return;
  fmt::print(
      "  {} bests that score {} and more: {}; rank of another pose at their place: {:.2f} {:.2f} "
      "{:.2f} of their own (quartiles)\n",
      which, kScored, shares.size(), quantile(shares, 0.25), quantile(shares, 0.5),
      quantile(shares, 0.75));
}

void print_totals(const std::string& name, ObjectTotals totals) {
  fmt::print(
      "{}: {} searches: right {}, right among hypotheses {}, wrong {}, nothing {}, found without "
      "truth {}; CPU {:.0f} ms, {:.0f} ms (medians), {:.0f} ms (95 %)\n",
      name, totals.searches, count(totals, Verdict::kRight), count(totals, Verdict::kAmong),
      count(totals, Verdict::kWrong), count(totals, Verdict::kNothing),
      count(totals, Verdict::kNotComparable), quantile(totals.cpu, 0.5), quantile(totals.wall, 0.5),
      quantile(totals.wall, 0.95));
  for (const std::string& stage_name : totals.stage_names) {
    StageTotals& stage = totals.stages[stage_name];
    std::sort(stage.ranks.begin(), stage.ranks.end());
    fmt::print("  {:9} has the truth in {} of {}; ranks:", stage_name, stage.ranks.size(),
               stage.searches);
    for (const size_t rank : stage.ranks) fmt::print(" {}", rank);
    fmt::print("\n");
  }
  print_second_shares("right", totals.second_of_right);
  print_second_shares("wrong", totals.second_of_wrong);
  if (totals.explained == 0) return;
  fmt::print("  the best is right in {} of {}; trackers of {:.0f} cameras see the truth (median)\n",
             totals.best_right, totals.explained, quantile(totals.truth_seen, 0.5));
}

Json totals_json(const std::string& name, const ObjectTotals& totals) {
  Json json{{"object", name},
            {"searches", totals.searches},
            {"right", count(totals, Verdict::kRight)},
            {"right_among_hypotheses", count(totals, Verdict::kAmong)},
            {"wrong", count(totals, Verdict::kWrong)},
            {"nothing", count(totals, Verdict::kNothing)},
            {"found_without_truth", count(totals, Verdict::kNotComparable)},
            {"cpu_ms_median", quantile(totals.cpu, 0.5)},
            {"wall_ms_median", quantile(totals.wall, 0.5)},
            {"wall_ms_p95", quantile(totals.wall, 0.95)}};
  for (const std::string& stage_name : totals.stage_names) {
    const StageTotals& stage = totals.stages.at(stage_name);
    json["stages"].push_back({{"stage", stage_name},
                              {"searches", stage.searches},
                              {"with_truth", stage.ranks.size()},
                              {"ranks", stage.ranks}});
  }
  return json;
}

Status run(const DetectCommandOptions& options) {
  std::map<std::string, ObjectTotals> totals;
  Json sets = Json::array();
  SearchSheet sheet;
  Status drawn;
  const auto on_set = [&](const SearchedObject& object, const SetResult& result,
                          const std::vector<FramePtr>& frames) {
    totals[object.name].add(result);
    if (options.json) {
      sets.push_back(to_json(result));
      sets.back()["object"] = object.name;
    } else {
      print(object.name, result);
    }
    if (!options.contact_sheet.empty() && drawn) drawn = sheet.add(object, result, frames);
  };
  SL_RETURN_IF_ERROR(search_sets(options.search, on_set));
  SL_RETURN_IF_ERROR(drawn);
  if (totals.empty()) {
    return make_error(ErrorCode::kInvalidInput, options.search.recording.string(),
                      "holds no set of frames that could be searched");
  }
  if (const auto image = sheet.draw()) {
    SL_RETURN_IF_ERROR(write_png(options.contact_sheet, image->view()));
  }
  Json objects = Json::array();
  for (auto& [name, sum] : totals) {
    if (options.json) {
      objects.push_back(totals_json(name, sum));
    } else {
      print_totals(name, std::move(sum));
    }
  }
  if (options.json) fmt::print("{}\n", Json{{"objects", objects}, {"sets", sets}}.dump(2));
  return {};
}

int detect(const DetectCommandOptions& options) {
  const Status done = run(options);
  return done ? 0 : report(done.error());
}

}  // namespace

void add_detect(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<DetectCommandOptions>();
  SetSearchOptions& search = options->search;
  auto* command = app.add_subcommand(
      "detect", "search sets of frames of a recording, each by itself, and say what was found");
  command->add_option("RECORDING", search.recording, "folder of a recording")->required();
  command->add_option("--object", search.object, "name; default: each of the recording");
  command->add_option("--other-object", search.object_file,
                      "object file: look for this one, which is not there; whatever is found is "
                      "wrong");
  command->add_option("--camera", search.cameras, "takes part (default: all); may be repeated")
      ->allow_extra_args(false);
  command
      ->add_option("--every", search.every,
                   "search every N-th set of frames (default 10; where there are key frames, each)")
      ->check(CLI::PositiveNumber);
  command->add_option("--limit", search.limit, "stop after so many sets of an object")
      ->check(CLI::PositiveNumber);
  command->add_flag("--moving", search.moving,
                    "only where something has moved since the set that was searched before, if "
                    "anything has");
  command->add_flag("--explain", search.explain,
                    "where the truth stands after each stage, and what the stages and the trackers "
                    "say of it and of the best pose");
  command->add_option("--contact-sheet", options->contact_sheet,
                      "write a contact sheet of the first sets (PNG)");
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] { chosen = [options] { return detect(*options); }; });
}

}  // namespace sightline::cli
