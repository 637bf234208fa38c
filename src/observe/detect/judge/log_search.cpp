// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/judge/log_search.hpp"

#include "observe/detect/judge/second_to_best.hpp"
#include "sightline/base/log.hpp"

namespace sightline::observe {
namespace {

std::string_view name_of(DetectorFrames::Where where) {
  using enum DetectorFrames::Where;
  return where == kForeground ? "what is new" : where == kMotion ? "what moves" : "everything";
}

}  // namespace

void log_search(const LoggedSearch& search, const ViewpointModel& model,
                const std::vector<ContourPose>& contours, const Detection& out,
                const Detection* waiting) {
  if (log::level() > log::Level::kDebug) return;
  if (contours.empty()) {
    log::debug("search: {} {}, {}: no pose", search.object.index(), search.what,
               name_of(search.where));
    return;
  }
  log::debug("search: {} {}, {}: score {:.2f}, rank {:.2f}, the next pose there {:.2f} of that: {}",
             search.object.index(), search.what, name_of(search.where), contours.front().score,
             contours.front().rank, second_to_best(model, contours),
             !out.poses.empty()   ? "found"
             : waiting != nullptr ? "waits"
                                  : "nothing");
}

}  // namespace sightline::observe
