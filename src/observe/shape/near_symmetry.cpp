// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/near_symmetry.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "observe/shape/side_view.hpp"
#include "observe/shape/view_sphere.hpp"

namespace sightline {
namespace {

constexpr int kSide = 128;                                          // [px] of a picture
constexpr size_t kSteps = 24;                                       // of a full turn
constexpr double kMaxDifference = 0.15;                             // of the silhouette, by a turn
constexpr double kMaxAboutAxis = 0.2, kMaxSurfaceAboutAxis = 0.35;  // by every turn about an axis
constexpr double kMaxBeforeSteps = 0.3;  // the same of a turn about a principal axis exactly
// A turn that changes more from the first views is not looked at from the others.
constexpr double kFewViews = 8, kHopeless = 0.5;
constexpr double kFirstStep = 0.1, kLastStep = 0.01;  // [rad, radii]

// Middle and principal axes of the surface, and how far it reaches.
struct Frame {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  double radius = 0;
};

Frame frame_of(const TriangleMesh& mesh) {
  Frame out;
  double area = 0;
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const auto& face : mesh.faces) {
    std::array<Eigen::Vector3d, 3> p;
    for (size_t i = 0; i < 3; ++i) p[i] = mesh.vertices[face[i]].cast<double>();
    const double a = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    const Eigen::Vector3d sum = p[0] + p[1] + p[2];
    area += a;
    out.middle += a / 3 * sum;
    // Of a triangle: a / 12 (sum sum^T + sum of p p^T).
    moments += a / 12 * (sum * sum.transpose());
    for (const Eigen::Vector3d& q : p) moments += a / 12 * (q * q.transpose());
  }
  if (!(area > 0)) return out;
  out.middle /= area;
  moments = moments / area - out.middle * out.middle.transpose();
  out.axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors();
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    out.radius = std::max(out.radius, (vertex.cast<double>() - out.middle).norm());
  }
  return out;
}

// Depth at every pixel, in radii behind the nearest point of the bounding sphere; 0: nothing.
class Picture {
 public:
  void draw(DepthRenderer& renderer, const Rigid3& camera_from_object, double radius) {
    depth_.assign(kSide * kSide, 0);
    const DepthTile tile = renderer.render(camera_from_object);
    for (int y = 0; y < tile.height; ++y) {
      for (int x = 0; x < tile.width; ++x) {
        const float inverse = tile.row(y)[x];
        if (!(inverse > 0)) continue;
        depth_[static_cast<size_t>((tile.y + y) * kSide + tile.x + x)] =
            static_cast<float>(1 / (double{inverse} * radius) - observe::kSideDistance + 1) + 1e-6f;
      }
    }
  }
  TurnDifference operator-(const Picture& other) const {
    int either = 0, one = 0, apart = 0;
    for (size_t i = 0; i < depth_.size(); ++i) {
      const bool a = depth_[i] > 0, b = other.depth_[i] > 0;
      either += a || b;
      one += a != b;
      apart += a && b &&
               std::abs(depth_[i] - other.depth_[i]) > static_cast<float>(observe::kSameSurface);
    }
    const double all = std::max(1, either);
    return {one / all, (one + apart) / all};
  }

 private:
  std::vector<float> depth_;
};

class Comparison {
 public:
  Comparison(const Frame& frame, DepthRenderer& renderer) : frame_(frame), renderer_(renderer) {
    for (const Eigen::Vector3d& direction : observe::make_view_sphere(1).directions) {
      views_.push_back(
          {direction, observe::side_pose(direction, frame_.middle, frame_.radius), {}});
      views_.back().picture.draw(renderer_, views_.back().camera_from_object, frame_.radius);
    }
  }

  // About the middle of the surface.
  NearSymmetry of(const Eigen::AngleAxisd& turn) {
    const Eigen::Quaterniond rotation(turn);
    return of(Rigid3(rotation, frame_.middle - rotation * frame_.middle));
  }

  // A turn may lie beside the principal axes and the middle: small steps to the least difference.
  NearSymmetry improved(NearSymmetry best, const Eigen::AngleAxisd& start) {
    const Eigen::Quaterniond rotation(start);
    Rigid3 at(rotation, frame_.middle - rotation * frame_.middle);
    const Rigid3 to_middle(Eigen::Quaterniond::Identity(), frame_.middle);
    for (double step = kFirstStep; step > kLastStep; step /= 2) {
      for (int i = 0; i < 12; ++i) {
        Vector6 move = Vector6::Zero();
        move[i / 2] = (i % 2 == 0 ? step : -step) * (i / 2 < 3 ? 1 : frame_.radius);
        const Rigid3 moved = at * to_middle * Rigid3::exp(move) * to_middle.inverse();
        const NearSymmetry there = of(moved);
        if (there.mean.silhouette >= best.mean.silhouette) continue;
        best = there;
        at = moved;
      }
    }
    return best;
  }

 private:
  struct SeenFrom {
    Eigen::Vector3d direction;  // object frame, towards the camera
    Rigid3 camera_from_object;
    Picture picture;
  };

  NearSymmetry of(const Rigid3& turned) {
    NearSymmetry out{Eigen::AngleAxisd(turned.rotation), turned, {}, 2, {}, -1, {}};
    TurnDifference sum;
    double drawn = 0;
    for (const SeenFrom& view : views_) {
      scratch_.draw(renderer_, view.camera_from_object * turned, frame_.radius);
      const TurnDifference difference = view.picture - scratch_;
      sum.silhouette += difference.silhouette;
      sum.surface += difference.surface;
      out.mean = {sum.silhouette / ++drawn, sum.surface / drawn};
      if (drawn >= kFewViews && out.mean.silhouette > kHopeless) return out;
      if (difference.silhouette < out.least) {
        out.least = difference.silhouette;
        out.hides = view.direction;
      }
      if (difference.silhouette > out.most) {
        out.most = difference.silhouette;
        out.shows = view.direction;
      }
    }
    return out;
  }

  const Frame& frame_;
  DepthRenderer& renderer_;
  std::vector<SeenFrom> views_;
  Picture scratch_;
};

bool less_silhouette(const NearSymmetry& a, const NearSymmetry& b) {
  return a.mean.silhouette < b.mean.silhouette;
}

// Turns about one axis: local minima, and the axis itself if every turn is possible. Those of more
// than half a turn are the inverse of others and differ by as much.
void add_turns(Comparison& comparison, const Eigen::Vector3d& axis, NearSymmetries& out) {
  const auto angle = [](size_t i) {
    return 2 * std::numbers::pi * static_cast<double>(i) / kSteps;
  };
  std::vector<NearSymmetry> turns;
  for (size_t i = 1; i <= kSteps / 2; ++i) {
    turns.push_back(comparison.of(Eigen::AngleAxisd(angle(i), axis)));
  }
  const auto most = static_cast<size_t>(
      std::max_element(turns.begin(), turns.end(), less_silhouette) - turns.begin());
  if (turns[most].mean.silhouette <= kMaxAboutAxis) {
    const NearSymmetry worst =
        comparison.improved(turns[most], Eigen::AngleAxisd(angle(most + 1), axis));
    if (worst.mean.surface <= kMaxSurfaceAboutAxis) {
      out.axes.push_back(worst);
      return;
    }
  }
  for (size_t i = 1; i < turns.size(); ++i) {
    const NearSymmetry& turn = turns[i];
    const bool last = i + 1 == turns.size();
    if (turn.mean.silhouette > kMaxBeforeSteps || less_silhouette(turns[i - 1], turn) ||
        (!last && !less_silhouette(turn, turns[i + 1])))
      continue;
    const NearSymmetry best = comparison.improved(turn, Eigen::AngleAxisd(angle(i + 1), axis));
    if (best.mean.silhouette <= kMaxDifference) out.turns.push_back(best);
  }
}

// A point on the axis of a turn by `transform`, next to the origin: (I - R) p = t.
Eigen::Vector3d point_on_axis(const Rigid3& transform) {
  const Eigen::Matrix3d left = Eigen::Matrix3d::Identity() - transform.rotation.toRotationMatrix();
  return left.completeOrthogonalDecomposition().solve(transform.translation);
}

}  // namespace

std::vector<Rigid3> near_rotations_of(const NearSymmetries& near, size_t most,
                                      const std::function<bool(const Rigid3&)>& same) {
  std::vector<Rigid3> out;
  const auto add = [&](const Rigid3& transform) {
    if (out.size() < most && !same(transform)) out.push_back(transform);
  };
  for (const NearSymmetry& axis : near.axes) {
    const Eigen::Vector3d point = point_on_axis(axis.transform);
    for (size_t i = 1; i < kSteps; ++i) {
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(
          2 * std::numbers::pi * static_cast<double>(i) / kSteps, axis.turn.axis()));
      add(Rigid3(turn, point - turn * point));
    }
  }
  for (const NearSymmetry& turn : near.turns) {
    if (turn.mean.surface > kMaxSurfaceAboutAxis) continue;  // edges inside tell it
    add(turn.transform);
    const Rigid3 back = turn.transform.inverse();
    if (rotation_angle(turn.transform, back) > kFirstStep) add(back);
  }
  return out;
}

std::optional<ShapeSymmetry::Axis> near_axis_of(const NearSymmetries& near) {
  if (near.axes.empty()) return std::nullopt;
  const NearSymmetry& axis = near.axes.front();
  return ShapeSymmetry::Axis{axis.turn.axis(), point_on_axis(axis.transform), false};
}

Result<NearSymmetries> find_near_symmetries(const TriangleMesh& mesh,
                                            const DepthRendererFactory& factory) {
  const Frame frame = frame_of(mesh);
  if (!(frame.radius > 0)) {
    return make_error(ErrorCode::kInvalidInput, "near symmetry", "the mesh has no surface");
  }
  SL_ASSIGN(const CameraModel camera, observe::side_camera(kSide));
  const std::unique_ptr<DepthRenderer> renderer = factory(camera);
  Comparison comparison(frame, *renderer);
  NearSymmetries out;
  for (int i = 0; i < 3; ++i) add_turns(comparison, frame.axes.col(i), out);
  std::stable_sort(out.turns.begin(), out.turns.end(), less_silhouette);
  return out;
}

}  // namespace sightline
