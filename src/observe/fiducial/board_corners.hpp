// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "observe/fiducial/board_layout.hpp"
#include "observe/fiducial/square_detector.hpp"
#include "observe/terms/plane_pose.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// Finds the inner corners of one ChArUco board from its markers: pose of the board from the
/// markers' corners, inner corners next to a marker projected through the lens, and refined as
/// saddle points at full size in a window that ends before the markers begin. The pose of those
/// then says where the other inner corners are, also where a marker was too small to decode.
class BoardFinder {
 public:
  BoardFinder(const CharucoBoard& board, std::shared_ptr<const CalibratedCamera> camera);

  /// `markers`: detections whose `code` is the marker's id. Empty if there are fewer than
  /// `min_corners` corners, or if nothing tells yet which layout was printed.
  std::optional<PlanarView> find(const PlaneView& gray, const std::vector<SquareDetection>& markers,
                                 int min_corners);

 private:
  struct Fit {
    Rigid3 camera_from_board;
    double cost = 0;
    std::vector<int> good;  ///< ids of the markers that agree
  };
  std::optional<Fit> fit(const BoardLayout& layout,
                         const std::vector<SquareDetection>& markers) const;
  const BoardLayout* choose(const std::vector<SquareDetection>& markers, Fit& fit);
  std::optional<Eigen::Vector2d> refine(const PlaneView& gray, const BoardLayout& layout,
                                        const Rigid3& camera_from_board, int corner,
                                        double tolerance_px) const;
  std::optional<Rigid3> pose_of(const PlanarView& view, double sigma_px) const;

  CharucoBoard board_;
  std::shared_ptr<const CalibratedCamera> camera_;
  std::shared_ptr<const CalibratedCamera> at_origin_;  ///< the same lens, world = camera
  std::vector<BoardLayout> layouts_;                   ///< still possible; one once decided
};

}  // namespace sightline::observe
