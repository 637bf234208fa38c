// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sightline {

/// H.264 travels as Annex B (start codes) in this project and with length prefixes in Matroska
/// (ISO/IEC 14496-15). These go between the two.

/// What avcC says: width of the length prefixes and the parameter sets as Annex B.
struct AvcConfiguration {
  int length_size = 4;
  std::vector<uint8_t> parameter_sets;
};
/// From a stream's extradata (avcC or Annex B). Damaged input gives what could be read.
AvcConfiguration parse_avc_configuration(std::span<const uint8_t> extradata);

/// One access unit with start codes of four bytes; the parameter sets are put before a key frame
/// that does not bring its own. Stops at a length that does not fit.
std::vector<uint8_t> to_annex_b(std::span<const uint8_t> packet, const AvcConfiguration& avc,
                                bool keyframe);

/// Calls `visit(nal)` for every NAL unit of an Annex B access unit.
std::vector<std::span<const uint8_t>> annex_b_units(std::span<const uint8_t> bytes);

/// SPS and PPS of an access unit as Annex B; empty unless it has both.
std::vector<uint8_t> annex_b_parameter_sets(std::span<const uint8_t> bytes);
bool annex_b_has_idr(std::span<const uint8_t> bytes);

}  // namespace sightline
