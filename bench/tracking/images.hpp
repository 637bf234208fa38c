// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>

#include "sequence.hpp"
#include "sightline/pipeline/rig_parts.hpp"

namespace sightline::bench {

/// A contact sheet: what the streams would have shown, twelve images of the first camera evenly
/// over the sequence, each at half size.
class Images {
 public:
  /// `shots`: of all cameras together; 0: nothing is drawn.
  static Result<std::unique_ptr<Images>> create(const Installation& installation, const Rig& rig,
                                                size_t shots);
  /// Draws the overlay of the tracks as they are now.
  Status show(const Frame& frame, std::span<const PoseTrackPtr> tracks);
  Status write(const std::filesystem::path& path) const;

 private:
  std::unique_ptr<CameraRenderer> renderer_;
  std::unique_ptr<Image> sheet_;
  size_t every_ = 1, seen_ = 0, placed_ = 0;
};

/// Position error [mm] and rotation error [deg] over time on a logarithmic scale from 0.01 to 100
/// with a line at every power of ten; position above, rotation below. Color of the points: green
/// tracking, yellow degraded, orange coasting; a red bar where there is no pose, a gray one where
/// no camera sees half of the object.
Status write_error_plot(const std::filesystem::path& path, std::span<const Sample> samples);

}  // namespace sightline::bench
