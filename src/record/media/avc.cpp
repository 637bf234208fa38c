// SPDX-License-Identifier: Apache-2.0
#include "record/media/avc.hpp"

#include <algorithm>
#include <cstddef>

#include "sightline/image/h264.hpp"

namespace sightline::record {
namespace {

/// Takes a big-endian length of `size` bytes and so many bytes; empty when they are not there.
std::span<const uint8_t> take_unit(std::span<const uint8_t>& rest, size_t size) {
  if (rest.size() < size) return {};
  size_t length = 0;
  for (size_t i = 0; i < size; ++i) length = length << 8 | rest[i];
  if (length == 0 || length > rest.size() - size) return {};
  const auto unit = rest.subspan(size, length);
  rest = rest.subspan(size + length);
  return unit;
}

}  // namespace

AvcConfiguration parse_avc_configuration(std::span<const uint8_t> extradata) {
  AvcConfiguration avc;
  if (extradata.size() < 7 || extradata[0] != 1) {
    avc.parameter_sets = annex_b_parameter_sets(extradata);
    return avc;
  }
  avc.length_size = (extradata[4] & 3) + 1;
  auto rest = extradata.subspan(5);
  for (const uint8_t mask : {uint8_t{31}, uint8_t{255}}) {  // SPS, then PPS
    if (rest.empty()) break;
    const int count = rest[0] & mask;
    rest = rest.subspan(1);
    for (int i = 0; i < count; ++i) {
      const auto unit = take_unit(rest, 2);
      if (unit.empty()) return avc;
      append_nal_unit(unit, avc.parameter_sets);
    }
  }
  return avc;
}

std::vector<uint8_t> to_annex_b(std::span<const uint8_t> packet, const AvcConfiguration& avc,
                                bool keyframe) {
  std::vector<std::span<const uint8_t>> units;
  for (auto rest = packet; !rest.empty();) {
    const auto unit = take_unit(rest, static_cast<size_t>(avc.length_size));
    if (unit.empty()) break;
    units.push_back(unit);
  }
  const bool has_own = std::any_of(units.begin(), units.end(), [](const auto& unit) {
    return nal_type(unit) == NalType::kSequenceParameterSet;
  });
  std::vector<uint8_t> out;
  out.reserve(packet.size() + avc.parameter_sets.size());
  if (keyframe && !has_own) out = avc.parameter_sets;
  for (const auto& unit : units) append_nal_unit(unit, out);
  return out;
}

}  // namespace sightline::record
