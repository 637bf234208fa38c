// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/looks/other_size_look.hpp"

namespace sightline::observe {

/// One camera at full size, for poses at which the object is small in its image: what is large and
/// followed does without.
class MagnifiedLook final : public OtherSizeLook {
 public:
  /// `camera`: with twice as many pixels, see magnified().
  explicit MagnifiedLook(CalibratedCamera camera) : OtherSizeLook(std::move(camera)) {}

  /// See OtherSizeLook::show(); `frame` keeps its full luma, and has to live on.
  void show(const FitCamera& half, const HalfSizeFrame& frame,
            const std::vector<uint8_t>& half_mask);
  /// Nothing outside of this part of its image is asked for. Before it is asked for anything.
  void set_box(const PixelBox& box);
  /// Null: too noisy; at half size the noise is less.
  const FitCamera* camera() const;

 private:
  void make(HalfSizeImage& image, EdgeImage& edges) const override;

  const HalfSizeFrame* frame_ = nullptr;
  PixelBox box_;
};

}  // namespace sightline::observe
