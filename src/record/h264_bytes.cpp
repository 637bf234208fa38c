// SPDX-License-Identifier: Apache-2.0
#include "h264_bytes.hpp"

#include <algorithm>
#include <cstddef>

namespace sightline {
namespace {

enum NalType : uint8_t { kIdr = 5, kSps = 7, kPps = 8 };

uint8_t nal_type(std::span<const uint8_t> nal) { return nal.empty() ? 0 : nal[0] & 31u; }

void append_unit(std::vector<uint8_t>& out, std::span<const uint8_t> nal) {
  static constexpr uint8_t kStart[] = {0, 0, 0, 1};
  out.insert(out.end(), std::begin(kStart), std::end(kStart));
  out.insert(out.end(), nal.begin(), nal.end());
}

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
      append_unit(avc.parameter_sets, unit);
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
  const bool has_own = std::any_of(units.begin(), units.end(),
                                   [](const auto& unit) { return nal_type(unit) == kSps; });
  std::vector<uint8_t> out;
  out.reserve(packet.size() + avc.parameter_sets.size());
  if (keyframe && !has_own) out = avc.parameter_sets;
  for (const auto& unit : units) append_unit(out, unit);
  return out;
}

std::vector<std::span<const uint8_t>> annex_b_units(std::span<const uint8_t> bytes) {
  static constexpr uint8_t kStart[] = {0, 0, 1};
  std::vector<std::span<const uint8_t>> units;
  auto start = std::search(bytes.begin(), bytes.end(), std::begin(kStart), std::end(kStart));
  while (start != bytes.end()) {
    const auto first = start + 3;
    start = std::search(first, bytes.end(), std::begin(kStart), std::end(kStart));
    auto last = start;
    while (last != first && *(last - 1) == 0) --last;  // trailing zeros belong to the start code
    if (last != first) units.emplace_back(first, last);
  }
  return units;
}

std::vector<uint8_t> annex_b_parameter_sets(std::span<const uint8_t> bytes) {
  std::vector<uint8_t> sets;
  bool sps = false, pps = false;
  for (const auto& unit : annex_b_units(bytes)) {
    const uint8_t type = nal_type(unit);
    if (type != kSps && type != kPps) continue;
    (type == kSps ? sps : pps) = true;
    append_unit(sets, unit);
  }
  if (!sps || !pps) sets.clear();
  return sets;
}

bool annex_b_has_idr(std::span<const uint8_t> bytes) {
  const auto units = annex_b_units(bytes);
  return std::any_of(units.begin(), units.end(),
                     [](const auto& unit) { return nal_type(unit) == kIdr; });
}

}  // namespace sightline
