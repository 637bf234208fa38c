// SPDX-License-Identifier: Apache-2.0
// `sightline doctor`: what is wrong with this host, in plain words.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "doctor/host_checks.hpp"

namespace sightline::cli {
namespace {

struct DoctorOptions {
  std::filesystem::path root = "/";
  bool json = false;
};

const char* name_of(HostState state) {
  switch (state) {
    case HostState::kGood:
      return "good";
    case HostState::kAdvice:
      return "advice";
    case HostState::kWrong:
      return "wrong";
  }
  return "";
}

int doctor(const DoctorOptions& options) {
  std::vector<HostFinding> findings;
  check_devices(options.root, findings);
  check_usb(options.root, findings);
  check_network(options.root, findings);
  check_temperature(options.root, findings);
  check_clock(findings);
  check_encoder(findings);
  const bool wrong = std::ranges::any_of(
      findings, [](const HostFinding& finding) { return finding.state == HostState::kWrong; });
  if (options.json) {
    nlohmann::ordered_json json{{"ok", !wrong}, {"findings", nlohmann::ordered_json::array()}};
    for (const HostFinding& finding : findings) {
      json["findings"].push_back({{"subject", finding.subject},
                                  {"state", name_of(finding.state)},
                                  {"text", finding.text}});
    }
    fmt::print("{}\n", json.dump(2));
  } else {
    for (const HostFinding& finding : findings) {
      fmt::print("{:<7} {:<12} {}\n", name_of(finding.state), finding.subject, finding.text);
    }
  }
  return wrong ? 3 : 0;
}

}  // namespace

void add_doctor(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<DoctorOptions>();
  CLI::App* command = app.add_subcommand("doctor", "what is wrong with this host, in plain words");
  command->add_option("--root", options->root,
                      "folder in which dev, proc and sys are looked for (default: /)");
  command->add_flag("--json", options->json, "print JSON");
  command->callback([options, &chosen] { chosen = [options] { return doctor(*options); }; });
}

}  // namespace sightline::cli
