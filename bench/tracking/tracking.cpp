// SPDX-License-Identifier: Apache-2.0
// The table of docs/accuracy.md: what the product's own chain (observers, estimator, detector) does
// on rendered images whose truth is known, beside what is asked of it.
//   tracking [--only NAME ...] [--seconds 4] [--seeds 2] [--shots DIR] [--sheets DIR] [--json FILE]
//            [--no-silhouettes]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "sequence.hpp"

namespace sightline::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kWrongMm = 20, kWrongDeg = 10;

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<ptrdiff_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

struct Honesty {
  std::vector<double> nees;
  double mean() const {
    double sum = 0;
    for (const double each : nees) sum += each;
    return nees.empty() ? 0 : sum / static_cast<double>(nees.size());
  }
  /// Share in the 95 % band of chi-square with six degrees of freedom.
  double inside() const {
    const auto in = std::count_if(nees.begin(), nees.end(),
                                  [](double each) { return each > 1.237 && each < 14.449; });
    return nees.empty() ? 0 : static_cast<double>(in) / static_cast<double>(nees.size());
  }
};

/// All sequences of one condition together.
struct Figures {
  std::vector<double> mm, deg, lateral, depth, step_ms, fuse_ms;
  std::map<TrackState, Honesty> honesty;
  std::map<TrackState, size_t> states;
  size_t sets = 0, within = 0, failures = 0, wrong = 0;
  double worst_tracking_mm = 0, worst_tracking_deg = 0;
  std::vector<double> found_ms;     ///< from when half of the object is seen to `tracking`
  std::vector<double> let_go_sets;  ///< from full cover to a state that is not tracking
  size_t never_found = 0;
  double detect_ms = 0;
  std::vector<double> find_ms;  ///< of searches that found something
  size_t searches = 0, faces = 0;
};

void add_errors(const Played& played, const Condition& condition, Figures& f) {
  const bool held = condition.start == Start::kHeld;
  size_t since_start = 0;
  for (const Sample& s : played.samples) {
    since_start = s.started ? 0 : since_start + 1;
    ++f.states[s.state];
    ++f.sets;
    f.within += s.failed ? 0 : 1;
    if (held && s.failed) ++f.failures;
    if (!has_pose(s.state)) continue;
    if (s.state == TrackState::kTracking) {
      f.wrong += s.mm > kWrongMm || s.deg > kWrongDeg;
      f.worst_tracking_mm = std::max(f.worst_tracking_mm, s.mm);
      f.worst_tracking_deg = std::max(f.worst_tracking_deg, s.deg);
    }
    if (s.started || (held && since_start <= condition.settle)) continue;
    f.honesty[s.state].nees.push_back(s.nees);
    if (s.failed || s.state == TrackState::kCoasting) continue;
    f.mm.push_back(s.mm);
    f.deg.push_back(s.deg);
    f.lateral.push_back(s.lateral_mm);
    f.depth.push_back(s.depth_mm);
  }
}

void add_finding(const Played& played, Figures& f) {
  bool waiting = false;
  Time since{};
  std::optional<size_t> covered;
  bool tracked = false;
  for (size_t i = 0; i < played.samples.size(); ++i) {
    const Sample& s = played.samples[i];
    const bool seen = s.visible > 0.5;
    if (seen && !tracked && !waiting) waiting = true, since = s.time;
    if (s.state == TrackState::kTracking && waiting) {
      f.found_ms.push_back(1e3 * to_seconds(s.time - since));
      waiting = false;
    }
    if (s.state == TrackState::kTracking) tracked = true;
    if (s.visible == 0 && !covered && tracked) covered = i;
    if (covered && s.state != TrackState::kTracking) {
      if (tracked) f.let_go_sets.push_back(static_cast<double>(i - *covered));
      tracked = false;
    }
    if (seen) covered.reset();
  }
  f.never_found += waiting ? 1 : 0;
}

Result<Figures> measure(const Condition& condition, int seeds, const PlayOptions& options) {
  Figures f;
  for (int seed = 1; seed <= seeds; ++seed) {
    SL_ASSIGN(const Played played, play(condition, static_cast<uint64_t>(seed), options));
    add_errors(played, condition, f);
    if (condition.start == Start::kCold) add_finding(played, f);
    f.step_ms.insert(f.step_ms.end(), played.step_ms.begin(), played.step_ms.end());
    f.fuse_ms.insert(f.fuse_ms.end(), played.fuse_ms.begin(), played.fuse_ms.end());
    f.detect_ms += played.detect_ms / seeds;
    f.find_ms.insert(f.find_ms.end(), played.find_ms.begin(), played.find_ms.end());
    f.searches += played.searches;
    f.faces = played.faces;
  }
  return f;
}

Json to_json(const Condition& c, const Figures& f) {
  Json honesty = Json::object(), states = Json::object();
  for (const auto& [state, h] : f.honesty) {
    honesty[std::string(to_string(state))] = {
        {"count", h.nees.size()}, {"mean", h.mean()}, {"inside_95", h.inside()}};
  }
  for (const auto& [state, count] : f.states) states[std::string(to_string(state))] = count;
  const auto pair = [](const std::vector<double>& v) {
    return Json{{"median", quantile(v, 0.5)}, {"p90", quantile(v, 0.9)}};
  };
  return {{"name", c.name},
          {"what", c.what},
          {"sets", f.sets},
          {"success", static_cast<double>(f.within) / static_cast<double>(f.sets)},
          {"failures", f.failures},
          {"position_mm", pair(f.mm)},
          {"lateral_mm", pair(f.lateral)},
          {"depth_mm", pair(f.depth)},
          {"rotation_deg", pair(f.deg)},
          {"wrong_claims", f.wrong},
          {"worst_tracking_mm", f.worst_tracking_mm},
          {"worst_tracking_deg", f.worst_tracking_deg},
          {"nees", honesty},
          {"states", states},
          {"found_ms", f.found_ms},
          {"never_found", f.never_found},
          {"sets_to_let_go", f.let_go_sets},
          {"step_cpu_ms", pair(f.step_ms)},
          {"fuse_cpu_ms", pair(f.fuse_ms)},
          {"detect_cpu_ms", f.detect_ms},
          {"find_cpu_ms", pair(f.find_ms)},
          {"faces", f.faces}};
}

// What was asked for and missed, as words.
std::string verdict(const Condition& c, const Figures& f) {
  std::string text;
  const auto add = [&](const char* what, double got, std::optional<double> limit, bool at_least) {
    if (!limit) return;
    const bool met = at_least ? got >= *limit : got <= *limit;
    text += fmt::format("{}{} {:.3g}{}", text.empty() ? "" : ", ", what, *limit,
                        met ? " met" : " **missed**");
  };
  add("mm", quantile(f.mm, 0.5), c.targets.position_mm, false);
  add("depth mm", quantile(f.depth, 0.5), c.targets.depth_mm, false);
  add("deg", quantile(f.deg, 0.5), c.targets.rotation_deg, false);
  add("success", static_cast<double>(f.within) / static_cast<double>(f.sets), c.targets.success,
      true);
  return text;
}

void print(const Condition& c, const Figures& f) {
  const auto share = 100.0 * static_cast<double>(f.within) / static_cast<double>(f.sets);
  const auto tracking = f.honesty.find(TrackState::kTracking);
  fmt::print(
      "| {} | {:.1f} | {:.2f} / {:.2f} | {:.2f} / {:.2f} | {:.2f} / {:.2f} | {} | {} | {:.2f} | {} "
      "|\n",
      c.what, share, quantile(f.mm, 0.5), quantile(f.mm, 0.9), quantile(f.depth, 0.5),
      quantile(f.depth, 0.9), quantile(f.deg, 0.5), quantile(f.deg, 0.9), f.wrong,
      tracking == f.honesty.end() ? "-"
                                  : fmt::format("{:.1f} ({:.0f} %)", tracking->second.mean(),
                                                100 * tracking->second.inside()),
      quantile(f.step_ms, 0.5), verdict(c, f));
  if (c.start == Start::kCold) {
    fmt::print("|   found after [ms] |");
    for (const double ms : f.found_ms) fmt::print(" {:.0f}", ms);
    fmt::print(
        "; never {}; {} searches of {:.0f} ms, {:.0f} ms if it was found; let go after sets:",
        f.never_found, f.searches, f.detect_ms, quantile(f.find_ms, 0.5));
    for (const double sets : f.let_go_sets) fmt::print(" {:.0f}", sets);
    fmt::print("; worst while tracking {:.1f} mm {:.1f} deg |\n", f.worst_tracking_mm,
               f.worst_tracking_deg);
  }
  std::fflush(stdout);
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  using namespace sightline;
  using namespace sightline::bench;
  std::vector<std::string> only;
  std::string json_file;
  double seconds = 4;
  int seeds = 2;
  PlayOptions options;
  CLI::App app{"Tracking on rendered images, beside its targets"};
  app.add_option("--only", only, "conditions whose name starts so");
  app.add_option("--seconds", seconds, "of every sequence")->check(CLI::Range(0.5, 120.0));
  app.add_option("--seeds", seeds, "sequences of a condition")->check(CLI::Range(1, 100));
  app.add_option("--shots", options.shots, "keep rendered images in this folder");
  app.add_option("--sheets", options.sheets, "write contact sheets and error plots here");
  app.add_flag("!--no-silhouettes", options.silhouettes, "search without background models");
  app.add_option("--json", json_file, "write all figures here");
  CLI11_PARSE(app, argc, argv);

  fmt::print(
      "| condition | within 5 cm + 5 deg % | position mm, median / 90 % | depth mm | rotation deg "
      "| wrong claims | NEES while tracking (in band) | CPU ms per look | targets |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  Json all = Json::array();
  for (const Condition& condition : tracking_conditions(from_seconds(seconds))) {
    const bool chosen = only.empty() || std::any_of(only.begin(), only.end(), [&](const auto& o) {
                          return condition.name.rfind(o, 0) == 0;
                        });
    if (!chosen) continue;
    const auto figures = measure(condition, seeds, options);
    if (!figures) {
      fmt::print(stderr, "tracking: {}: {}\n", condition.name, figures.error().message());
      return exit_code(figures.error());
    }
    print(condition, *figures);
    all.push_back(to_json(condition, *figures));
  }
  if (!json_file.empty()) std::ofstream(json_file) << all.dump(1) << "\n";
  return 0;
}
