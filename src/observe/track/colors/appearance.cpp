// SPDX-License-Identifier: Apache-2.0
#include "observe/track/colors/appearance.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr size_t kFewestPixels = 60;
// A color that is rarer than this share in both histograms says little.
constexpr float kRare = 2e-4f;

Eigen::Vector3d direction_of(size_t aspect) {
  if (aspect < 6) {
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    axis[static_cast<Eigen::Index>(aspect / 2)] = aspect % 2 == 0 ? 1 : -1;
    return axis;
  }
  const size_t corner = aspect - 6;
  return Eigen::Vector3d((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                         (corner & 4) != 0 ? 1 : -1)
      .normalized();
}

}  // namespace

ColorHistograms::ColorHistograms()
    : foreground_(ColorBins::kCount),
      background_(ColorBins::kCount),
      evidence_(ColorBins::kCount),
      fresh_(ColorBins::kCount) {}

// A pixel counts in its own bin and a little in the neighbors in brightness: noise and shading
// move colors along it first.
void ColorHistograms::mix(std::span<const uint16_t> bins, float rate,
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

void ColorHistograms::compare() {
  double overlap = 0;
  for (size_t i = 0; i < evidence_.size(); ++i) {
    const float f = foreground_[i], b = background_[i];
    evidence_[i] = (f - b) / (f + b + kRare);
    if (f > 0 && b > 0) overlap += static_cast<double>(std::sqrt(f * b));
  }
  separation_ = std::sqrt(std::max(0.0, 1.0 - overlap));
}

bool ColorHistograms::learn(std::span<const uint16_t> foreground,
                            std::span<const uint16_t> background, float rate) {
  if (foreground.size() < kFewestPixels || background.size() < kFewestPixels) return false;
  const float weight = learned_ ? rate : 1.0f;
  mix(foreground, weight, foreground_);
  mix(background, weight, background_);
  compare();
  learned_ = true;
  return true;
}

void ColorHistograms::copy_from(const ColorHistograms& other) {
  foreground_ = other.foreground_;
  background_ = other.background_;
  evidence_ = other.evidence_;
  separation_ = other.separation_;
  learned_ = other.learned_;
}

void ColorHistograms::forget() {
  std::fill(foreground_.begin(), foreground_.end(), 0.0f);
  std::fill(background_.begin(), background_.end(), 0.0f);
  std::fill(evidence_.begin(), evidence_.end(), 0.0f);
  separation_ = 0;
  learned_ = false;
}

Appearance::Appearance() {
  for (auto& aspect : aspects_) aspect = std::make_unique<ColorHistograms>();
}

size_t Appearance::aspect_of(const Eigen::Vector3d& direction) {
  size_t best = 0;
  double closest = -2;
  for (size_t aspect = 0; aspect < kAspects; ++aspect) {
    const double cosine = direction.dot(direction_of(aspect));
    if (cosine <= closest) continue;
    closest = cosine;
    best = aspect;
  }
  return best;
}

const ColorHistograms* Appearance::of_aspect(size_t aspect) const {
  if (aspects_[aspect]->learned()) return aspects_[aspect].get();
  return known() ? aspects_[newest_].get() : nullptr;
}

bool Appearance::learn(size_t aspect, std::span<const uint16_t> foreground,
                       std::span<const uint16_t> background, float rate) {
  ColorHistograms& own = *aspects_[aspect];
  if (!own.learned() && known()) own.copy_from(*aspects_[newest_]);
  if (!own.learn(foreground, background, rate)) return false;
  newest_ = aspect;
  return true;
}

void Appearance::forget() {
  for (auto& aspect : aspects_) aspect->forget();
  newest_ = kAspects;
}

}  // namespace sightline::observe
