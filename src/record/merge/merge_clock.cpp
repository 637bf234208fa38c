// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <chrono>
#include <cstdio>

#include "sightline/base/files.hpp"
#include "sightline/record/merge.hpp"

namespace sightline {
namespace {

constexpr int64_t kSecond_ns = 1'000'000'000;
constexpr size_t kLargestManifest = size_t{1} << 20;

// ".25" as nanoseconds; what follows the ninth digit is let go.
int64_t fraction_ns(std::string_view& text) {
  if (!text.starts_with('.')) return 0;
  text.remove_prefix(1);
  int64_t value = 0, scale = kSecond_ns;
  while (!text.empty() && text[0] >= '0' && text[0] <= '9') {
    scale /= 10;
    value += scale * (text[0] - '0');
    text.remove_prefix(1);
  }
  return value;
}

}  // namespace

Result<int64_t> parse_rfc3339(std::string_view text, const std::string& where) {
  using namespace std::chrono;
  const std::string whole(text);
  const auto refuse = [&] {
    return make_error(ErrorCode::kInvalidInput, where,
                      "\"{}\" is no time with its zone, as in 2026-05-04T12:00:00Z", whole);
  };
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0, used = 0;
  const int read = std::sscanf(whole.c_str(), "%4d-%2d-%2d%*1[Tt ]%2d:%2d:%2d%n", &year, &month,
                               &day, &hour, &minute, &second, &used);
  const year_month_day date{std::chrono::year(year),
                            std::chrono::month(static_cast<unsigned>(month)),
                            std::chrono::day(static_cast<unsigned>(day))};
  const bool in_range = hour >= 0 && hour < 24 && minute >= 0 && minute < 60 && second >= 0 &&
                        second <= 60 && date.ok() && year >= 1970 && year < 2200;
  if (read != 6 || used == 0 || !in_range) return refuse();
  text.remove_prefix(static_cast<size_t>(used));
  const int64_t fraction = fraction_ns(text);
  int zone_min = 0;
  if (text != "Z" && text != "z") {
    int hours = 0, minutes = 0, end = 0;
    const std::string zone(text);
    if (zone.size() != 6 || (zone[0] != '+' && zone[0] != '-') ||
        std::sscanf(zone.c_str() + 1, "%2d:%2d%n", &hours, &minutes, &end) != 2 || end != 5) {
      return refuse();
    }
    zone_min = (zone[0] == '-' ? -1 : 1) * (60 * hours + minutes);
  }
  const int64_t days = sys_days(date).time_since_epoch().count();
  const int64_t seconds = ((days * 24 + hour) * 60 + minute - zone_min) * 60 + second;
  return seconds * kSecond_ns + fraction;
}

Result<MergePart> open_merge_part(const std::filesystem::path& folder) {
  MergePart part;
  SL_ASSIGN(part.recording, open_recording(folder));
  const std::string file = (folder / "recording.toml").string();
  SL_ASSIGN(const std::string text, read_file(file, kLargestManifest));
  SL_ASSIGN(part.manifest, parse_recording_toml(text, file));
  if (part.manifest.start_utc.empty() || !part.manifest.start_monotonic_ns) {
    return make_error(ErrorCode::kInvalidInput, file,
                      "does not say how its clock relates to UTC (start_utc, start_monotonic_ns): "
                      "it cannot be set beside others");
  }
  SL_ASSIGN(const int64_t utc, parse_rfc3339(part.manifest.start_utc, file));
  part.utc_minus_monotonic_ns = utc - *part.manifest.start_monotonic_ns;
  return part;
}

}  // namespace sightline
