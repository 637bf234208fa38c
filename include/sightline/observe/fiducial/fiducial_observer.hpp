// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/object.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"

namespace sightline {

struct FiducialOptions {
  double search_scale = 0.5;  ///< markers are searched in the image at this scale: 1, 0.5, 0.25
  /// Noise of one corner coordinate, one sigma, of square markers and of board corners; the
  /// defaults are measured (src/observe/README.md). The camera's own calibration error is added.
  double tag_sigma_px = 0.06;
  double board_sigma_px = 0.12;
  double calibration_share = 0.25;  ///< of CalibratedCamera::rms_px that is added in squares
  /// What a camera's whole view may be wrong by (see ReprojectionTerm): its place, lens, clock, the
  /// print.
  ViewError view_error{0.25, 0.005};
  /// Exponent from image level to light: about 2.2 for webcams and video, 1 for machine-vision
  /// cameras with a linear response. Wrong by 1, a dark border comes out 0.3 px too small.
  double gamma = 2.2;
  double huber = 2.5;  ///< robust threshold [sigma]
  int threads = 1;     ///< of the AprilTag detector; 1 keeps the daemon's own threads alone
  double region_margin = 0.35;  ///< of the predicted region's size, added on each side
  double region_sigmas = 3.0;   ///< of the predicted pose, added to the region
  /// While a confident track (state tracking) says where to look and nothing is there, the whole
  /// image is searched only every so many frames; otherwise whenever the region shows nothing.
  int full_search_interval = 10;
  /// A lost object is searched at full size, for small markers, in one of so many frames.
  int thorough_interval = 4;
  double min_side_px = 10;          ///< shortest side of a marker that is believed
  int max_hamming = 1;              ///< corrected bits of an AprilTag
  double min_decision_margin = 20;  ///< of an AprilTag, gray levels
  int min_board_corners = 4;        ///< of a board, not on one line
  /// A flipped pose is reported while its cost exceeds the best one's by less than this (a log
  /// likelihood ratio; 6 means the flip is less than e^-6 as likely).
  double flip_cost_margin = 6.0;

  bool operator==(const FiducialOptions&) const = default;
};

/// An object and its id in the installation or recording.
struct ObservedObject {
  ObjectId id;
  ObjectDescription description;
};

/// Finds the fiducials of known objects in one camera's frames and measures where they are.
/// One observer per camera; passive; used by one thread at a time.
class FiducialObserver {
 public:
  /// Objects without fiducials and board are left out. Refused: an unknown family or dictionary
  /// (the error lists the known ones), an id that is not in the family or stands twice, a
  /// board that cannot exist, sizes that are not positive.
  static Result<std::unique_ptr<FiducialObserver>> create(const CalibratedCamera& camera,
                                                          CameraId id,
                                                          std::vector<ObservedObject> objects,
                                                          const FiducialOptions& options = {});
  ~FiducialObserver();

  /// Objects of the observations that step() makes, in their order.
  std::span<const ObjectId> objects() const;

  /// Looks at a frame of this camera and appends one Observation per object of objects(); its terms
  /// are empty if the object was not seen, else one ReprojectionTerm over all corners of all its
  /// fiducials. `tracks` are estimates in any order, null or missing where there is none: they say
  /// where to look first, never what is measured. A frame whose size is not the camera's, or that
  /// is damaged, is not looked at and yields nothing.
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  /// Counts since the start, for metrics.
  struct Counters {
    uint64_t frames = 0;
    uint64_t full_searches = 0;    ///< of the whole image
    uint64_t region_searches = 0;  ///< of a predicted region
    uint64_t fiducials = 0;        ///< markers and boards accepted
    uint64_t refused = 0;          ///< detections that the guards refused
  };
  const Counters& counters() const;

 private:
  class Impl;
  explicit FiducialObserver(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Family names of square markers and dictionary names of boards that this build knows.
std::vector<std::string> known_fiducial_families();
std::vector<std::string> known_board_dictionaries();

}  // namespace sightline
