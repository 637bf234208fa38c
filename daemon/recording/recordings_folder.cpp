// SPDX-License-Identifier: Apache-2.0
#include "recording/recordings_folder.hpp"

#include <algorithm>
#include <ctime>

namespace sightline {

namespace fs = std::filesystem;

namespace {

constexpr uintmax_t kMinFreeBytes = uintmax_t{64} << 20;
constexpr std::string_view kPattern = "########T######Z";  // of a time, # a digit

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string ending(RecordingKind kind) {
  return kind == RecordingKind::kSource ? std::string() : fmt::format("-{}", to_string(kind));
}

}  // namespace

fs::path new_recording_folder(const fs::path& directory, RecordingKind kind) {
  const auto now = static_cast<time_t>(utc_now_ns() / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%dT%H%M%SZ", &parts);
  const std::string name = text + ending(kind);
  fs::path folder = directory / name;
  std::error_code ignored;
  for (int i = 2; fs::exists(folder, ignored); ++i) {
    folder = directory / fmt::format("{}-{}", name, i);
  }
  return folder;
}

std::optional<RecordingKind> recording_kind_of(std::string_view name) {
  if (name.size() < kPattern.size()) return std::nullopt;
  for (size_t i = 0; i < kPattern.size(); ++i) {
    const bool good = kPattern[i] == '#' ? is_digit(name[i]) : name[i] == kPattern[i];
    if (!good) return std::nullopt;
  }
  std::string_view rest = name.substr(kPattern.size());
  RecordingKind found = RecordingKind::kSource;
  for (const RecordingKind kind : {RecordingKind::kViewing, RecordingKind::kPoses}) {
    if (!rest.starts_with(ending(kind))) continue;
    found = kind;
    rest.remove_prefix(ending(kind).size());
  }
  const bool numbered = rest.size() > 1 && rest.size() < 8 && rest[0] == '-' &&
                        std::ranges::all_of(rest.substr(1), is_digit);
  return rest.empty() || numbered ? std::optional(found) : std::nullopt;
}

Error recording_folder_error(const fs::path& folder, const std::error_code& fault) {
  return make_error(ErrorCode::kIo, folder.string(),
                    "recordings cannot be written there: {}; give the daemon's user the right to "
                    "it, or choose another record.directory",
                    fault.message());
}

// A disk that is all but full would give one stump of a recording after the other.
Status check_recording_space(const fs::path& directory) {
  std::error_code fault;
  const fs::space_info space = fs::space(directory, fault);
  if (fault) return recording_folder_error(directory, fault);
  if (space.available >= kMinFreeBytes) return {};
  return make_error(ErrorCode::kIo, directory.string(),
                    "the disk is full: {} MiB are free, a recording starts when {} are",
                    space.available >> 20, kMinFreeBytes >> 20);
}

}  // namespace sightline
