// SPDX-License-Identifier: Apache-2.0
#include "web/utc_text.hpp"

#include <ctime>

namespace sightline {

std::string utc_text(int64_t utc_ns) {
  const auto seconds = static_cast<time_t>(utc_ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

}  // namespace sightline
