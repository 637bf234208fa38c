// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/last_poses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"

namespace sightline {
namespace {

constexpr size_t kMaxBytes = 1 << 20;  // 255 objects need a tenth of it

std::filesystem::path from_environment(const char* name) {
  const char* value = std::getenv(name);
  const std::filesystem::path path = value != nullptr ? value : "";
  return path.is_absolute() ? path : std::filesystem::path();
}

}  // namespace

std::filesystem::path state_folder() {
  const std::string service = from_environment("STATE_DIRECTORY").string();
  if (!service.empty()) return service.substr(0, service.find(':'));
  if (const auto user = from_environment("XDG_STATE_HOME"); !user.empty()) {
    return user / "sightline";
  }
  const auto home = from_environment("HOME");
  return home.empty() ? home : home / ".local" / "state" / "sightline";
}

std::filesystem::path last_poses_file(const Installation& installation) {
  const std::filesystem::path folder = state_folder();
  if (folder.empty()) return folder;
  std::error_code error;
  const auto file = std::filesystem::absolute(installation.file, error);
  return folder / fmt::format("last_poses_{:016x}.csv", content_hash(file.string()));
}

Result<std::vector<PoseLogRow>> load_last_poses(const std::filesystem::path& file) {
  const auto text = read_file(file, kMaxBytes);
  if (!text && text.error().code == ErrorCode::kNotFound) return std::vector<PoseLogRow>();
  if (!text) return text.error();
  SL_ASSIGN(auto rows, parse_pose_log(*text, file.string()));
  std::erase_if(rows, [](const PoseLogRow& row) { return !row.world_from_object; });
  return rows;
}

std::vector<PoseLogRow> read_last_poses(const std::filesystem::path& file) {
  auto rows = load_last_poses(file);
  if (rows) return *std::move(rows);
  log::warning("the last poses are of no use, objects are searched for everywhere: {}",
               rows.error().message());
  return {};
}

Status write_last_poses(const std::filesystem::path& file, const std::vector<PoseLogRow>& rows) {
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  if (error) {
    return make_error(ErrorCode::kIo, file.parent_path().string(), "cannot make the folder: {}",
                      error.message());
  }
  std::string text(kPoseLogHeader);
  text += '\n';
  for (const PoseLogRow& row : rows) text += format_pose_row(row) + "\n";
  return write_file_atomically(file, text);
}

}  // namespace sightline
