// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "calibrate/watch/scene_reference.hpp"

namespace sightline::calibrate {
namespace {

constexpr int kEach = 3;        // candidates of a cell
constexpr double kStays = 0.2;  // [px]
constexpr double kSame = 0.85;  // correlation
constexpr int kMisses = 1;      // looks at which somebody may stand before it

}  // namespace

int covered_ninths(std::span<const ScenePatch> patches, int width, int height) {
  std::array<char, 9> seen{};
  for (const ScenePatch& p : patches) {
    const int x = std::clamp(static_cast<int>(p.pixel.x() * 3 / width), 0, 2);
    const int y = std::clamp(static_cast<int>(p.pixel.y() * 3 / height), 0, 2);
    seen[static_cast<size_t>(3 * y + x)] = 1;
  }
  return static_cast<int>(std::ranges::count(seen, 1));
}

void SceneLearner::begin(std::vector<char> taken) {
  taken_ = std::move(taken);
  candidates_.clear();
  looks_ = 0;
}

void SceneLearner::start(const PlaneView& image) {
  candidates_.clear();
  for (const Corner& corner : find_corners(image, kEach, taken_)) {
    const auto patch = cut_patch(image, corner.x, corner.y);
    if (!patch) continue;
    candidates_.push_back({*patch, PatchTemplate(*patch), corner.cell});
    std::ranges::copy(patch->gray, candidates_.back().sum.begin());
  }
}

void SceneLearner::follow(const PlaneView& image) {
  for (Candidate& c : candidates_) {
    if (c.misses > kMisses) continue;
    const auto match = refine_patch(image, c.ready, c.patch.pixel);
    if (!match || match->score < kSame || (match->pixel - c.patch.pixel).norm() > kStays) {
      ++c.misses;
      continue;
    }
    const auto now =
        cut_patch(image, static_cast<int>(c.patch.pixel.x()), static_cast<int>(c.patch.pixel.y()));
    if (!now) continue;
    for (size_t i = 0; i < c.sum.size(); ++i) c.sum[i] += now->gray[i];
    ++c.added;
  }
}

std::vector<ScenePatch> SceneLearner::take() {
  std::vector<ScenePatch> patches;
  int last_cell = -1;
  for (Candidate& c : candidates_) {
    if (c.misses > kMisses || c.cell == last_cell) continue;
    last_cell = c.cell;
    for (size_t i = 0; i < c.sum.size(); ++i) {
      c.patch.gray[i] = static_cast<uint8_t>((c.sum[i] + c.added / 2) / c.added);
    }
    patches.push_back(c.patch);
  }
  begin(std::move(taken_));
  return patches;
}

}  // namespace sightline::calibrate
