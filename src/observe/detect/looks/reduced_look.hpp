// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "observe/detect/looks/other_size_look.hpp"

namespace sightline::observe {

/// One camera at a quarter of its size, for poses at which the object is large in its image: steps
/// of the search and errors of mesh and lens are so many pixels there, and print is so dense, that
/// at half size lines find other edges than their own.
class ReducedLook final : public OtherSizeLook {
 public:
  /// `camera`: with half as many pixels, see reduced().
  explicit ReducedLook(CalibratedCamera camera) : OtherSizeLook(std::move(camera)) {}

  /// See OtherSizeLook::show().
  void show(const FitCamera& half, const std::vector<uint8_t>& half_mask) {
    OtherSizeLook::show(half, 4, half_mask);
  }
  const FitCamera& camera() const { return made(); }

 private:
  void make(HalfSizeImage& image, EdgeImage& edges) const override;
};

}  // namespace sightline::observe
