// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "report.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/pipeline/file_check.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/record/recording.hpp"

namespace sightline::cli {
namespace {

struct CheckOptions {
  std::filesystem::path file;
  bool json = false;
};

using Json = nlohmann::ordered_json;

// A folder is a recording, anything else an installation file.
Result<Json> check_recording(const std::filesystem::path& folder) {
  SL_ASSIGN(const Recording recording, open_recording(folder, RecordingMode::kStrict));
  SL_ASSIGN(const Installation installation, recording_installation(folder));
  SL_RETURN_IF_ERROR([&]() -> Status {
    SL_ASSIGN([[maybe_unused]] const Rig rig, load_rig(installation));
    return {};
  }());
  return Json{{"kind", "recording"},
              {"name", recording.name},
              {"cameras", recording.cameras.size()},
              {"frames", recording.frame_count()},
              {"objects", recording.objects.size()},
              {"warnings", recording.warnings}};
}

Result<Json> check_installation(const std::filesystem::path& file) {
  SL_ASSIGN(const Installation installation, read_installation(file));
  SL_RETURN_IF_ERROR(check_files(installation));
  return Json{{"kind", "installation"},
              {"name", installation.name},
              {"cameras", installation.cameras.size()},
              {"objects", installation.objects.size()}};
}

int print_failure(const Error& error, bool json) {
  if (!json) return report(error);
  fmt::print("{}\n", Json{{"ok", false}, {"where", error.where}, {"error", error.text}}.dump(2));
  return exit_code(error);
}

int check(const CheckOptions& options) {
  std::error_code ignored;
  const bool folder = std::filesystem::is_directory(options.file, ignored);
  const auto checked = folder ? check_recording(options.file) : check_installation(options.file);
  if (!checked) return print_failure(checked.error(), options.json);
  if (options.json) {
    Json json{{"ok", true}};
    json.update(*checked);
    fmt::print("{}\n", json.dump(2));
    return 0;
  }
  fmt::print("{}: ok: {} '{}' with {} cameras and {} objects\n", options.file.string(),
             checked->at("kind").get<std::string>(), checked->at("name").get<std::string>(),
             checked->at("cameras").get<size_t>(), checked->at("objects").get<size_t>());
  return 0;
}

}  // namespace

void add_check(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<CheckOptions>();
  auto* command = app.add_subcommand("check", "validate an installation file");
  command->add_option("FILE", options->file, "installation file, or a recording")->required();
  command->add_flag("--json", options->json, "errors and summary as JSON");
  command->callback([options, &chosen] { chosen = [options] { return check(*options); }; });
}

}  // namespace sightline::cli
