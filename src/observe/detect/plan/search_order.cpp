// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/plan/search_order.hpp"

namespace sightline::observe {

SearchOrder::Where SearchOrder::next(DetectorFrames& frames, const Detection* newest,
                                     bool pointed_at) const {
  if (next_ == Where::kForeground && frames.show_foreground()) return Where::kForeground;
  if (pointed_at || (next_ == Where::kEverywhere && newest == nullptr)) return Where::kEverywhere;
  if (!frames.show_motion()) return Where::kEverywhere;
  const bool rests = newest != nullptr &&
                     !frames.moves_at(newest->poses.front().world_from_object * center_, radius_);
  return rests ? Where::kEverywhere : Where::kMotion;
}

void SearchOrder::note(Where where, bool found, bool waits) {
  if (found || (where == Where::kEverywhere && !waits)) {
    next_ = Where::kForeground;
  } else if (!waits) {
    next_ = where == Where::kForeground ? Where::kMotion : Where::kEverywhere;
  }
}

}  // namespace sightline::observe
