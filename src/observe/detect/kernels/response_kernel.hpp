// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace sightline::observe {

/// Where the responses of one camera lie: see ResponseMaps. Those of one direction after those of
/// another, each `plane` bytes. At least 3 bytes follow the last pixel.
struct ResponsePlanes {
  const uint8_t* bytes;
  int32_t plane, stride, half;  ///< bytes of a direction, of a row, of a row's even columns
  int32_t width, height;        ///< without margins [px]
  int32_t margin;               ///< around [px]
};

/// Edges of a template as they lie in the image, relative to its middle.
struct PlacedFeatures {
  static constexpr size_t kMax = 32;  ///< whole vectors
  size_t count = 0;
  std::array<int32_t, kMax> bins{};  ///< directions, 0..kEdgeBins - 1
  std::array<float, kMax> x{}, y{};
};

/// Sum of the responses at `scale` times the places from (x, y) on, rounded down; 0 outside of the
/// maps.
int sum_responses(const ResponsePlanes& maps, const PlacedFeatures& features, float x, float y,
                  float scale);

int sum_responses_scalar(const ResponsePlanes& maps, const PlacedFeatures& features, float x,
                         float y, float scale);
int sum_responses_avx2(const ResponsePlanes& maps, const PlacedFeatures& features, float x, float y,
                       float scale);

}  // namespace sightline::observe
