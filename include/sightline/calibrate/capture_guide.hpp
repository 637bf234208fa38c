// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/calibrate/assess.hpp"
#include "sightline/calibrate/solve.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline {

/// What one image of one camera shows of the target.
struct TargetSight {
  size_t camera = 0;
  Time capture{};
  std::vector<TargetCorner> corners;  ///< in order of their ids; empty: not seen
  double edge_px = 0;                 ///< width of its edges, see target_edge_width(); 0: unknown
};

struct CaptureGuideOptions {
  /// The target need not stand still; a set is then what cameras saw within half a frame period,
  /// and each corner wears its motion.
  bool moving = false;
  Duration still = std::chrono::milliseconds(400);  ///< so long it has to stand
  size_t still_images = 3;                          ///< in so many images of each camera
  double still_share = 0.0012;   ///< way of the corners that counts as none, of the image's width
  double new_share = 0.04;       ///< way to another pose, of the image's diagonal ...
  double new_deg = 10;           ///< ... or turn
  double widest_edge_px = 5;     ///< what is less sharp is not taken
  size_t min_corners = 8;        ///< of a view
  size_t views = 12;             ///< of a camera whose lens is solved for, at least
  size_t known_views = 5;        ///< of one whose lens is given
  size_t links = 5;              ///< sets that join two cameras
  double coverage = 0.6;         ///< share of the image's 10x8 cells ...
  double region_coverage = 0.4;  ///< ... and of those of each ninth of the image
  double depth_ratio = 1.8;      ///< farthest over nearest middle of the target
  double tilt_deg = 14;          ///< towards each of the four sides
};

/// A ninth of an image: column 0 left, row 0 at the top.
struct ImageRegion {
  int column = 1, row = 1;
  bool operator==(const ImageRegion&) const = default;
};

/// The side of the target, as the picture shows it, that comes towards the camera.
enum class TiltSide : uint8_t { kLeft, kRight, kTop, kBottom };

/// What is missing next.
struct CaptureAdvice {
  enum class Kind : uint8_t {
    kShow,      ///< in `camera`, as region, distance and tilt say
    kTogether,  ///< where `camera` and `other` see it at once
    kWait,      ///< nothing is missing, the solution is not there yet
    kDone,      ///< the report passes
  };
  enum class Distance : uint8_t { kAny, kNearer, kFarther };
  Kind kind = Kind::kShow;
  size_t camera = 0, other = 0;
  std::optional<ImageRegion> region;
  Distance distance = Distance::kAny;
  std::optional<TiltSide> tilt;
  std::string words;  ///< "left: show the board in the upper right corner, nearer"
};

/// What came of one image.
struct CaptureStep {
  enum class Kind : uint8_t {
    kNotSeen,  ///< by no camera
    kMoving,   ///< hold it still
    kBlurred,  ///< `camera` does not see it sharply
    kKnown,    ///< it was taken at this pose already
    kTaken,    ///< a set was taken
  };
  Kind kind = Kind::kNotSeen;
  size_t camera = 0;
};

/// How far one camera is.
struct CameraProgress {
  size_t images = 0, seen = 0;  ///< looked at; that showed the target
  size_t views = 0;             ///< taken
  double coverage = 0;          ///< share of the cells
  double depth_ratio = 1;
  std::array<bool, 4> tilted{};  ///< by TiltSide
  bool lens_known = false;
  bool complete = false;  ///< links aside
  double share = 0;       ///< 0..1, of all that it needs
};

/// What one camera's views cover: how many corners each cell of its image has, row by row.
struct CoverageCells {
  int columns = 0, rows = 0;
  std::vector<int> corners;
};

/// Guides a person who shows a target to the cameras of a rig: takes a set of views when the target
/// stands still (all cameras that see it now), is sharp and somewhere new, and says what is missing
/// next. Passive; same calls, same result; one thread at a time. add() takes well below a
/// millisecond, with a set taken some ten.
class CaptureGuide {
 public:
  /// Cameras by name; their sizes may be set later, before the first image of each. `priors` by
  /// camera, as for the solution: a known lens needs fewer views.
  CaptureGuide(const CalibrationTarget& target, const std::vector<ViewedCamera>& cameras,
               const std::vector<CameraPrior>& priors, const CaptureGuideOptions& options = {});
  ~CaptureGuide();
  CaptureGuide(CaptureGuide&&) noexcept;
  CaptureGuide& operator=(CaptureGuide&&) noexcept;

  /// Refused: another size than before, or than its known lens.
  Status set_image_size(size_t camera, int width, int height);

  /// The next image of a camera; captures of a camera grow. Refused: corners that no solver could
  /// use, as a mirrored target; nothing is taken then.
  Result<CaptureStep> add(const TargetSight& sight);

  /// Takes all sets of an earlier capture over. Refused: another target, or other cameras.
  Status resume(const CalibrationViews& views);

  /// A solution of what was taken when there were `sets` sets, and its report: lenses are known
  /// better from then on, and the advice goes by the report once nothing else is missing.
  void judge(const RigSolution& solution, const RigReport& report, size_t sets);

  const CalibrationViews& views() const;
  const std::vector<CameraProgress>& progress() const;
  size_t links(size_t a, size_t b) const;  ///< sets in which both saw it
  double share() const;                    ///< 0..1, of everything
  bool complete() const;                   ///< nothing is missing but the report
  bool passed() const;                     ///< and the newest report is good
  CaptureAdvice advice() const;

  CoverageCells coverage(size_t camera) const;
  const CaptureGuideOptions& options() const;

  /// What the camera has seen, as an SVG picture of its own: cells, outlines of the target, and
  /// where it should be shown next.
  std::string coverage_svg(size_t camera) const;
  /// All of them on a page that loads itself anew every two seconds until `over`.
  std::string page(bool over) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
