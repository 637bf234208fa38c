// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/calibrate/assess.hpp"

namespace sightline::calibrate {

/// Errors of one camera's corners that were used: where, and projection less measurement [px].
struct PlottedErrors {
  int width = 0, height = 0;  ///< of the image
  std::vector<Eigen::Vector2d> pixels, errors;
  std::vector<Eigen::Vector2d> rejected;  ///< corners that were left out
};

/// Each returns one <svg> element.
std::string coverage_plot(const PlottedErrors& data);
/// Mean error of the cells of the image, magnified so that the longest fits a cell; says by how
/// much.
std::string residual_field_plot(const PlottedErrors& data);
std::string histogram_plot(const PlottedErrors& data);
std::string sigma_plot(const ProjectionSigma& sigma, int width, int height);
/// Between the two calibrations from half of the sets each, all over the image.
std::string half_plot(const SplitHalf& half, int width, int height);
/// Cameras on a circle, a line for each link, as wide as it is strong.
std::string link_plot(const std::vector<CameraReport>& cameras,
                      const std::vector<LinkReport>& links);

/// Text with &, < and > made harmless.
std::string html_text(const std::string& text);

}  // namespace sightline::calibrate
