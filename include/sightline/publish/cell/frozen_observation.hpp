// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {

/// What an observation says, as numbers: its terms linearized at the pose that this camera takes
/// for the best one next to `track` at the capture time, and at each pose that it proposes. `track`
/// may be null. Names, times and numbers are left to the sender. The cost: about six
/// linearizations. Nullopt: there are terms, but no pose at which they say anything; without terms
/// it would be taken for "searched and not seen". Any thread.
std::optional<CellObservation> freeze(const Observation& observation, const PoseTrack* track);

/// An observation of another host as the estimator takes it, of `object` and `camera` here.
Observation thaw(CellObservation observation, ObjectId object, CameraId camera, Time capture);

/// What terms said at several poses; linearizes itself at that one of them which is nearest.
class FrozenTerms : public PoseTerm {
 public:
  struct At {
    Rigid3 reference;
    FrozenTerm term;
  };
  FrozenTerms(std::vector<At> at, FrozenKind kind) : at_(std::move(at)), kind_(kind) {}
  LinearizedTerm linearize(const Rigid3& world_from_object) const override;
  /// As the estimator knows it from cameras here: "region" stands for all of the outline.
  std::string_view kind() const override;

 private:
  std::vector<At> at_;
  FrozenKind kind_;
};

}  // namespace sightline
