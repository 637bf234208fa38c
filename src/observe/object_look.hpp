// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "appearance.hpp"
#include "contour_lines.hpp"
#include "edge_lines.hpp"
#include "line_fit.hpp"
#include "sightline/observe/object_tracker.hpp"
#include "texture_points.hpp"

namespace sightline::observe {

/// Where an object is looked for: a pose and how far it may be off.
struct LookAt {
  Rigid3 world_from_object;
  Matrix6 covariance;
  bool doubtful = false;  ///< it may be another pose that looks alike
};

/// The camera side of all looks: shared by the objects of one tracker.
struct LookCamera {
  std::shared_ptr<const CalibratedCamera> camera;
  Rigid3 camera_from_world;
  TrackerOptions options;
  SceneDepth scene;
  LightTable light;
};

/// One object in one camera: fits the outline around a predicted pose, coarse to fine, and makes
/// the terms. The prediction only places lines; what is handed out is the likelihood alone. Buffers
/// are kept from frame to frame.
class ObjectLook {
 public:
  ObjectLook(const LookCamera& camera, TrackedObject object);

  const TrackedObject& object() const { return object_; }
  Appearance& appearance() { return appearance_; }

  /// Measures around `at` with the colours known, or, if `fresh_colors` or none are known, with
  /// colours as this frame shows them there. Appends terms if the object is seen.
  void measure(const Frame& frame, const LookAt& at, bool fresh_colors,
               std::span<const HidingSphere> spheres, std::vector<PoseTermPtr>& terms);

  /// What texture (if it is known whose side it is) and the mesh's colours say of the fitted pose
  /// and of those that look alike; nothing is appended if nothing is known.
  void compare_sides(const Frame& frame, bool texture_tells, std::vector<PoseHypothesis>& alike);
  /// True if anything was learned of its look.
  bool learned() const { return appearance_.known() || (texture_ && texture_->kept() > 0); }
  void forget_learned();

  /// Pose at which the lines of the last measure() were placed last.
  const Rigid3& fitted() const { return world_from_object_; }
  /// Viewing side of the last measure().
  size_t side() const { return side_; }
  const ObjectTracker::Look& look() const { return look_; }
  /// How far the outline as it was placed last lies from that of another pose [px], rms over lines.
  double outline_distance(const Rigid3& world_from_object) const;
  /// What the texture of the frame measured last offers; and what to make of it when its estimate
  /// is known.
  void note_texture(const Frame& frame);
  void keep_texture(const Rigid3& world_from_object);
  void drop_texture();
  /// Colours around the fitted pose, for learning.
  void collect(const Frame& frame, std::vector<uint16_t>& foreground,
               std::vector<uint16_t>& background);

 private:
  void place(const Rigid3& world_from_object);
  const SideAppearance* colors_for(const ColorReader& frame, double spread_px);
  void fit_outline(const ColorReader& frame, double spread_px, bool fresh_colors);
  void refine(double huber);
  bool judge();
  PoseTermPtr region_term();
  PoseTermPtr texture_term(const Frame& frame);
  void edge_terms(const Frame& frame, std::vector<PoseTermPtr>& terms);
  void add_edge_term(std::vector<LineMatch> matches, const LineError& error,
                     std::vector<PoseTermPtr>& terms);
  void add_edges(size_t from, size_t to, const Vector6& step, double weight, double min_share,
                 std::vector<LineMatch>& matches);
  bool outline_steps_agree(size_t outer, const Vector6& step);
  double independent_share(double correlation_px) const;
  double pixels_per_meter() const;

  const LookCamera& camera_;
  TrackedObject object_;
  Appearance appearance_;
  SideAppearance fresh_;  ///< of this very frame
  const SideAppearance* colors_ = nullptr;

  LookAt at_;
  Matrix6 prior_;
  Rigid3 world_from_object_;
  size_t view_ = 0;
  size_t side_ = 0;
  Hiders hiders_;
  std::vector<ContourLine> lines_;
  std::vector<EdgeLine> edges_;
  std::vector<LineResidual> residuals_;
  std::vector<double> scratch_;
  std::vector<uint16_t> foreground_, background_;
  double region_scale_ = 1;
  Vector6 region_step_ = Vector6::Zero();
  ObjectTracker::Look look_;
  std::unique_ptr<TexturePoints> texture_;  ///< null: no cue
  std::vector<bool> outliers_;
};

}  // namespace sightline::observe
