// SPDX-License-Identifier: Apache-2.0
#include "observe/track/silhouettes/picture_check.hpp"

#include <algorithm>

namespace sightline::observe {
namespace {

constexpr int kSide = SilhouetteGrid::kSide;
constexpr size_t kCells = SilhouetteGrid::kCells;

constexpr double kFilled = 0.8;  // of the grid's side by the bounding sphere
// A pose that is right to some millimeters, blur and mixed pixels lie within so many cells of the
// outline; what is farther away than the reach need not be the object's.
constexpr int kGap = 3, kReach = 14;
constexpr float kOwn = 0.6f;  // evidence (see ColorHistograms) of the object
// The same of its surroundings. Where half of the silhouette shows them they are among the colors
// that are taken for the object's, too: -1/3.
constexpr float kSurroundings = -0.3f;
// Of the colors. Below it the object's are found around it by chance (docs/tracking.md).
constexpr double kMinSeparation = 0.55;
constexpr int kFewestCells = 150;       // of the silhouette
constexpr double kMinKnownShare = 0.5;  // of it
constexpr double kMustShowShare = 0.7;  // of it, for an object that has to be seen

// Calls `f` with each of the (4 or 8) neighbors of a cell.
template <typename F>
void for_neighbors(size_t cell, bool diagonal, F&& f) {
  const int x = static_cast<int>(cell) % kSide, y = static_cast<int>(cell) / kSide;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if ((dx == 0 && dy == 0) || (!diagonal && dx != 0 && dy != 0)) continue;
      const int nx = x + dx, ny = y + dy;
      if (nx < 0 || ny < 0 || nx >= kSide || ny >= kSide) continue;
      f(static_cast<size_t>(ny * kSide + nx));
    }
  }
}

}  // namespace

PictureCheck::PictureCheck(const TrackerCamera& camera, const TrackedObject& object)
    : grid_(camera, object, kFilled) {
  queue_.reserve(kCells);
  foreground_.reserve(kCells);
  background_.reserve(kCells);
}

void PictureCheck::measure_distances() {
  steps_.fill(0);
  queue_.clear();
  for (size_t i = 0; i < kCells; ++i) {
    bool border = false;
    for_neighbors(i, true, [&](size_t other) { border |= covered(other) != covered(i); });
    if (!border) continue;
    steps_[i] = 1;
    queue_.push_back(static_cast<uint16_t>(i));
  }
  for (size_t next = 0; next < queue_.size(); ++next) {
    const size_t i = queue_[next];
    for_neighbors(i, true, [&](size_t other) {
      if (steps_[other] != 0) return;
      steps_[other] = static_cast<uint8_t>(steps_[i] + 1);
      queue_.push_back(static_cast<uint16_t>(other));
    });
  }
}

int PictureCheck::shown_cells(double least_share) const {
  int all = 0, shown = 0;
  for (size_t i = 0; i < kCells; ++i) {
    all += covered(i) ? 1 : 0;
    shown += covered(i) && known(i) ? 1 : 0;
  }
  return shown < kFewestCells || shown < least_share * all ? 0 : shown;
}

bool PictureCheck::learn() {
  foreground_.clear();
  background_.clear();
  for (size_t i = 0; i < kCells; ++i) {
    if (!known(i) || steps_[i] < kGap) continue;
    (covered(i) ? foreground_ : background_).push_back(grid_.bins()[i]);
  }
  colors_.forget();
  return colors_.learn(foreground_, background_, 1.0f) && colors_.separation() >= kMinSeparation;
}

int PictureCheck::flood() {
  int reached = 0;
  for (size_t next = 0; next < queue_.size(); ++next) {
    for_neighbors(queue_[next], false, [&](size_t other) {
      if (wanted_[other] == 0) return;
      wanted_[other] = 0;
      reached += steps_[other] >= kGap ? 1 : 0;
      queue_.push_back(static_cast<uint16_t>(other));
    });
  }
  return reached;
}

// As many cells of the object's colors as there are farther away are chance.
double PictureCheck::unexplained_cells() {
  const float* evidence = colors_.evidence();
  queue_.clear();
  int near = 0, far = 0, far_own = 0;
  for (size_t i = 0; i < kCells; ++i) {
    wanted_[i] = 0;
    if (covered(i)) queue_.push_back(static_cast<uint16_t>(i));
    if (covered(i) || !known(i)) continue;
    const bool own = evidence[grid_.bins()[i]] > kOwn;
    if (steps_[i] > kReach) {
      ++far;
      far_own += own ? 1 : 0;
      continue;
    }
    near += steps_[i] >= kGap ? 1 : 0;
    wanted_[i] = own ? 1 : 0;
  }
  const double chance = far > 0 ? static_cast<double>(near) * far_own / far : 0;
  return std::max(0.0, flood() - chance);
}

// Of the largest coherent part.
double PictureCheck::missing_cells() {
  const float* evidence = colors_.evidence();
  for (size_t i = 0; i < kCells; ++i) {
    wanted_[i] =
        covered(i) && known(i) && steps_[i] >= kGap && evidence[grid_.bins()[i]] < kSurroundings;
  }
  int most = 0;
  for (size_t i = 0; i < kCells; ++i) {
    if (wanted_[i] == 0) continue;
    wanted_[i] = 0;
    queue_.assign(1, static_cast<uint16_t>(i));
    most = std::max(most, 1 + flood());
  }
  return most;
}

std::optional<PictureAgreement> PictureCheck::examine(const ColorReader& image, const Rigid3& pose,
                                                      const Occluders& occluders) {
  if (!grid_.aim(pose)) return std::nullopt;
  grid_.draw(Rigid3(), 1);
  grid_.read(image, occluders, true);
  const int shown = shown_cells(kMinKnownShare);
  if (shown == 0) return std::nullopt;
  measure_distances();
  if (!learn()) return std::nullopt;
  return PictureAgreement{static_cast<float>(unexplained_cells() / shown),
                          static_cast<float>(missing_cells() / shown)};
}

bool PictureCheck::must_show(const ColorReader& image, const Rigid3& pose,
                             const Occluders& occluders) {
  if (!grid_.aim(pose)) return false;
  grid_.draw(Rigid3(), 1);
  grid_.read(image, occluders);
  return shown_cells(kMustShowShare) > 0;
}

}  // namespace sightline::observe
