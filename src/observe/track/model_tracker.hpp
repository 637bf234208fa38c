// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/track/colors/appearance.hpp"
#include "observe/track/edge_measurement.hpp"
#include "observe/track/outline_fit.hpp"
#include "observe/track/placed_outline.hpp"
#include "observe/track/print/print_points.hpp"
#include "observe/track/print/texture_measurement.hpp"
#include "observe/track/region_measurement.hpp"

namespace sightline::observe {

/// Where an object is expected and how far it may be off.
struct Prediction {
  Rigid3 world_from_object;
  Matrix6 covariance;      ///< tangent, see Rigid3
  bool ambiguous = false;  ///< it may be another pose that the shape cannot tell from this one
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s], body frame
};

/// One object in one camera: fits the outline around a predicted pose, judges whether the image
/// shows the object there, and makes the terms. The prediction only places lines; what is handed
/// out is the likelihood alone. Nothing is learned of a frame.
class ModelTracker {
 public:
  ModelTracker(const TrackerCamera& camera, const TrackedObject& object);

  struct Measurement {
    ObjectTracker::TrackResult result;
    Rigid3 fitted;      ///< world_from_object, if the object was seen
    size_t aspect = 0;  ///< viewing aspect of the prediction, see Appearance
  };

  /// Measures around a prediction. `learned`: colors by aspect, and by stretch of the outline, as
  /// learned; null, or while none are known: colors as this frame shows them there. `texture`:
  /// points to be found; may be null. Appends terms if the object is seen.
  struct Learned {
    const Appearance* colors = nullptr;
    const LocalColors* local = nullptr;
    TexturePoints* texture = nullptr;
    bool from_detection = false;  ///< the colors are those of where a search has found it
  };
  Measurement measure(const Frame& frame, const Prediction& prediction, const Learned& learned,
                      std::span<const OccludingSphere> spheres, std::vector<PoseTermPtr>& terms);

  /// Places the outline at a pose, without measuring; the viewing aspect there.
  size_t place(const Rigid3& world_from_object, std::span<const OccludingSphere> spheres);
  /// As the last measure() left it: placed at the fitted pose, lines that do not agree not
  /// measured.
  const PlacedOutline& outline() const { return outline_; }

  /// Points of the print that the last image shows.
  std::span<const TexturePoints::Found> print_found() const { return print_measurement_.found(); }
  /// The print of the sides in sight is not there in the last image: covered, or another object.
  bool print_missing() const;

 private:
  /// What a frame is measured with: around where, and how far that may be off.
  struct Look {
    const Frame& frame;
    const PosePrior& prior;
    double spread_px;
    bool from_afar;  ///< that is much, next to the object's size
  };
  size_t aspect() const;
  OutlineAgreement find_outline(const Look& look, const ColorHistograms* known,
                                const LocalColors* known_local, bool from_detection);
  OutlineAgreement by_all_colors(const Look& look, const ColorHistograms* known);
  OutlineAgreement by_local_colors(const Look& look, const LocalColors* known);
  /// From where the outline is placed, off by about `spread_px`.
  OutlineAgreement judge_locally(const Look& look, double spread_px, const LocalColors* known);
  /// Points of the mesh's print around poses (world_from_object), see TextureMeasurement; null
  /// without a print, or if too few agree.
  PoseTermPtr measure_print(const Frame& frame, const PosePrior& prior,
                            std::span<const Rigid3> starts, bool ambiguous,
                            ObjectTracker::TrackResult& result);
  void make_terms(const Frame& frame, const PosePrior& prior, const Prediction& prediction,
                  const OutlineAgreement& agreement, TexturePoints* texture, Measurement& out,
                  std::vector<PoseTermPtr>& terms);

  const TrackerCamera& camera_;
  const TrackedObject& object_;
  PlacedOutline outline_, other_outline_;
  OutlineFit fit_;
  RegionMeasurement region_;
  EdgeMeasurement edges_;
  TextureMeasurement texture_, print_measurement_;
  std::unique_ptr<PrintPoints> print_;  ///< null: the mesh has none
  const LocalColors nothing_local_;
};

/// Whether so many points of the print are found that nothing else need say where the object is.
bool print_in_place(const ObjectTracker::TrackResult& result);

}  // namespace sightline::observe
