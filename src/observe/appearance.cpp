// SPDX-License-Identifier: Apache-2.0
#include "appearance.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr size_t kFewestPixels = 60;
// A colour that is rarer than this share in both histograms says little.
constexpr float kRare = 2e-4f;

Eigen::Vector3d direction_of(size_t side) {
  if (side < 6) {
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    axis[static_cast<Eigen::Index>(side / 2)] = side % 2 == 0 ? 1 : -1;
    return axis;
  }
  const size_t corner = side - 6;
  return Eigen::Vector3d((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                         (corner & 4) != 0 ? 1 : -1)
      .normalized();
}

}  // namespace

SideAppearance::SideAppearance()
    : foreground_(ColorBins::kCount),
      background_(ColorBins::kCount),
      evidence_(ColorBins::kCount),
      fresh_(ColorBins::kCount) {}

// A pixel counts in its own bin and a little in the neighbours in brightness: noise and shading
// move colours along it first.
void SideAppearance::mix(std::span<const uint16_t> bins, float rate,
                         std::vector<float>& histogram) {
  std::fill(fresh_.begin(), fresh_.end(), 0.0f);
  constexpr uint16_t kLumaStep = 1 << 10;
  constexpr float kOwn = 0.6f, kNext = 0.2f;
  for (const uint16_t bin : bins) {
    fresh_[bin] += kOwn;
    fresh_[bin >= kLumaStep ? bin - kLumaStep : bin] += kNext;
    fresh_[bin + kLumaStep < static_cast<int>(ColorBins::kCount) ? bin + kLumaStep : bin] += kNext;
  }
  const float share = rate / static_cast<float>(bins.size());
  const float kept = 1 - rate;
  for (size_t i = 0; i < histogram.size(); ++i) {
    histogram[i] = kept * histogram[i] + share * fresh_[i];
  }
}

void SideAppearance::compare() {
  double overlap = 0;
  for (size_t i = 0; i < evidence_.size(); ++i) {
    const float f = foreground_[i], b = background_[i];
    evidence_[i] = (f - b) / (f + b + kRare);
    if (f > 0 && b > 0) overlap += static_cast<double>(std::sqrt(f * b));
  }
  separation_ = std::sqrt(std::max(0.0, 1.0 - overlap));
}

bool SideAppearance::learn(std::span<const uint16_t> foreground,
                           std::span<const uint16_t> background, float rate) {
  if (foreground.size() < kFewestPixels || background.size() < kFewestPixels) return false;
  const float weight = learned_ ? rate : 1.0f;
  mix(foreground, weight, foreground_);
  mix(background, weight, background_);
  compare();
  learned_ = true;
  return true;
}

void SideAppearance::copy_from(const SideAppearance& other) {
  foreground_ = other.foreground_;
  background_ = other.background_;
  evidence_ = other.evidence_;
  separation_ = other.separation_;
  learned_ = other.learned_;
}

void SideAppearance::forget() {
  std::fill(foreground_.begin(), foreground_.end(), 0.0f);
  std::fill(background_.begin(), background_.end(), 0.0f);
  std::fill(evidence_.begin(), evidence_.end(), 0.0f);
  separation_ = 0;
  learned_ = false;
}

Appearance::Appearance() {
  for (auto& side : sides_) side = std::make_unique<SideAppearance>();
}

size_t Appearance::side_of(const Eigen::Vector3d& direction) {
  size_t best = 0;
  double closest = -2;
  for (size_t side = 0; side < kSides; ++side) {
    const double cosine = direction.dot(direction_of(side));
    if (cosine <= closest) continue;
    closest = cosine;
    best = side;
  }
  return best;
}

const SideAppearance* Appearance::of_side(size_t side) const {
  if (sides_[side]->learned()) return sides_[side].get();
  return known() ? sides_[newest_].get() : nullptr;
}

bool Appearance::learn(size_t side, std::span<const uint16_t> foreground,
                       std::span<const uint16_t> background, float rate) {
  SideAppearance& own = *sides_[side];
  if (!own.learned() && known()) own.copy_from(*sides_[newest_]);
  if (!own.learn(foreground, background, rate)) return false;
  newest_ = side;
  return true;
}

void Appearance::forget() {
  for (auto& side : sides_) side->forget();
  newest_ = kSides;
}

}  // namespace sightline::observe
