// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "observe/detect/looks/magnified_look.hpp"
#include "observe/detect/looks/reduced_look.hpp"
#include "observe/detect/pixels/edge_maps.hpp"
#include "observe/detect/pixels/frame_difference.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/pixels/region_borders.hpp"
#include "observe/detect/plan/search_distances.hpp"
#include "observe/detect/plan/search_size.hpp"
#include "observe/detect/pose_fit.hpp"
#include "observe/detect/search_camera.hpp"
#include "observe/detect/silhouette_search.hpp"
#include "sightline/base/executor.hpp"
#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/detect/search_work.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/observe/terms/foreground_map.hpp"

namespace sightline::observe {

/// The newest frame of every camera, and of those that take part in the detection under way what
/// its stages need. Cameras that take part are counted from 0 to size().
class DetectorFrames {
 public:
  /// `sizes`: of the cameras' frames, where those that are searched, and `cameras`, are smaller
  /// (see shrink_to_search()); none: they are searched as they are.
  DetectorFrames(std::vector<DetectorCamera> cameras, const DetectorOptions& options,
                 Executor executor = run_serially, std::vector<SearchSize> sizes = {});

  /// From the next frames on: where an object of this width [m] may be small in the image of a
  /// camera (kSmallObjectPx), FitCamera::magnified shows it at full size; where it may be large
  /// (kLargeObjectPx), FitCamera::reduced at a quarter of it.
  void show_at_its_size(const SearchDistances& distances, double width);

  /// See ObjectDetector::add_frame().
  void add(CameraId camera, const Frame& frame, const ForegroundMap* foreground);
  /// As many cameras as are needed to believe a pose see foreground.
  bool show_foreground() const;
  /// The same of what moves; looks for it.
  bool show_motion();
  /// After that: whether any of it is within this radius [m] of a point of the world, in as many
  /// cameras.
  bool moves_at(const Eigen::Vector3d& point, double radius) const;

  /// Which edges count: those near the foreground, those near what moves (after show_motion()), or
  /// all; all of cameras of which that is not known.
  enum class Where { kForeground, kMotion, kEverywhere };
  /// Chooses the frames that take part and finds their edges; false without any. The reference time
  /// is that of the newest.
  bool select(Where where);
  /// Whether there is any of that in the i-th camera that takes part, as far as is known.
  bool shows(size_t i, Where where) const;
  /// Which edges the responses are to in full: where anything may be, those between regions lead
  /// out of clutter; near a place that is known, any will do.
  enum class Edges { kAll, kBorders };
  /// Response maps of the chosen frames, for scan() and JointSearch; made when they are needed.
  void compute_responses(int margin, Edges edges);
  /// What is magnified is asked for about these poses of an object only.
  void magnify_about(std::span<const RigMotion> motions, const ViewpointModel& object);
  /// Time that poses refer to; those of the images count from it.
  void set_reference(Time reference);

  const std::vector<DetectorCamera>& cameras() const { return cameras_; }
  size_t size() const { return active_.size(); }
  Time newest() const { return newest_; }
  /// Of the i-th camera that takes part.
  size_t camera_index(size_t i) const { return active_[i]; }
  const SearchSize& size_of(size_t i) const { return sizes_[active_[i]]; }
  /// Images whose edges were found so far.
  SearchWork work() const;
  const FrameInfo& info(size_t i) const { return slots_[active_[i]].frame.info; }
  const ForegroundMap* foreground(size_t i) const;
  const EdgeImage& edges(size_t i) const { return edges_[i]; }
  /// 1 where edges count, of the half-size image; empty: everywhere.
  const std::vector<uint8_t>& mask(size_t i) const { return masks_[i]; }

  std::span<const SearchCamera> search_cameras() const { return search_cameras_; }
  std::span<const FitCamera> fit_cameras() const { return fit_cameras_; }
  const HalfSizeImage& image(size_t i) const { return slots_[active_[i]].frame.image; }
  /// Whether any of them shows colors; those of gray cameras do not.
  bool show_colors() const;
  /// Those whose foreground is known; none, if these are too few to believe a pose.
  std::vector<SilhouetteCamera> silhouette_cameras(const SearchDistances& distances) const;

 private:
  struct Slot {
    HalfSizeFrame frame;
    ForegroundMap foreground;
    bool has_foreground = false;
    FrameDifference difference;
    std::vector<uint8_t> motion;               ///< empty: not known, or too little or too much
    std::unique_ptr<MagnifiedLook> magnified;  ///< null: the object is never small in it
    std::unique_ptr<ReducedLook> reduced;      ///< null: it is never large in it
  };
  size_t needed() const;
  /// What the stages need of the i-th camera that takes part.
  void prepare(size_t i, Where where);

  std::vector<DetectorCamera> cameras_;  ///< those that turn: as in their newest frame
  std::vector<SearchSize> sizes_;        ///< of their frames
  const Duration max_age_;
  const double usual_speed_;
  const Executor executor_;
  std::vector<Slot> slots_;  ///< by camera

  SearchWork work_;
  Time newest_{};
  std::vector<size_t> active_;  ///< cameras that take part; what follows is by these
  std::vector<EdgeImage> edges_;
  std::vector<RegionBorders> borders_;
  std::vector<std::vector<uint8_t>> masks_;
  std::vector<SearchCamera> search_cameras_;
  std::vector<FitCamera> fit_cameras_;
};

}  // namespace sightline::observe
