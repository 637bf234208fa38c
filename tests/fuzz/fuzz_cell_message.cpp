// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "sightline/publish/cell/cell_bid.hpp"
#include "sightline/publish/cell/cell_messages.hpp"
#include "sightline/publish/cell/cell_order.hpp"
#include "sightline/publish/cell/frozen_observation.hpp"

/// What is accepted is finite wherever it is linearized, and the same after another journey.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (const auto observation = decode_observation(bytes)) {
    const std::string once = encode(*observation);
    const auto again = decode_observation(once);
    if (!again || encode(*again) != once) std::abort();
    const Observation thawed = thaw(*again, ObjectId(0), CameraId(0), Time{});
    for (const PoseTermPtr& term : thawed.terms) {
      const LinearizedTerm there = term->linearize(observation->at.front().reference);
      if (!there.gradient.allFinite() || !there.information.allFinite()) std::abort();
    }
  }
  if (const auto track = decode_track(bytes)) {
    const auto again = decode_track(encode(*track));
    if (!again || !again->estimate.covariance.allFinite()) std::abort();
  }
  if (const auto state = decode_host_state(bytes)) {
    if (!decode_host_state(encode(*state))) std::abort();
  }
  if (const auto order = decode_order(bytes)) {
    const std::string once = encode(*order);
    const auto again = decode_order(once);
    if (!again || encode(*again) != once) std::abort();
  }
  if (const auto bid = decode_bid(bytes)) {
    const std::string once = encode(*bid);
    const auto again = decode_bid(once);
    if (!again || encode(*again) != once) std::abort();
  }
  return 0;
}
