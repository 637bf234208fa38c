// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// What the fusion host of a cell says of an object to the neighboring cells: Holding
/// (hand_over.hpp) on the wire, times in the sender's UTC.
struct CellBid {
  std::string object, host;
  uint64_t boot = 0;
  uint64_t sequence = 0;
  int64_t time_utc_ns = 0;  ///< when it was sent
  TrackState state = TrackState::kSearching;
  double sigma = 0;
  bool holds = false;
  uint64_t term = 0;
  int64_t from_utc_ns = 0;   ///< 0: not said
  std::string next;          ///< cell; empty: none
  int64_t until_utc_ns = 0;  ///< 0: not said
};

std::string encode(const CellBid& bid);
/// Refuses what is not complete, as decode_observation() does.
Result<CellBid> decode_bid(std::string_view bytes);

}  // namespace sightline
