// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace sightline::observe {

/// Three rows of one plane, and by how much its gradients count.
struct GradientRows {
  const uint8_t *above, *here, *below;
  float weight;
};

/// A row of gradients: of the strongest plane, and how strong that is.
struct GradientRow {
  float *x, *y, *magnitude;
};

/// Gradients of the pixels from `left` on, below `right`: Sobel times the plane's weight. The first
/// of planes that are equally strong counts; where all are flat everything is 0.
void find_gradients(const std::array<GradientRows, 3>& planes, int left, int right,
                    const GradientRow& out);

void find_gradients_scalar(const std::array<GradientRows, 3>& planes, int left, int right,
                           const GradientRow& out);
void find_gradients_avx2(const std::array<GradientRows, 3>& planes, int left, int right,
                         const GradientRow& out);

}  // namespace sightline::observe
