// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace sightline {

/// "2026-05-04T12:00:00Z"
std::string utc_text(int64_t utc_ns);

}  // namespace sightline
