// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/board_corners.hpp"

#include <algorithm>
#include <cmath>

#include "observe/fiducial/saddle_corner.hpp"

namespace sightline::observe {
namespace {

constexpr double kMarkerSigmaPx = 1.0;      // of a marker's corner as the detector gives it
constexpr double kMarkerAgreesPx = 3.0;     // farther off, a marker is not this board's
constexpr double kMarkerTolerancePx = 2.0;  // of a corner predicted from markers
constexpr double kCornerTolerancePx = 1.0;  // of a corner predicted from other corners

Eigen::Vector3d lift(const Eigen::Vector2d& p) { return {p.x(), p.y(), 0}; }

}  // namespace

BoardFinder::BoardFinder(const CharucoBoard& board, std::shared_ptr<const CalibratedCamera> camera)
    : board_(board), camera_(std::move(camera)) {
  CalibratedCamera origin = *camera_;
  origin.world_from_camera = Rigid3();
  at_origin_ = std::make_shared<const CalibratedCamera>(std::move(origin));
  layouts_.emplace_back(board, false);
  if (board.rows % 2 == 0) layouts_.emplace_back(board, true);
}

std::optional<BoardFinder::Fit> BoardFinder::fit(
    const BoardLayout& layout, const std::vector<SquareDetection>& markers) const {
  PlanarView view;
  std::vector<PointMatch> matches;
  std::vector<int> ids;
  for (const SquareDetection& marker : markers) {
    if (marker.code >= layout.markers()) continue;
    ids.push_back(marker.code);
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d point = layout.marker(marker.code)[k];
      view.points.push_back(point);
      view.pixels.push_back(marker.corners[k]);
      matches.push_back({lift(point), marker.corners[k], kMarkerSigmaPx});
    }
  }
  if (matches.empty()) return std::nullopt;
  const ReprojectionTerm term(at_origin_, matches, 2.0);
  const auto poses = pose_hypotheses(term, {view}, 1e9);
  if (poses.empty()) return std::nullopt;
  Fit out{poses.front().world_from_object, poses.front().cost, {}};
  for (size_t first = 0; first < matches.size(); first += 4) {
    bool agrees = true;
    for (size_t k = first; k < first + 4; ++k) {
      const auto pixel =
          at_origin_->model.project(out.camera_from_board * matches[k].point_in_object);
      agrees = agrees && pixel && (*pixel - matches[k].pixel).norm() < kMarkerAgreesPx;
    }
    if (agrees) out.good.push_back(ids[first / 4]);
  }
  return out;
}

const BoardLayout* BoardFinder::choose(const std::vector<SquareDetection>& markers, Fit& best) {
  std::vector<std::optional<Fit>> fits;
  for (const BoardLayout& layout : layouts_) fits.push_back(fit(layout, markers));
  if (layouts_.size() == 2) {
    // The wrong layout shifts every other row by a square, so two rows tell; one row does not.
    const size_t first = fits[0] ? fits[0]->good.size() : 0;
    const size_t second = fits[1] ? fits[1]->good.size() : 0;
    if (std::max(first, second) < 2 || first == second) return nullptr;
    const size_t keep = second > first ? 1 : 0;
    layouts_.erase(layouts_.begin() + static_cast<ptrdiff_t>(1 - keep));
    fits.erase(fits.begin() + static_cast<ptrdiff_t>(1 - keep));
  }
  if (!fits.front()) return nullptr;
  best = *fits.front();
  return &layouts_.front();
}

std::optional<Eigen::Vector2d> BoardFinder::refine(const PlaneView& gray, const BoardLayout& layout,
                                                   const Rigid3& camera_from_board, int corner,
                                                   double tolerance_px) const {
  const CameraModel& camera = camera_->model;
  const Eigen::Vector2d at = layout.corner(corner);
  const auto start = camera.project(camera_from_board * lift(at));
  if (!start) return std::nullopt;
  // The four neighboring squares, as far as they are plain.
  const double inset = (board_.square - board_.marker) / 2;
  std::array<Eigen::Vector2d, 4> around;  // x+y+, x-y-, x+y-, x-y+
  const std::array<Eigen::Vector2d, 4> steps = {Eigen::Vector2d(1, 1), Eigen::Vector2d(-1, -1),
                                                Eigen::Vector2d(1, -1), Eigen::Vector2d(-1, 1)};
  for (size_t k = 0; k < 4; ++k) {
    const auto pixel = camera.project(camera_from_board * lift(at + inset * steps[k]));
    if (!pixel) return std::nullopt;
    around[k] = *pixel - *start;
  }
  return refine_saddle(
      gray,
      {*start, around, layout.markers_on_main_diagonal(corner) != board_.inverted, tolerance_px});
}

std::optional<Rigid3> BoardFinder::pose_of(const PlanarView& view, double sigma_px) const {
  std::vector<PointMatch> matches;
  for (size_t i = 0; i < view.points.size(); ++i) {
    matches.push_back({lift(view.points[i]), view.pixels[i], sigma_px});
  }
  const auto poses = pose_hypotheses(ReprojectionTerm(at_origin_, matches, 2.0), {view}, 0);
  if (poses.empty()) return std::nullopt;
  return poses.front().world_from_object;
}

std::optional<PlanarView> BoardFinder::find(const PlaneView& gray,
                                            const std::vector<SquareDetection>& markers,
                                            int min_corners) {
  if (markers.empty()) return std::nullopt;
  Fit best;
  const BoardLayout* layout = choose(markers, best);
  if (layout == nullptr) return std::nullopt;
  const auto seen = [&](int id) {
    return std::find(best.good.begin(), best.good.end(), id) != best.good.end();
  };
  PlanarView view;
  std::vector<int> others;
  const auto add = [&](int corner, const Rigid3& camera_from_board, double tolerance_px) {
    const auto pixel = refine(gray, *layout, camera_from_board, corner, tolerance_px);
    if (!pixel) return;
    view.points.push_back(layout->corner(corner));
    view.pixels.push_back(*pixel);
  };
  for (int corner = 0; corner < layout->corners(); ++corner) {
    const auto [a, b] = layout->markers_at(corner);
    if (seen(a) || seen(b)) {
      add(corner, best.camera_from_board, kMarkerTolerancePx);
    } else {
      others.push_back(corner);
    }
  }
  if (static_cast<int>(view.points.size()) < min_corners) return std::nullopt;
  if (others.empty()) return view;
  if (const auto pose = pose_of(view, kMarkerSigmaPx)) {
    for (int corner : others) add(corner, *pose, kCornerTolerancePx);
  }
  return view;
}

}  // namespace sightline::observe
