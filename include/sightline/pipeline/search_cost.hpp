// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/time.hpp"
#include "sightline/observe/detect/search_work.hpp"

namespace sightline {

/// How long a thread that has a core to itself takes for such work, on the machine that the
/// figures of docs/detection.md are from. A model, not a measurement: the same everywhere.
Duration search_cost(const SearchWork& work);

}  // namespace sightline
