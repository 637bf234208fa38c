// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "sightline/image/h264.hpp"

/// Units lie inside the stream in order, and putting them behind start codes again gives the same
/// units; what was escaped comes back.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::vector<uint8_t> stream(data, data + size);
  std::vector<uint8_t> joined;
  size_t units = 0, end = 0;
  NalReader reader(stream);
  while (const auto unit = reader.next()) {
    const auto body = static_cast<size_t>(unit->body.data() - stream.data());
    if (unit->body.empty() || unit->begin < end || body < unit->begin + 3) std::abort();
    end = body + unit->body.size();
    if (end > size) std::abort();
    append_nal_unit(unit->body, joined);
    ++units;
  }
  NalReader again(joined);
  while (again.next()) --units;
  if (units != 0) std::abort();
  if (annex_b_has_idr(stream) != annex_b_has_idr(joined) ||
      annex_b_can_start_decoding(stream) != annex_b_can_start_decoding(joined) ||
      annex_b_parameter_sets(stream) != annex_b_parameter_sets(joined)) {
    std::abort();
  }
  std::vector<uint8_t> escaped = {0, 0, 1, 0x06};
  append_escaped(stream, escaped);
  if (unescaped(std::span(escaped).subspan(4)) != stream) std::abort();
  return 0;
}
