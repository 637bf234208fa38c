// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/shape/known_object.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline {

struct BackgroundOptions {
  Duration learn = std::chrono::milliseconds(500);  ///< at least, before anything is said
  Duration absorb = std::chrono::seconds(60);  ///< what lies still for so long becomes background
  bool operator==(const BackgroundOptions&) const = default;
};

/// What one fixed camera sees when nothing is there: for every pixel of the half-size image the
/// usual luma and color and their spread, and one rival that replaces them when it has been seen
/// for longer, so that what was learned from an object at rest goes away after it left. A common
/// factor on the light is estimated for every frame and taken out; when most of the image is new
/// (a lamp, a knock at the camera) it says that it is not ready and learns again.
///
/// One thread at a time. Nothing is allocated after the first frame. No clock is read: the same
/// frames give the same maps.
class BackgroundModel {
 public:
  /// Refused: durations that are not positive.
  static Result<std::unique_ptr<BackgroundModel>> create(const CalibratedCamera& camera,
                                                         const BackgroundOptions& options = {});
  ~BackgroundModel();

  /// True if learn() would use a frame of this time: every one at first, one in 0.1 s later.
  bool wants(Time capture) const;
  /// Learns from the frame, except where `known` objects are. Frames that are not wanted, damaged
  /// or of another size are ignored. About 0.7 ms at first, 0.2 ms later (640x480).
  void learn(const Frame& frame, std::span<const KnownObject> known);

  /// Enough has been learned, and the newest images look like it.
  bool ready() const;
  /// What is new in this frame; pixels of `others` are unknown. False, and `out` is empty, if the
  /// model is not ready or does not fit the frame. About 1 ms (640x480).
  bool foreground(const Frame& frame, std::span<const KnownObject> others,
                  ForegroundMap& out) const;

 private:
  class Impl;
  explicit BackgroundModel(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
