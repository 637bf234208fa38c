// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/rival_places.hpp"

#include <algorithm>

namespace sightline::observe {

void RivalPlaces::add(const Eigen::Vector3d& center, double score) {
  const auto known = std::find_if(places_.begin(), places_.end(), [&](const Place& place) {
    return (place.center - center).norm() <= apart_;
  });
  if (known == places_.end()) {
    places_.push_back({center, score});
  } else if (score > known->score) {
    *known = {center, score};
  }
  std::stable_sort(places_.begin(), places_.end(),
                   [](const Place& a, const Place& b) { return a.score > b.score; });
}

double RivalPlaces::strongest() const {
  return places_.size() > alike_ ? places_[alike_].score : 0;
}

}  // namespace sightline::observe
