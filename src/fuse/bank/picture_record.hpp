// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "fuse/bank/outcome.hpp"
#include "fuse/bank_state.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::fuse {

/// Notes what the images of the set say of the whole silhouette under `best` (null: no hypothesis).
/// Each camera has two fading means: the share of the silhouette that is not explained or missing,
/// and how often the object is not seen where it has to be. The means over the cameras that said
/// something lately make `state.unexplained` and `state.absent`, with hysteresis: one camera beside
/// which something of the object's color lies is outvoted by the others. Also whether all print
/// that was seen may be that of a flat picture (PrintSeen). A new or another pose starts anew.
void record_pictures(Time time, std::span<const Observation> set, const Outcome* best,
                     BankState& state);

}  // namespace sightline::fuse
