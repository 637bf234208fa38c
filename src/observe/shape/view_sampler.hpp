// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "observe/shape/mesh_creases.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// Takes the samples of one view out of its depth image. Keeps scratch between views.
class ViewSampler {
 public:
  struct Sampled {
    std::vector<ContourSample> contour;
    std::vector<InnerEdgeSample> edges;
    float area = 0, contour_length = 0;
    ViewpointModel::Mask mask{};
  };

  /// The renderer's camera is square and sees the whole mesh about `center` from any side at the
  /// distance of the views.
  ViewSampler(const CameraModel& camera, const ViewpointModelOptions& options,
              const Eigen::Vector3d& center, double radius, std::vector<CreasePoint> creases);

  /// An empty contour means that nothing was drawn.
  void sample(const DepthTile& tile, const Rigid3& camera_from_object, Sampled& out);

 private:
  struct OutlinePoint {
    Eigen::Vector2f pixel, normal;
    float from_start;  ///< along all outlines [px]
    float inverse_depth;
  };
  struct EdgeCandidate {
    Eigen::Vector2f pixel, across;  ///< across: unit, in the image
    InnerEdgeSample sample;
  };

  bool inside(int x, int y) const { return depth_.at(x, y) > 0; }
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(side_) + static_cast<size_t>(x);
  }
  Eigen::Vector3f object_point(const Eigen::Vector2f& pixel, float inverse_depth) const;
  void trace_outlines();
  void trace_from(int x, int y, int side);
  void smooth_outline(const std::vector<Eigen::Vector2i>& pixels, const std::vector<int>& sides);
  void mark_outline();
  void mark_sharp_outline();
  float walk_inside(const Eigen::Vector2f& from, const Eigen::Vector2f& step) const;
  float walk_outside(const Eigen::Vector2f& from, const Eigen::Vector2f& step) const;
  void take_contour(Sampled& out) const;
  void find_creases();
  bool visible(const Eigen::Vector2f& pixel, float inverse_depth) const;
  void find_depth_jumps();
  void add_jump(int x, int y);
  void take_edges(Sampled& out);
  float clearance(const EdgeCandidate& edge) const;
  void take_shape(Sampled& out) const;

  const ViewpointModelOptions options_;
  const int side_;
  const float focal_, middle_, radius_;
  const Eigen::Vector3d center_;
  const std::vector<CreasePoint> creases_;

  DepthTile depth_;
  Eigen::Matrix3f object_from_camera_;
  Eigen::Vector3f camera_in_object_;
  Eigen::Matrix3f camera_from_object_;
  Eigen::Vector3f object_in_camera_;
  std::vector<uint8_t> visited_;  ///< outline sides traced, one bit each
  std::vector<uint8_t> marks_;    ///< what runs through a pixel: kOutline, kCrease, kJump, kSharp
  std::vector<OutlinePoint> outline_;
  std::vector<EdgeCandidate> candidates_;
};

}  // namespace sightline::observe
