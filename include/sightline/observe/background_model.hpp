// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

/// What is new in a picture, at half size.
struct ForegroundMap {
  enum Class : uint8_t {
    kBackground = 0,
    kShadow = 1,      ///< darker, but of the same colour: a shadow or a thing in the room's colour
    kForeground = 2,  ///< something else is in front
    kUnknown = 3,     ///< not learned yet, or another known object is there
  };
  int width = 0, height = 0;
  std::vector<uint8_t> classes;  ///< of every pixel, row by row
  double share = 0;              ///< of the known pixels that are shadow or foreground

  const uint8_t* row(int y) const {
    return classes.data() + static_cast<size_t>(y) * static_cast<size_t>(width);
  }
};

struct BackgroundOptions {
  Duration learn = std::chrono::milliseconds(500);  ///< at least, before anything is said
  Duration absorb = std::chrono::seconds(60);  ///< what lies still for so long becomes background
};

/// An object whose place is known; where it is, nothing is learned.
struct KnownObject {
  const ViewpointModel* views = nullptr;
  Rigid3 world_from_object;
};

/// What one fixed camera sees when nothing is there: for every pixel of the half-size picture the
/// usual luma and colour and their spread, and one rival that replaces them when it has been seen
/// for longer, so that what was learned from an object at rest goes away after it left. A common
/// factor on the light is estimated for every frame and taken out; when most of the picture is new
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

  /// Enough has been learned, and the newest pictures look like it.
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
