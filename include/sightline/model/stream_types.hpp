// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// An image on its way out, after render: pixels plus what was true at its capture time.
struct AnnotatedImage {
  FrameInfo frame;
  std::shared_ptr<const Image> image;
  std::vector<PoseAt> poses;  ///< one per object, at frame.capture
  /// When it goes out, if that is not frame.capture: an image that stands in while the camera is
  /// away wears the frame of the last real one. 0: as captured.
  Time shown{};
};

enum class Codec : uint8_t { kH264, kMjpeg };

/// One access unit of a camera's encoder. H.264 is Annex B with parameter sets before key frames.
struct EncodedPacket {
  CameraId camera;
  Codec codec = Codec::kH264;
  uint64_t sequence = 0;
  Time capture{};  ///< of the image; of one that stands in, when it was sent
  bool keyframe = false;
  std::shared_ptr<const std::vector<uint8_t>> bytes;
};

/// What is known of an object by name: for labels, logs and the wire.
struct NamedObject {
  ObjectId id;
  std::string name;
};

}  // namespace sightline
