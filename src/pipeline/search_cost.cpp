// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/search_cost.hpp"

#include <cmath>

namespace sightline {
namespace {

// CPU of one core, 2.6 GHz, per unit of SearchWork [ns]. Measured: every eighth set of `bench`,
// with and without silhouettes and with trained features, and every 10th to 40th of `toy`,
// `kettle`, `dragon`, `crate` and `teabox`, each as
//   build/release/bin/measure_search_cost RECORDING --every N > RECORDING.csv
// and fitted by
//   bench/fit_search_cost.py *.csv
// which prints these numbers. A search of these recordings takes 0.22 to 0.6 s on average; the
// model is off by 5 to 29 % of it (root mean square of a recording). A faster search needs new
// numbers: those of the scan, of looks and of fits are less by what both builds' fits to the same
// rows, measured in turn on one machine, differ by; that of images by what `perf` says of both.
constexpr double kImage = 2'250'000;  // edges, and the response maps that are made of them
constexpr double kPlace = 0.77;       // refitted since all turns of a view share what is read
constexpr double kChecked = 100;
constexpr double kScored = 806;
constexpr double kMask = 200;
constexpr double kOverlap = 3'600;
constexpr double kLookedAt = 31'000;
constexpr double kFit = 180'000;
constexpr double kTexture = 30'500'000;
constexpr double kNearPose = 8'800'000;

}  // namespace

Duration search_cost(const SearchWork& work) {
  const auto times = [](uint64_t count, double each) { return static_cast<double>(count) * each; };
  const double ns = times(work.images, kImage) + times(work.places, kPlace) +
                    times(work.checked, kChecked) + times(work.scored, kScored) +
                    times(work.masks, kMask) + times(work.overlaps, kOverlap) +
                    times(work.looked_at, kLookedAt) + times(work.fits, kFit) +
                    times(work.textures, kTexture) + times(work.near_poses, kNearPose);
  return std::chrono::nanoseconds(std::llround(ns));
}

}  // namespace sightline
