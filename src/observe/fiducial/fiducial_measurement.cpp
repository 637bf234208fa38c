// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/fiducial_measurement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "observe/terms/plane_pose.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"

namespace sightline::observe {
namespace {

PlanarView view_of(const FiducialObject& object, const SeenFiducial& seen) {
  const Fiducial& f = object.description.fiducials[static_cast<size_t>(seen.fiducial)];
  const auto corners = square_corners(f.size);
  return {f.object_from_fiducial,
          {corners.begin(), corners.end()},
          {seen.corners.begin(), seen.corners.end()}};
}

void add_matches(const PlanarView& view, double sigma_px, std::vector<PointMatch>& out) {
  for (size_t i = 0; i < view.points.size(); ++i) {
    const Eigen::Vector3d point =
        view.object_from_plane * Eigen::Vector3d(view.points[i].x(), view.points[i].y(), 0);
    out.push_back({point, view.pixels[i], sigma_px});
  }
}

// The limit is wide because the pose of one small marker is rough.
bool agrees(const FiducialObject& object, const SeenFiducial& seen, const CameraModel& camera,
            const Rigid3& camera_from_object) {
  const double limit = std::max(4.0, 0.25 * shortest_side(seen.corners));
  const SquareInObject& square = object.squares[static_cast<size_t>(seen.fiducial)];
  for (size_t k = 0; k < 4; ++k) {
    const auto pixel = camera.project(camera_from_object * square[k]);
    if (!pixel || (*pixel - seen.corners[k]).norm() > limit) return false;
  }
  return true;
}

// Consensus: the poses of each marker alone are candidates, and the markers whose corners come out
// near where they were seen support one. The largest support is kept.
void drop_contradicting(FiducialObject& object, const CameraModel& camera) {
  std::vector<SeenFiducial>& fiducials = object.fiducials;
  if (fiducials.size() < 2) return;
  std::vector<SeenFiducial> best;
  double best_side = -1;
  for (const SeenFiducial& candidate : fiducials) {
    const PlanarView view = view_of(object, candidate);
    for (const Rigid3& camera_from_plane : plane_poses(camera, view)) {
      const Rigid3 camera_from_object = camera_from_plane * view.object_from_plane.inverse();
      std::vector<SeenFiducial> supporting;
      for (const SeenFiducial& seen : fiducials) {
        if (seen.fiducial == candidate.fiducial ||
            agrees(object, seen, camera, camera_from_object)) {
          supporting.push_back(seen);
        }
      }
      const double side = shortest_side(candidate.corners);
      if (supporting.size() > best.size() ||
          (supporting.size() == best.size() && side > best_side)) {
        best = std::move(supporting);
        best_side = side;
      }
    }
  }
  if (!best.empty()) fiducials = std::move(best);
}

}  // namespace

FiducialCounts measure_fiducials(FiducialObject& object, const PlaneView& gray,
                                 const std::shared_ptr<const CalibratedCamera>& camera,
                                 const FiducialOptions& options, Observation& out) {
  const auto with_calibration = [&](double sigma_px) {
    return std::hypot(sigma_px, options.calibration_share * camera->rms_px);
  };
  std::vector<PlanarView> views;
  std::vector<PointMatch> matches;
  if (object.board) {
    if (auto view = object.board->find(gray, object.board_markers, options.min_board_corners)) {
      add_matches(*view, with_calibration(options.board_sigma_px), matches);
      views.push_back(std::move(*view));
    }
  }
  FiducialCounts counts;
  counts.refused = object.fiducials.size();
  drop_contradicting(object, camera->model);
  counts.refused -= object.fiducials.size();
  for (const SeenFiducial& seen : object.fiducials) {
    views.push_back(view_of(object, seen));
    add_matches(views.back(), with_calibration(seen.sigma_px), matches);
  }
  if (matches.empty()) return counts;
  counts.accepted = views.size();
  const auto term = std::make_shared<ReprojectionTerm>(camera, std::move(matches), options.huber,
                                                       options.view_error);
  out.hypotheses = pose_hypotheses(*term, views, options.flip_cost_margin);
  out.terms.push_back(term);
  return counts;
}

}  // namespace sightline::observe
