// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/result.hpp"

namespace sightline::cli {

/// Prints the error to stderr as "sightline: WHERE: TEXT" and returns its exit status.
int report(const Error& error);

}  // namespace sightline::cli
