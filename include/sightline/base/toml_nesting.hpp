// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"

namespace sightline {

/// Levels of one kind that a TOML file may have: brackets within brackets, names in a dotted key.
constexpr size_t kMaxTomlNesting = 32;

/// Refuses text that is nested deeper than that, before a parser sees it: toml++ frees its tables
/// recursively, so that a header of some thousand dotted names ends the process. One pass over the
/// text, no memory. The error's place is "WHERE:line:column". What is no TOML at all is not its
/// concern.
Status check_toml_nesting(std::string_view text, const std::string& where);

}  // namespace sightline
