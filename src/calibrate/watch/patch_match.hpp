// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sightline/image/planes.hpp"

namespace sightline::calibrate {

constexpr int kPatchSide = 17;  // with the border that its gradients need
constexpr int kPatchInner = 15;
constexpr int kPatchPixels = kPatchInner * kPatchInner;

/// A piece of a half-size image around a corner.
struct ScenePatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< its center, half-size image
  std::array<uint8_t, size_t{kPatchSide} * kPatchSide> gray{};
};

/// A patch that is ready to be looked for: of zero mean and unit norm, so that light and contrast
/// do not matter.
struct PatchTemplate {
  explicit PatchTemplate(const ScenePatch& patch);

  Eigen::Vector2d pixel;
  std::array<float, kPatchPixels> value;
  std::array<float, kPatchPixels> along_x, along_y;  ///< free of mean and contrast
  Eigen::Matrix2d inverse_hessian = Eigen::Matrix2d::Zero();
};

struct PatchMatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double score = 0;  ///< normalized correlation
};

/// The patch at whole pixels; empty: it is not all inside the image.
std::optional<ScenePatch> cut_patch(const PlaneView& image, int x, int y);

/// Where the patch is, from a place some two pixels off (inverse compositional, translation only).
/// Empty: left the image, or does not converge.
std::optional<PatchMatch> refine_patch(const PlaneView& image, const PatchTemplate& patch,
                                       const Eigen::Vector2d& start);

/// The best of all places up to `range` px around `center`, every other pixel; coarse.
std::optional<PatchMatch> search_patch(const PlaneView& image, const PatchTemplate& patch,
                                       const Eigen::Vector2d& center, int range);

/// Corners with texture in two directions, the best `each` of every cell of a grid of the image,
/// best first within their cell. `taken` cells are left out.
struct Corner {
  int x = 0, y = 0, cell = 0;
};
constexpr int kSceneColumns = 8, kSceneRows = 6;
int scene_cell(const Eigen::Vector2d& pixel, int width, int height);
std::vector<Corner> find_corners(const PlaneView& image, int each, std::span<const char> taken);

}  // namespace sightline::calibrate
