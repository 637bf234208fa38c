// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "capture/aravis/aravis_ref.hpp"

namespace sightline::capture {

/// What a camera adds behind an image ("chunk data"): the exposure time that this image had and
/// the camera's own number of it.
class AravisChunks {
 public:
  struct Values {
    std::optional<double> exposure_us;
    std::optional<uint64_t> frame_id;
  };

  /// Switches chunk data on where the camera offers these and `use` is set, else off: data that
  /// another program left on would lie behind, or in place of, the image. Never fails: what the
  /// camera refuses is not used.
  static AravisChunks set_up(ArvCamera* camera, bool use);

  bool active() const { return parser_ != nullptr; }
  /// Of a complete buffer.
  Values read(ArvBuffer* buffer) const;

 private:
  ObjectRef<ArvChunkParser> parser_;
  bool exposure_ = false, frame_id_ = false;
};

}  // namespace sightline::capture
