// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "sightline/stream/sei.hpp"

/// A message that is accepted can be put into a video again and read back the same.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span<const uint8_t> unit(data, size);
  const auto message = sightline::parse_sei(unit);
  if (!message) return 0;
  const auto nal = sightline::make_sei_nal(*message);
  const auto again = sightline::parse_sei(nal);
  if (!again || again->camera != message->camera || again->sequence != message->sequence ||
      again->objects.size() != message->objects.size()) {
    std::abort();
  }
  if (sightline::insert_sei(unit, nal).size() != size + nal.size()) std::abort();
  return 0;
}
