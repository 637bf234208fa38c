// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/log.hpp"

namespace sightline::base {

/// For log::history(), where that was asked for. Any thread.
void keep_for_history(log::Level level, std::string_view line, const log::Fields& fields);

}  // namespace sightline::base
