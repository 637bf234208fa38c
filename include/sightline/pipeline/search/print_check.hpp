// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "sightline/base/time.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/detection.hpp"

namespace sightline {

/// Whether an object with a print is where its track has it, by looks for the print that know
/// nothing of the track: outline and colors of a side that is seen from the front are those of two
/// poses, tilted to either side (Schweighofer and Pinz, PAMI 2006), and a track may be at the
/// other one while everything agrees but what is seen of the other sides. Plain value.
class PrintCheck {
 public:
  /// A search has found it; `by_print`: so that the first look is not needed at once.
  void begin(bool by_print) {
    other_.reset();
    missed_ = 0;
    looked_ = by_print;
  }
  /// A look has found this, or nothing, of an object that is tracked at a pose. True: a second look
  /// shows the same other pose; `found` takes its place.
  bool refuted_by(const ViewpointModel& views, const Rigid3& pose, const Detection& found);
  /// The last look has found it elsewhere.
  bool suspected() const { return other_.has_value(); }
  /// From one look to the next, of which each takes so much of a core: usually a second, and so
  /// long that all of them take a tenth of the core at most.
  Duration pause(Duration cost) const;

 private:
  std::optional<Rigid3> other_;  ///< object as tracked from object as found
  int missed_ = 0;               ///< looks in a row that have found nothing
  bool looked_ = true;           ///< for the print since it was found
};

}  // namespace sightline
