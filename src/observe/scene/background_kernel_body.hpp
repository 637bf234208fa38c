// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>

#include "observe/scene/background_kernel.hpp"

namespace sightline::observe {
namespace {

constexpr int kCells = 128;  // at once, so that what is kept between the loops stays in the cache
using CellValues = std::array<int, kCells>;

inline void find_light_free(const uint8_t* levels, int zero, int part, int cells, int* out) {
  for (int i = 0; i < cells; ++i) out[i] = light_free(levels[i], zero, part);
}

inline void find_distances(const int* color, const int16_t* mean, int cells, int* out) {
  for (int i = 0; i < cells; ++i) out[i] = std::abs(color[i] - mean[i]);
}

inline void find_shares(const uint8_t* age, int more, int cells, int* out) {
  for (int i = 0; i < cells; ++i) {
    out[i] = share_of_observation(age[i] + more);
  }
}

// Where `usual`: `to` counts by its share.
inline void move_to(const int* to, const int* share, const int* usual, int cells, int16_t* from) {
  for (int i = 0; i < cells; ++i) {
    from[i] = usual[i] != 0 ? moved(from[i], to[i], share[i]) : from[i];
  }
}

// Within four sigmas of every channel, known, and not occupied.
inline void find_usual(const std::array<CellValues, 3>& distance, const BackgroundRow& row,
                       int first, int cells, int* usual) {
  const int16_t *luma = row.spread[0] + first, *chroma = row.spread[1] + first;
  const uint8_t *age = row.age + first, *occupied = row.occupied + first;
  const int least_luma = row.min_spread[0], least_chroma = row.min_spread[1];
  for (int i = 0; i < cells; ++i) {
    const int most_luma = 4 * std::max<int>(luma[i], least_luma);
    const int most_chroma = 4 * std::max<int>(chroma[i], least_chroma);
    const auto k = static_cast<size_t>(i);
    usual[i] = static_cast<int>(distance[0][k] < most_luma) &
               static_cast<int>(distance[1][k] < most_chroma) &
               static_cast<int>(distance[2][k] < most_chroma) & static_cast<int>(age[i] != 0) &
               static_cast<int>(occupied[i] == 0);
  }
}

inline void count(const BackgroundRow& row, int first, int cells, const int* usual) {
  uint8_t *age = row.age + first, *rival = row.rival_age + first;
  const int most = row.max_age;
  for (int i = 0; i < cells; ++i) {
    const int older = std::min(age[i] + 1, most);
    age[i] = static_cast<uint8_t>(usual[i] != 0 ? older : age[i]);
    rival[i] = static_cast<uint8_t>(rival[i] - static_cast<int>((usual[i] != 0) & (rival[i] != 0)));
  }
}

inline void learn_block(const BackgroundRow& row, int first, int cells, uint8_t* out) {
  std::array<CellValues, 3> color, distance;
  CellValues usual, share;
  for (size_t k = 0; k < 3; ++k) {
    find_light_free(row.levels[k] + first, k == 0 ? kBlack : kNeutral, row.light_part, cells,
                    color[k].data());
    find_distances(color[k].data(), row.mean[k] + first, cells, distance[k].data());
  }
  find_usual(distance, row, first, cells, usual.data());
  // Mean absolute deviation, as sigma of a normal distribution: times 1.25.
  for (size_t i = 0; i < static_cast<size_t>(cells); ++i) {
    distance[0][i] = distance[0][i] * 5 / 4;
    distance[1][i] = (distance[1][i] + distance[2][i]) * 5 / 8;
  }
  find_shares(row.age + first, 3, cells, share.data());
  for (size_t k = 0; k < 2; ++k) {
    move_to(distance[k].data(), share.data(), usual.data(), cells, row.spread[k] + first);
  }
  find_shares(row.age + first, 1, cells, share.data());
  for (size_t k = 0; k < 3; ++k) {
    move_to(color[k].data(), share.data(), usual.data(), cells, row.mean[k] + first);
  }
  count(row, first, cells, usual.data());
  for (int i = 0; i < cells; ++i) out[i] = static_cast<uint8_t>(usual[static_cast<size_t>(i)]);
}

inline void learn_row(const BackgroundRow& row, uint8_t* usual) {
  for (int first = 0; first < row.width; first += kCells) {
    learn_block(row, first, std::min(kCells, row.width - first), usual + first);
  }
}

}  // namespace
}  // namespace sightline::observe
