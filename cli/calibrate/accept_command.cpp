// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "calibrate/calibrate_commands.hpp"
#include "report.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/pipeline/calibration_proposal.hpp"
#include "sightline/pipeline/last_poses.hpp"

namespace sightline::cli {
namespace {

struct AcceptOptions {
  std::filesystem::path config, proposal, state;
  std::vector<std::string> cameras;
  bool json = false;
};

Result<std::filesystem::path> find_proposal(const AcceptOptions& o,
                                            const Installation& installation) {
  if (!o.proposal.empty()) return o.proposal;
  const auto state = o.state.empty() ? state_folder() : o.state;
  const auto file = proposal_file(installation.calibration, state);
  if (!file.empty() && std::filesystem::exists(file)) return file;
  return make_error(ErrorCode::kInvalidInput, state.string(),
                    "nothing is proposed for {}: a daemon puts its proposals into its state folder "
                    "(--state DIR; /var/lib/sightline for the service) or names the file in "
                    "/api/v1/cameras (--proposal FILE)",
                    installation.calibration.string());
}

Status run_accept(const AcceptOptions& o) {
  SL_ASSIGN(const Installation installation, read_installation(o.config));
  SL_ASSIGN(const auto proposal, find_proposal(o, installation));
  SL_ASSIGN(const Acceptance accepted,
            accept_proposal(installation.calibration, proposal, o.cameras));
  if (o.json) {
    nlohmann::ordered_json json{{"calibration", installation.calibration.string()},
                                {"kept", accepted.kept.string()}};
    for (const AcceptedCamera& c : accepted.cameras) {
      json["cameras"].push_back(
          {{"name", c.name}, {"turned_deg", c.turned_deg}, {"shifted_mm", c.shifted_mm}});
    }
    fmt::print("{}\n", json.dump(2));
    return {};
  }
  for (const AcceptedCamera& c : accepted.cameras) {
    fmt::print("camera {}: turned {:.3f} deg, shifted {:.2f} mm\n", c.name, c.turned_deg,
               c.shifted_mm);
  }
  fmt::print("written: {}\nthe one before: {}\n", installation.calibration.string(),
             accepted.kept.string());
  fmt::print("a running daemon takes it over at the next reload (systemctl reload sightlined)\n");
  return {};
}

}  // namespace

void add_calibrate_accept(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<AcceptOptions>();
  auto* command = parent.add_subcommand(
      "accept", "takes over what a running daemon proposes for a camera that has moved");
  command->add_option("--config", options->config, "the installation file")->required();
  command->add_option("--proposal", options->proposal,
                      "the proposed calibration, where it is not in the state folder");
  command->add_option("--state", options->state, "the daemon's state folder");
  command->add_option("--camera", options->cameras, "this camera only; may be given again");
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = run_accept(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
