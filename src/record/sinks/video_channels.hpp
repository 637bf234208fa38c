// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "record/sinks/mcap_file.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline::record {

/// The streams' H.264 in an MCAP file: /cameras/NAME/video of foxglove.CompressedVideo, a packet a
/// message. Each camera begins with a key frame, and goes on with one after a gap.
class VideoChannels {
 public:
  /// True if the packet was appended.
  bool append(McapFile& file, const ViewPacket& packet);

 private:
  struct Camera {
    uint16_t channel = 0;
    uint64_t number = 0;
    bool whole = false;  // nothing is missing since a key frame
  };
  uint16_t schema_ = 0;  // 0: none yet
  std::map<std::string, Camera> cameras_;
};

/// RFC 4648, with padding.
std::string base64(const std::vector<uint8_t>& bytes);

}  // namespace sightline::record
