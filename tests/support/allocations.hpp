// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace sightline::test {

/// How often this program has called operator new so far. Link allocations.cpp.
size_t allocations();

}  // namespace sightline::test
