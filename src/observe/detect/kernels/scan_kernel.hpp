// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace sightline::observe {

/// Sums the responses of a template's features for `columns` places side by side:
///     sums[x] = sum over features of feature[offset + x]
/// and says whether any sum is at least `threshold`. At most 31 features of at most 8 each, so a
/// byte holds the sum. Reads and writes up to a multiple of 32 columns. Sums below the threshold
/// may be given as 0.
bool sum_features(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                  uint8_t threshold, uint8_t* sums);

/// First of the columns from `begin` on, below `end`, whose sum is at least `threshold`; `end`:
/// none. Reads up to a multiple of 32 columns past `begin`.
size_t next_reaching(std::span<const uint8_t> sums, size_t begin, size_t end, uint8_t threshold);

bool sum_features_scalar(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                         uint8_t threshold, uint8_t* sums);
bool sum_features_avx2(std::span<const uint8_t* const> features, ptrdiff_t offset, int columns,
                       uint8_t threshold, uint8_t* sums);

}  // namespace sightline::observe
