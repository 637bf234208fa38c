// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/depth_renderer.hpp"

namespace sightline {

/// An object and itself, turned, as they look from one side: pixel by pixel, what differs.
struct SymmetryComparison {
  enum class Pixel : uint8_t {
    kNothing,     ///< background of both
    kSame,        ///< the same surface in the same color
    kOnlyAsIs,    ///< the object as it is, background after the turn
    kOnlyTurned,  ///< the other way round
    kSurface,     ///< nearer or farther by more than 6 % of the radius
    kColor,       ///< the same surface in another color
  };
  std::vector<Pixel> pixels;  ///< by rows, of a square picture
  double silhouette = 0;      ///< kOnlyAsIs and kOnlyTurned, over all but kNothing
  double surface = 0;         ///< those and kSurface
  double color = 0;           ///< kColor
  /// Middle of the surface of the object as it is that differs; object frame [m].
  std::optional<Eigen::Vector3d> centroid;
};

/// What breaks a near symmetry, and from where that is seen: shares of what either picture covers,
/// of surface and color.
struct SymmetryBreaking {
  double mean = 0;   ///< over 42 sides, of the turn that is told least there
  double least = 2;  ///< of the side that hides it best
  double most = -1;  ///< of the side that shows it best ...
  double color = 0;  ///< ... and what of it is color alone
  /// These sides; object frame, towards the camera.
  Eigen::Vector3d hidden_from = Eigen::Vector3d::Zero(), shown_from = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> centroid;  ///< as of SymmetryComparison, seen from shown_from
};

/// Draws an object from any side, as it is and turned, and compares pixel by pixel. One thread.
class SymmetryComparer {
 public:
  /// As the camera sees it, 8 radii away.
  struct Picture {
    std::vector<float> depth;                        ///< [m] by rows; 0: background
    std::array<std::vector<uint8_t>, 3> color = {};  ///< Y, U, V; empty without colors
  };

  /// Pictures of `side` x `side` pixels, which the bounding sphere (object frame, meters) fills to
  /// 94 %. Without `colors` the shape alone is compared.
  static Result<SymmetryComparer> create(const Eigen::Vector3d& center, double radius, int side,
                                         const DepthRendererFactory& depth,
                                         const ColorRendererFactory& colors = {});

  /// `direction`: unit, object frame, towards the camera. The turned object is at turn * object.
  SymmetryComparison compare(const Eigen::Vector3d& direction, const Rigid3& turn);
  /// Of these turns (one at least) the one that is hardest to tell from there; compared last.
  SymmetryComparison hardest(const Eigen::Vector3d& direction, std::span<const Rigid3> turns);
  /// The same from 42 sides spread over the sphere.
  SymmetryBreaking from_all_sides(std::span<const Rigid3> turns);
  /// Of the last comparison.
  const Picture& as_it_is() const { return as_is_; }
  const Picture& turned() const { return turned_; }
  int side() const { return camera_.width(); }

 private:
  SymmetryComparer(const Eigen::Vector3d& center, double radius, const CameraModel& camera);
  void draw(const Rigid3& camera_from_object, Picture& picture);
  SymmetryComparison::Pixel pixel(size_t at) const;

  Eigen::Vector3d center_;
  double radius_;
  CameraModel camera_;
  std::unique_ptr<DepthRenderer> depth_;  ///< null where colors_ draws depth, too
  std::unique_ptr<ColorRenderer> colors_;
  Picture as_is_, turned_;
  Eigen::Vector3d direction_ = Eigen::Vector3d::Zero();  ///< of as_is_
};

}  // namespace sightline
