// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sightline::record {

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

}  // namespace sightline::record
