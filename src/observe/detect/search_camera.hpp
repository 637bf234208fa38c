// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/edge_maps.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline::observe {

/// What the search sees of one camera: responses to edges spread over 1, 2, ... half-size pixels.
struct SearchCamera {
  static constexpr int kSpreads = 7;
  const CalibratedCamera* camera = nullptr;
  Rigid3 camera_from_world;
  double shrink = kMapShrink;                     ///< image pixels per pixel of the maps
  double usual_speed = 0;                         ///< of the object [m/s]
  double seconds = 0;                             ///< captured after the camera that is searched
  const EdgeImage* edges = nullptr;               ///< of its image, for respond_to()
  const std::vector<uint8_t>* borders = nullptr;  ///< see ResponseMaps::compute()
  int margin = 0;                                 ///< around the maps, see ResponseMaps::compute()

  /// From now on the responses are to these edges. Each spread is computed when it is first asked
  /// for: a pose that is followed needs two of them. While nobody changes this, any thread may
  /// ask.
  void respond_to(const EdgeImage& image_edges, const std::vector<uint8_t>& region_borders,
                  int map_margin);
  /// Of the spread that allows for what the steps of the search leave open: the larger the object
  /// is in the image (`scale` [px/m of the maps], `radius` [m]), the more its outline moves from
  /// one step to the next, and while it moves from one camera's exposure to the other's.
  const ResponseMaps& far(double scale, double radius) const;
  /// Of the spread that its motion alone asks for.
  const ResponseMaps& near(double scale) const;

 private:
  int motion_px(double scale) const;
  const ResponseMaps& spread(int index) const;

  struct Spreads {
    std::mutex mutex;  // of who makes one
    std::array<ResponseMaps, kSpreads> maps;
    std::array<std::atomic<bool>, kSpreads> made{};
  };
  std::unique_ptr<Spreads> spreads_ = std::make_unique<Spreads>();
};

}  // namespace sightline::observe
