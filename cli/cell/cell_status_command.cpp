// SPDX-License-Identifier: Apache-2.0
// `sightline cell status`: who is there, as the broker tells it.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "cell/cell_commands.hpp"
#include "report.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/publish/cell/cell_survey.hpp"
#include "sightline/publish/cell/observation_gate.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

constexpr Duration kToConnect = 5s;
constexpr Duration kTurn = 50ms;
constexpr const char* kRoles[] = {"both", "cameras", "fusion"};

struct StatusOptions {
  std::filesystem::path config;
  double seconds = 2.5;
  bool json = false;
};

Result<CellSurvey> listen(const CellOptions& cell, Duration span) {
  CellSurvey survey(cell.name, cell.neighbors);
  MqttSession session;
  session.subscriptions = survey.subscriptions();
  session.on_message = [&survey](std::string_view topic, std::string_view payload, bool) {
    survey.hear(topic, payload, utc_now_ns());
  };
  SL_ASSIGN(const auto client, MqttClient::create(cell.broker, std::move(session)));
  Time end = MonotonicClock::now() + kToConnect;
  bool connected = false;
  for (Time now = MonotonicClock::now(); now < end; now = MonotonicClock::now()) {
    client->step(std::min<Duration>(kTurn, end - now), -1);
    if (connected == client->connected()) continue;
    if (connected) break;
    connected = true;
    end = MonotonicClock::now() + span;
  }
  if (client->connected()) return survey;
  const std::string problem = client->problem();
  return make_error(
      ErrorCode::kUnavailable, fmt::format("{}:{}", cell.broker.host, cell.broker.port),
      "the broker of the cell is not to be reached: {}", problem.empty() ? "no answer" : problem);
}

Json verdict_json(const CellSurvey& survey) {
  Json json = Json::object();
  const size_t count = std::min(survey.verdicts().size(), kCellVerdicts);
  for (size_t i = 0; i < count; ++i) {
    json[std::string(to_string(static_cast<CellVerdict>(i)))] = survey.verdicts()[i];
  }
  return json;
}

Json host_json(const std::string& name, const CellSurvey::Host& host, const CellSurvey& survey,
               double seconds) {
  Json json{{"host", name},
            {"online", host.state.online},
            {"role", kRoles[static_cast<size_t>(host.state.role)]},
            {"fuses", host.fuses && host.state.online},
            {"clock_fit", host.state.clock_fit},
            {"clock_bound_s", to_seconds(host.state.clock_bound)},
            {"clock", host.state.clock},
            {"cameras", Json::array()}};
  if (!host.state.page.empty()) json["page"] = host.state.page;
  for (const CellHostState::Camera& camera : host.state.cameras) {
    const auto heard = survey.cameras().find(camera.name);
    const bool any = heard != survey.cameras().end();
    Json entry{{"name", camera.name}, {"observations", any ? heard->second.observations : 0}};
    entry["rate_hz"] = any ? static_cast<double>(heard->second.observations) / seconds : 0;
    if (any) entry["oldest_s"] = to_seconds(heard->second.oldest);
    entry["away"] = camera.away;
    json["cameras"].push_back(std::move(entry));
  }
  return json;
}

void print_json(const CellOptions& cell, const CellSurvey& survey, double seconds) {
  Json json{{"cell", cell.name},
            {"broker", fmt::format("{}:{}", cell.broker.host, cell.broker.port)},
            {"listened_s", seconds},
            {"whole", survey.faults().empty()},
            {"fusion", survey.fusion()},
            {"hosts", Json::array()},
            {"objects", Json::array()},
            {"observations", verdict_json(survey)},
            {"malformed", survey.malformed()},
            {"faults", survey.faults()}};
  for (const auto& [name, host] : survey.hosts()) {
    json["hosts"].push_back(host_json(name, host, survey, seconds));
  }
  for (const auto& [name, object] : survey.objects()) {
    json["objects"].push_back({{"object", name},
                               {"state", std::string(to_string(object.state))},
                               {"tracks", object.tracks},
                               {"cameras", object.cameras}});
  }
  for (const auto& [name, neighbor] : survey.neighbors()) {
    Json objects = Json::array();
    for (const auto& [object, holds] : neighbor.bids) {
      objects.push_back({{"object", object}, {"publishes", holds}});
    }
    json["neighbors"].push_back(
        {{"cell", name}, {"fusion", neighbor.fusion}, {"objects", std::move(objects)}});
  }
  fmt::print("{}\n", json.dump(2));
}

void print_table(const CellOptions& cell, const CellSurvey& survey, double seconds) {
  const std::string fusion = survey.fusion();
  fmt::print("cell {} at {}:{}, listened to for {} s; {} keeps the estimates\n", cell.name,
             cell.broker.host, cell.broker.port, seconds, fusion.empty() ? "nobody" : fusion);
  fmt::print("{:<16} {:<8} {:<8} {:>10}  {}\n", "host", "", "role", "clock", "cameras [1/s]");
  for (const auto& [name, host] : survey.hosts()) {
    std::vector<std::string> cameras;
    for (const CellHostState::Camera& camera : host.state.cameras) {
      const auto heard = survey.cameras().find(camera.name);
      const bool own = host.fuses;  // its own observations do not travel
      const double rate = heard == survey.cameras().end()
                              ? 0
                              : static_cast<double>(heard->second.observations) / seconds;
      cameras.push_back(own ? camera.name : fmt::format("{} {:.0f}", camera.name, rate));
    }
    fmt::print("{:<16} {:<8} {:<8} {:>7.2f} ms  {}\n", name, host.state.online ? "here" : "away",
               kRoles[static_cast<size_t>(host.state.role)],
               1e3 * to_seconds(host.state.clock_bound), fmt::join(cameras, ", "));
  }
  for (const auto& [name, object] : survey.objects()) {
    fmt::print("object {}: {}, {:.0f} estimates a second, by {}\n", name, to_string(object.state),
               static_cast<double>(object.tracks) / seconds, fmt::join(object.cameras, ", "));
  }
  for (const auto& [name, neighbor] : survey.neighbors()) {
    std::vector<std::string> objects;
    for (const auto& [object, holds] : neighbor.bids) {
      objects.push_back(holds ? object + " (publishes it)" : object);
    }
    fmt::print(
        "next cell {}: {} keeps the estimates; sees {}\n", name,
        neighbor.fusion.empty() ? "nobody" : neighbor.fusion,
        objects.empty() ? "none of the objects here" : fmt::format("{}", fmt::join(objects, ", ")));
  }
  std::string counts;
  const size_t known = std::min(survey.verdicts().size(), kCellVerdicts);
  for (size_t i = 0; i < known; ++i) {
    if (i > 0 && survey.verdicts()[i] == 0) continue;
    counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", survey.verdicts()[i],
                          to_string(static_cast<CellVerdict>(i)));
  }
  if (!counts.empty()) fmt::print("observations since {} was started: {}\n", fusion, counts);
  for (const std::string& fault : survey.faults()) fmt::print("! {}\n", fault);
}

Result<bool> status(const StatusOptions& options) {
  SL_ASSIGN(const Installation installation, read_installation(options.config));
  const CellOptions& cell = installation.cell;
  if (!cell.enabled()) {
    return make_error(ErrorCode::kInvalidInput, options.config.string(),
                      "is no host of a cell: [cell] names no broker");
  }
  SL_ASSIGN(const CellSurvey survey, listen(cell, from_seconds(options.seconds)));
  if (options.json) {
    print_json(cell, survey, options.seconds);
  } else {
    print_table(cell, survey, options.seconds);
  }
  return survey.faults().empty();
}

}  // namespace

void add_cell_status(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<StatusOptions>();
  CLI::App* command = app.add_subcommand(
      "status", "who is there, who keeps the estimates, what the clocks are worth");
  command->add_option("--config", options->config, "installation file of a host of the cell")
      ->required();
  command->add_option("--seconds", options->seconds, "to listen at the broker (default: 2.5)")
      ->check(CLI::Range(0.1, 3600.0));
  command->add_flag("--json", options->json, "print JSON");
  command->callback([options, &chosen] {
    chosen = [options] {
      const auto whole = status(*options);
      if (!whole) return report(whole.error());
      return *whole ? 0 : 1;
    };
  });
}

}  // namespace sightline::cli
