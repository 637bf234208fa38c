// SPDX-License-Identifier: Apache-2.0
// `sightline merge`: one recording of those that several hosts have made.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "cell/cell_commands.hpp"
#include "report.hpp"
#include "sightline/pipeline/merge_recordings.hpp"

namespace sightline::cli {
namespace {

struct MergeOptions {
  std::vector<std::filesystem::path> folders;  // the last one is made
};

int merge(const MergeOptions& options) {
  std::vector<std::filesystem::path> folders = options.folders;
  const std::filesystem::path out = folders.back();
  folders.pop_back();
  const auto merged = merge_recordings(
      folders, out, [&out](const std::string& file) { fmt::print("{}\n", (out / file).string()); });
  if (!merged) return report(merged.error());
  for (const std::string& warning : merged->warnings) fmt::print(stderr, "{}\n", warning);
  fmt::print(stderr, "{} cameras, {} frames\n", merged->cameras, merged->frames);
  return 0;
}

}  // namespace

void add_merge(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<MergeOptions>();
  CLI::App* command =
      app.add_subcommand("merge", "one recording of those that several hosts made at one time");
  command->add_option("RECORDINGS", options->folders, "folders to merge, then the folder to make")
      ->required()
      ->expected(3, 257)
      ->option_text("A B... OUT");
  command->callback([options, &chosen] { chosen = [options] { return merge(*options); }; });
}

}  // namespace sightline::cli
