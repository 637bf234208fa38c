// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/plan/search_size.hpp"

#include <cmath>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/plan/search_distances.hpp"

namespace sightline::observe {
namespace {

int shrink_for(const CameraModel& model, const CameraDistances& distances, double diameter) {
  const double larger =
      std::sqrt(static_cast<double>(model.width()) * model.height() / kSearchedPixels);
  const double px_per_m = kMapShrink * std::sqrt(static_cast<double>(distances.scales.front()) *
                                                 static_cast<double>(distances.scales.back()));
  int shrink = 1;
  // The nearest size, by ratio.
  while (larger > std::sqrt(shrink * (shrink + 1.0)) &&
         px_per_m * diameter >= kSearchedDiameterPx * (shrink + 1)) {
    ++shrink;
  }
  return shrink;
}

}  // namespace

std::optional<CalibratedCamera> shrunk(CalibratedCamera camera, int shrink) {
  const int width = 2 * (camera.model.width() / (2 * shrink));
  const int height = 2 * (camera.model.height() / (2 * shrink));
  return scaled(std::move(camera), width, height, 1.0 / shrink);
}

std::vector<SearchSize> shrink_to_search(std::span<DetectorCamera> cameras, double object_radius,
                                         const DetectorOptions& options) {
  const SearchDistances distances = search_distances(cameras, object_radius, options);
  std::vector<SearchSize> out;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const CameraModel& model = cameras[i].calibration.model;
    out.push_back({model.width(), model.height(), 1});
    const int shrink = shrink_for(model, distances.cameras[i], 2 * object_radius);
    auto smaller = shrink > 1 ? shrunk(cameras[i].calibration, shrink) : std::nullopt;
    if (!smaller) continue;
    out.back().shrink = shrink;
    cameras[i].calibration = *std::move(smaller);
  }
  return out;
}

}  // namespace sightline::observe
