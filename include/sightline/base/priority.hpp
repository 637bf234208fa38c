// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline {

/// How far threads leave the processor to others that want it, when there is too little of it: what
/// captures, draws and sends at all does not (docs/operation.md, "Too little CPU").
constexpr int kObserveNice = 4;  ///< measuring, frame by frame
constexpr int kSearchNice = 6;   ///< looking for what has no pose: tracked objects go first
constexpr int kPointsNice = 10;  ///< stereo points

/// The calling thread, and those that it starts from then on, leave the processor to others that
/// want it: by so much more than now, 1 a little, 19 all of it. What the system refuses is let be.
void give_way(int nice);

}  // namespace sightline
