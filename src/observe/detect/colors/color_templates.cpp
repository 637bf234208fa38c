// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/color_templates.hpp"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>

namespace sightline::observe {
namespace {

constexpr float kFewSpots = 3;      // that tell colors apart count half
constexpr float kMinSeen = 0.75f;   // of them, in the image
constexpr float kMinFacing = 0.3f;  // cosine between normal and line of sight
constexpr float kNoColor = 0.5f;    // [levels^2] variance of a channel that is not there

}  // namespace

void ColorMap::compute(const HalfSizeImage& image) {
  width_ = image.width / 2;
  height_ = image.height / 2;
  pixels_.assign(static_cast<size_t>(width_) * static_cast<size_t>(height_), Sums{});
  for (size_t plane = 0; plane < 3; ++plane) {
    for (int y = 0; y < height_; ++y) {
      const uint8_t *above = image.row(plane, 2 * y), *below = image.row(plane, 2 * y + 1);
      Sums* to = pixels_.data() + static_cast<size_t>(y) * static_cast<size_t>(width_);
      for (int x = 0; x < width_; ++x) {
        to[x][plane] = static_cast<uint16_t>(above[2 * x] + above[2 * x + 1] + below[2 * x] +
                                             below[2 * x + 1]);
      }
    }
  }
}

ColorTemplates::ColorTemplates(const TemplateBank& bank, std::span<const SurfaceSample> samples) {
  const ViewpointModel& model = bank.model();
  const Eigen::Vector3f center = model.center().cast<float>();
  std::vector<const SurfaceSample*> facing;
  for (size_t i = 0; i < model.size(); ++i) {
    const Rigid3 camera_from_object = model.view(i).camera_from_object;
    const Eigen::Vector3f eye = camera_from_object.inverse().translation.cast<float>();
    facing.clear();
    for (const SurfaceSample& spot : samples) {
      const Eigen::Vector3f sight = eye - spot.point;
      if (sight.dot(spot.normal) >= kMinFacing * sight.norm()) facing.push_back(&spot);
    }
    const Eigen::Matrix3f rotation = camera_from_object.rotation_matrix().cast<float>();
    const size_t count = std::min(kMaxSpots, facing.size());
    Colors view;
    Eigen::Array4f mean = Eigen::Array4f::Zero();
    for (size_t k = 0; k < count; ++k) {
      const SurfaceSample& spot = *facing[k * facing.size() / count];
      const Eigen::Vector3f place = rotation * (spot.point - center);
      Eigen::Array4f color = Eigen::Array4f::Zero();
      color.head<3>() = spot.color.array();
      view.x[k] = place.x();
      view.y[k] = place.y();
      view.colors.push_back(color);
      mean += color / static_cast<float>(count);
    }
    for (Eigen::Array4f& color : view.colors) color -= mean;
    view.weight = weight_of(view.colors);
    for (const Eigen::Array4f& color : view.colors) view.sums.add(color);
    views_.push_back(std::move(view));
  }
}

// By the effective number of spots that differ from the mean (participation ratio of their squared
// distances): all of them where the colors share the surface, few where one stands out.
float ColorTemplates::weight_of(std::span<const Eigen::Array4f> colors) {
  float sum = 0, squares = 0;
  for (const Eigen::Array4f& color : colors) {
    const float away = color.square().sum();
    sum += away;
    squares += away * away;
  }
  const float effective = squares > 0 ? sum * sum / squares : 0;
  return effective / (effective + kFewSpots);
}

float ColorTemplates::correlation(const WeakPerspectivePose& pose, const ColorMap& map) const {
  const Colors& view = views_[pose.view];
  const std::vector<Eigen::Array4f>& spots = view.colors;
  const float c = std::cos(pose.turn) * pose.scale, s = std::sin(pose.turn) * pose.scale;
  // Where they are is computed for all of them, side by side.
  const int width = map.width(), height = map.height();
  std::array<int, kMaxSpots> at;
  for (size_t i = 0; i < kMaxSpots; ++i) {
    const int x = static_cast<int>(pose.x + c * view.x[i] - s * view.y[i] + 0.5f);
    const int y = static_cast<int>(pose.y + s * view.x[i] + c * view.y[i] + 0.5f);
    const bool seen = (x >= 0) & (y >= 0) & (x < width) & (y < height);
    at[i] = seen ? y * width + x : -1;
  }
  Eigen::Array4f b = Eigen::Array4f::Zero(), ab = b, bb = b;
  std::bitset<kMaxSpots> inside;
  for (size_t i = 0; i < spots.size(); ++i) {
    if (at[i] < 0) continue;
    const Eigen::Array4f shown = map.at(static_cast<size_t>(at[i]));
    b += shown;
    ab += spots[i] * shown;
    bb += shown.square();
    inside.set(i);
  }
  const auto seen = static_cast<float>(inside.count());
  if (seen < kMinSeen * static_cast<float>(spots.size()) || spots.empty()) return 0;
  Sums part;
  const bool all = inside.count() == spots.size();
  for (size_t i = 0; i < (all ? 0 : spots.size()); ++i) {
    if (inside[i]) part.add(spots[i]);
  }
  const auto& [a, aa] = all ? view.sums : part;
  const Eigen::Array4f shown = bb - b.square() / seen;
  const Eigen::Array4f has = (shown > kNoColor * seen).cast<float>();
  const float painted = ((aa - a.square() / seen) * has).sum();
  const float scale = std::sqrt(std::max(0.0f, painted * (shown * has).sum()));
  return scale > 1e-3f ? view.weight * ((ab - a * b / seen) * has).sum() / scale : 0;
}

}  // namespace sightline::observe
