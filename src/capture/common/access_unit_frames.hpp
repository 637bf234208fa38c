// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "capture/common/frame_decoder.hpp"
#include "sightline/capture/common/capture_counters.hpp"
#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::capture {

/// Frames of a stream whose images come out of the decoder some time after their access units went
/// in: finds what belongs to an image, and counts the units that gave none. One thread.
class AccessUnitFrames {
 public:
  AccessUnitFrames(std::unique_ptr<AccessUnitDecoder> decoder, std::shared_ptr<ImagePool> pool,
                   std::shared_ptr<CaptureCounters> counters);

  /// Whether decoding has begun, or can begin with this unit; others are of no use.
  bool accepts(std::span<const uint8_t> unit);
  /// The bytes are copied.
  Status push(std::span<const uint8_t> unit, const FrameInfo& frame);
  /// Whether images may still come.
  bool pending() const { return decoded_ < pushed_; }
  /// The frame of the next image; null: none within `limit`. Units that were passed over count as
  /// damaged, and as dropped before this frame.
  Result<FramePtr> pull(Duration limit);

 private:
  const std::unique_ptr<AccessUnitDecoder> decoder_;
  const std::shared_ptr<ImagePool> pool_;
  const std::shared_ptr<CaptureCounters> counters_;
  std::vector<FrameInfo> frames_;      // a ring, by number of the unit
  uint64_t pushed_ = 0, decoded_ = 0;  // the last numbers that went in and came out
  bool begun_ = false;
};

}  // namespace sightline::capture
