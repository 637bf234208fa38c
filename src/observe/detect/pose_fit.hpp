// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/edge_maps.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/terms/rig_motion.hpp"
#include "sightline/base/executor.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/pose_term.hpp"
#include "sightline/observe/detect/search_work.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

class MagnifiedLook;
class ReducedLook;

/// One camera's image at half size, and when it was taken.
struct FitCamera {
  const CalibratedCamera* camera = nullptr;
  Rigid3 camera_from_world;
  const HalfSizeImage* image = nullptr;
  const EdgeImage* edges = nullptr;
  double seconds = 0;                         ///< capture after the reference time
  const ForegroundMap* foreground = nullptr;  ///< of the image's size; null: not known
  /// The same with twice as many pixels, for poses at which the object is small; null: none.
  const MagnifiedLook* magnified = nullptr;
  /// With half as many, for poses at which it is large; null: none.
  const ReducedLook* reduced = nullptr;
  double pixel_size = 2;  ///< of the image and its edges [pixels of the camera]
};

/// What one camera says of a fitted pose.
struct CameraFit {
  int lines = 0;          ///< samples that project into the image
  int agreeing = 0;       ///< that have an edge of their direction close by
  double contrast = 0;    ///< see outline_contrast()
  double pixel_size = 2;  ///< of the image looked at
  LinearizedTerm term;    ///< at this camera's own time; `cost` and `information` of the lines
  double share() const { return lines > 0 ? static_cast<double>(agreeing) / lines : 0; }
};

struct PoseFit {
  RigMotion motion;
  std::vector<CameraFit> cameras;
};

/// How much is put into a fit.
struct FitEffort {
  int iterations = 8;
  size_t sample_step = kSampleStep;  ///< every n-th line
  bool contrast = true;              ///< CameraFit::contrast is asked for
  bool moved = false;                ///< since it was there: reaches as far where it is magnified
  double rest = 1;                   ///< weight of the prior that it rests
  bool rough = false;                ///< where it is large, at a quarter of the image's size
};

/// Third stage of a detection: moves a pose and its twist onto the edges of all images. For every
/// sample of the outline and of the creases the best edge along its normal, Gauss-Newton on the
/// distances (Drummond and Cipolla, PAMI 2002), each camera at its own time. Where the outline
/// finds no edge, the border of the foreground is one.
class PoseFitter {
 public:
  explicit PoseFitter(const ViewpointModel& model, Executor executor = run_serially);

  /// `reach` [half-size px; where it is magnified, of that]: how far the first step looks for
  /// edges.
  PoseFit fit(std::span<const FitCamera> cameras, const RigMotion& start, double reach,
              const FitEffort& effort = {}) const;
  /// The same for each of these.
  std::vector<PoseFit> fit(std::span<const FitCamera> cameras, std::span<const RigMotion> starts,
                           double reach, const FitEffort& effort = {}) const;
  /// A motion about the object's center in all rotations that may leave its shape as it is.
  std::vector<RigMotion> rotated(const RigMotion& motion) const;
  /// The same in the principal_turns().
  std::vector<RigMotion> turned(const RigMotion& motion) const;
  /// These, fitted anew: rivals of a symmetric object.
  std::vector<PoseFit> fit_rotated(std::span<const FitCamera> cameras,
                                   const RigMotion& fitted) const;
  /// The same with CameraFit::contrast, which was not asked for.
  PoseFit with_contrast(std::span<const FitCamera> cameras, PoseFit fit) const;
  /// What every n-th line says of a motion as it is, roughly; contrast is not asked for.
  PoseFit lines(std::span<const FitCamera> cameras, const RigMotion& motion,
                size_t sample_step) const;
  /// What the images say of a motion as it is.
  PoseFit evaluate(std::span<const FitCamera> cameras, const RigMotion& motion) const;
  /// Root of the mean area of the object's silhouette over all sides [m].
  double width() const { return width_; }
  /// The camera to look with at a pose: magnified where the object is small there and noise allows;
  /// `rough`: reduced where it is large.
  const FitCamera& look(const FitCamera& camera, const Rigid3& world_from_object,
                        bool rough = false) const;
  /// Fits, and poses looked at, so far. One thread at a time.
  const WorkMeter& work() const { return work_; }

 private:
  CameraFit fit_lines(const FitCamera& camera, const Rigid3& world_from_object, double reach,
                      double sigma, size_t sample_step = kSampleStep) const;
  std::vector<RigMotion> after(std::span<const Eigen::Quaterniond> rotations,
                               const RigMotion& motion) const;
  struct Placement;
  void add_line(const Placement& at, const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                bool outline, CameraFit& out) const;
  double contrast(const FitCamera& camera, const Rigid3& world_from_object) const;

  const ViewpointModel& model_;
  const Executor executor_;
  const double width_;  ///< root of the mean area of the silhouette [m]
  const std::vector<Eigen::Quaterniond> rotations_, turns_;  ///< principal_rotations(), _turns()
  mutable WorkMeter work_;
};

}  // namespace sightline::observe
