// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

namespace sightline {

/// What searches have done, counted. The same for the same images on every machine, so that a
/// replay can say how long it would have taken. What several cameras see counts once for each.
struct SearchWork {
  uint64_t images = 0;      ///< whose edges were found
  uint64_t places = 0;      ///< of templates that one camera was scanned for
  uint64_t checked = 0;     ///< depths of the scan's places, in another camera
  uint64_t scored = 0;      ///< poses by their edge directions: steps of climbs
  uint64_t masks = 0;       ///< views and turns whose silhouette was tried
  uint64_t overlaps = 0;    ///< poses by their silhouettes
  uint64_t looked_at = 0;   ///< poses along their outline, as they are
  uint64_t fits = 0;        ///< poses that were moved onto the edges
  uint64_t textures = 0;    ///< images whose features were matched with the trained ones
  uint64_t near_poses = 0;  ///< the same, only about a place that is known

  SearchWork& operator+=(const SearchWork& other) { return add(other, 1); }
  SearchWork& operator-=(const SearchWork& other) { return add(other, ~uint64_t{0}); }
  bool operator==(const SearchWork&) const = default;

 private:
  SearchWork& add(const SearchWork& o, uint64_t times) {
    images += times * o.images, places += times * o.places, checked += times * o.checked;
    scored += times * o.scored, masks += times * o.masks, overlaps += times * o.overlaps;
    looked_at += times * o.looked_at, fits += times * o.fits;
    textures += times * o.textures, near_poses += times * o.near_poses;
    return *this;
  }
};

/// The same while several threads count. Whoever reads it waits for them first.
struct WorkMeter {
  std::atomic<uint64_t> places{0}, checked{0}, scored{0}, masks{0}, overlaps{0}, looked_at{0},
      fits{0};

  SearchWork sum() const {
    SearchWork out;
    out.places = places, out.checked = checked, out.scored = scored, out.masks = masks;
    out.overlaps = overlaps, out.looked_at = looked_at, out.fits = fits;
    return out;
  }
};

}  // namespace sightline
