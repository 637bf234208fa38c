// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "calibrate/watch/patch_match.hpp"
#include "sightline/calibrate/scene_watch.hpp"

namespace sightline::calibrate {

/// Patches of a room as a camera that stands where its calibration says sees them.
struct SceneReference {
  int width = 0, height = 0;  ///< of the half-size image
  std::vector<ScenePatch> patches;
};

/// Parts of the image, in thirds, in which there are patches.
int covered_ninths(std::span<const ScenePatch> patches, int width, int height);

/// Learns the patches of a room from some looks at it: corners that stay where they are.
class SceneLearner {
 public:
  /// `taken` cells get none.
  void begin(std::vector<char> taken);
  /// One look; `moving(pixel)`: not part of the room. True: learned.
  template <typename Moving>
  bool step(const PlaneView& image, const Moving& moving) {
    if (looks_ == 0) {
      start(image);
      std::erase_if(candidates_, [&](const Candidate& c) { return moving(c.patch.pixel); });
    } else {
      for (Candidate& c : candidates_) c.misses += moving(c.patch.pixel) ? kLooks : 0;
      follow(image);
    }
    return ++looks_ >= kLooks;
  }
  /// Of the looks since begin(), which it begins anew.
  std::vector<ScenePatch> take();

 private:
  static constexpr int kLooks = 6;
  struct Candidate {
    ScenePatch patch;
    PatchTemplate ready;
    int cell = 0;
    int misses = 0;
    int added = 1;
    std::array<uint16_t, size_t{kPatchSide} * kPatchSide> sum{};
  };
  void start(const PlaneView& image);
  void follow(const PlaneView& image);

  std::vector<Candidate> candidates_;
  std::vector<char> taken_;
  int looks_ = 0;
};

}  // namespace sightline::calibrate
