// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/shape/viewpoint_model.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "observe/shape/mesh_creases.hpp"
#include "observe/shape/revolved_surface.hpp"
#include "observe/shape/self_symmetry.hpp"
#include "observe/shape/view_sampler.hpp"
#include "observe/shape/view_sphere.hpp"
#include "observe/shape/viewpoint_model_builder.hpp"
#include "sightline/base/log.hpp"
#include "sightline/observe/shape/near_symmetry.hpp"

namespace sightline {

using observe::look_at_center;
using observe::make_view_sphere;
using observe::ViewSphere;

namespace {

constexpr double kFilled = 0.94;   // of the image's side by the bounding sphere
constexpr double kSameTurn = 0.1;  // [rad]
constexpr int kCells = 16;         // of one side of the cube of directions

// Pixels of the cube: which face, and where on it.
size_t cell_of(const Eigen::Vector3d& direction) {
  int axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  const double size = direction[axis];
  const auto along = [&](int other) {
    const double place = (direction[other] / std::abs(size) + 1) / 2 * kCells;
    return static_cast<size_t>(std::clamp(static_cast<int>(place), 0, kCells - 1));
  };
  const size_t face = static_cast<size_t>(2 * axis + (size < 0 ? 1 : 0));
  return (face * kCells + along((axis + 1) % 3)) * kCells + along((axis + 2) % 3);
}

Eigen::Vector3d middle_of_cell(size_t cell) {
  const auto place = [](size_t i) { return (2.0 * static_cast<double>(i) + 1) / kCells - 1; };
  const size_t face = cell / (kCells * kCells);
  const int axis = static_cast<int>(face / 2);
  Eigen::Vector3d direction;
  direction[axis] = face % 2 == 0 ? 1 : -1;
  direction[(axis + 1) % 3] = place(cell / kCells % kCells);
  direction[(axis + 2) % 3] = place(cell % kCells);
  return direction.normalized();
}

Status check_options(const ViewpointModelOptions& o) {
  const auto refuse = [](const char* name, double value, const char* range) {
    return make_error(ErrorCode::kInvalidInput, "viewpoint model", "{} is {}, must be {}", name,
                      value, range);
  };
  if (o.subdivisions < 0 || o.subdivisions > 4) {
    return refuse("subdivisions", o.subdivisions, "0 to 4");
  }
  if (o.contour_samples < 8 || o.contour_samples > 4096) {
    return refuse("contour_samples", o.contour_samples, "8 to 4096");
  }
  if (o.edge_samples < 0 || o.edge_samples > 4096) {
    return refuse("edge_samples", o.edge_samples, "0 to 4096");
  }
  if (o.image_px < 64 || o.image_px > 2048) {
    return refuse("image_px", o.image_px, "64 to 2048");
  }
  if (!(o.distance_radii >= 2 && o.distance_radii <= 1000)) {
    return refuse("distance_radii", o.distance_radii, "2 to 1000");
  }
  if (!(o.crease_angle > 0 && o.crease_angle < 3.2)) {
    return refuse("crease_angle", o.crease_angle, "above 0 and below 3.2");
  }
  if (!(o.depth_jump > 0 && o.depth_jump <= 2)) {
    return refuse("depth_jump", o.depth_jump, "above 0, at most 2");
  }
  return {};
}

Result<CameraModel> view_camera(const ViewpointModelOptions& options) {
  const double tangent = std::tan(std::asin(1 / options.distance_radii));
  CameraModel::Parameters parameters;
  parameters.width = parameters.height = options.image_px;
  parameters.fx = parameters.fy = 0.5 * kFilled * options.image_px / tangent;
  parameters.cx = parameters.cy = 0.5 * (options.image_px - 1);
  return CameraModel::create(parameters, "camera of the viewpoint model");
}

}  // namespace

Rigid3 observe::look_at_center(const Eigen::Vector3d& direction, const Eigen::Vector3d& center,
                               double distance) {
  const Eigen::Vector3d forward = -direction;
  const Eigen::Vector3d up =
      std::abs(direction.z()) < 0.99 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
  const Eigen::Vector3d right = forward.cross(up).normalized();
  Eigen::Matrix3d camera_axes;
  camera_axes << right, forward.cross(right), forward;
  const Eigen::Matrix3d rotation = camera_axes.transpose();
  return {Eigen::Quaterniond(rotation), -(rotation * (center + distance * direction))};
}

Result<std::shared_ptr<const ViewpointModel>> observe::ViewpointModelBuilder::from_mesh(
    const TriangleMesh& mesh, const DepthRendererFactory& factory,
    const ViewpointModelOptions& options) {
  SL_RETURN_IF_ERROR(check_options(options));
  SL_ASSIGN(const CameraModel camera, view_camera(options));
  const std::unique_ptr<DepthRenderer> renderer = factory(camera);
  std::shared_ptr<ViewpointModel> model(new ViewpointModel());
  model->key_ = ViewpointModel::key(mesh, options);
  model->options_ = options;
  model->center_ = mesh.center.cast<double>();
  model->radius_ = static_cast<double>(mesh.radius);
  const observe::SelfSymmetry symmetry = observe::find_self_symmetry(mesh);
  model->symmetry_rotations_ = symmetry.rotations;
  if (symmetry.axis) model->symmetry_axis_ = {*symmetry.axis, symmetry.middle, false};
  SL_ASSIGN(const NearSymmetries near, find_near_symmetries(mesh, factory));
  model->near_rotations_ = near_rotations_of(
      near, ShapeSymmetry::kMax - std::min(ShapeSymmetry::kMax, model->symmetry_rotations_.size()),
      [&](const Rigid3& turn) { return model->angle_up_to_symmetry(turn, Rigid3()) < kSameTurn; });
  if (!model->symmetry_axis_) model->near_axis_ = near_axis_of(near);
  // A line of crease points without gaps in the images.
  const double pixel = 2 * model->radius_ / (kFilled * options.image_px);
  ViewSampler sampler(camera, options, model->center_, model->radius_,
                      observe::crease_points(mesh, options.crease_angle, 1.2 * pixel));
  ViewSampler::Sampled sampled;
  for (const Eigen::Vector3d& direction : make_view_sphere(options.subdivisions).directions) {
    const Rigid3 pose =
        look_at_center(direction, model->center_, options.distance_radii * model->radius_);
    sampler.sample(renderer->render(pose), pose, sampled);
    ViewpointModel::Record record;
    record.direction = direction.cast<float>();
    record.first_contour = static_cast<uint32_t>(model->contours_.size());
    record.contours = static_cast<uint32_t>(sampled.contour.size());
    record.first_edge = static_cast<uint32_t>(model->edges_.size());
    record.edges = static_cast<uint32_t>(sampled.edges.size());
    record.area = sampled.area;
    record.contour_length = sampled.contour_length;
    record.mask = sampled.mask;
    model->records_.push_back(record);
    model->contours_.insert(model->contours_.end(), sampled.contour.begin(), sampled.contour.end());
    model->edges_.insert(model->edges_.end(), sampled.edges.begin(), sampled.edges.end());
  }
  if (model->contours_.empty()) {
    return make_error(ErrorCode::kInvalidInput, "viewpoint model",
                      "the mesh cannot be seen from any side; are its faces turned inwards?");
  }
  model->finish();
  return std::shared_ptr<const ViewpointModel>(std::move(model));
}

Result<std::shared_ptr<const ViewpointModel>> ViewpointModel::build(
    const TriangleMesh& mesh, const DepthRendererFactory& factory,
    const ViewpointModelOptions& options) {
  return observe::ViewpointModelBuilder::from_mesh(mesh, factory, options);
}

// What follows from the directions alone.
void ViewpointModel::finish() {
  camera_from_object_.clear();
  for (const Record& record : records_) {
    const Eigen::Vector3d direction = record.direction.cast<double>().normalized();
    camera_from_object_.push_back(
        look_at_center(direction, center_, options_.distance_radii * radius_));
  }
  const ViewSphere sphere = make_view_sphere(options_.subdivisions);
  neighbors_ = sphere.neighbors;
  neighbor_counts_ = sphere.counts;
  start_of_cell_.assign(6 * kCells * kCells, 0);
  size_t at = 0;
  for (size_t cell = 0; cell < start_of_cell_.size(); ++cell) {
    start_of_cell_[cell] = static_cast<uint16_t>(at);
    at = nearest(middle_of_cell(cell));
    start_of_cell_[cell] = static_cast<uint16_t>(at);
  }
  if (auto revolved = observe::RevolvedSurface::of(*this)) {
    revolved_ = std::make_shared<const observe::RevolvedSurface>(*std::move(revolved));
  }
}

View ViewpointModel::view(size_t index) const {
  const Record& record = records_[index];
  View view;
  view.direction = record.direction;
  view.camera_from_object = camera_from_object_[index];
  view.contour = std::span(contours_).subspan(record.first_contour, record.contours);
  view.edges = std::span(edges_).subspan(record.first_edge, record.edges);
  view.area = record.area;
  view.contour_length = record.contour_length;
  return view;
}

size_t ViewpointModel::nearest(const Rigid3& camera_from_object) const {
  const Eigen::Vector3d camera = camera_from_object.inverse().translation - center_;
  const double distance = camera.norm();
  return nearest(distance > 0 ? Eigen::Vector3d(camera / distance)
                              : Eigen::Vector3d(Eigen::Vector3d::UnitX()));
}

// Steps to the best neighbor until none is better: on a sphere covered by such triangles there is
// no other summit.
size_t ViewpointModel::nearest(const Eigen::Vector3d& direction_in_object) const {
  const Eigen::Vector3f direction = direction_in_object.cast<float>();
  size_t best = start_of_cell_[cell_of(direction_in_object)];
  float highest = direction.dot(records_[best].direction);
  for (;;) {
    size_t next = best;
    for (const uint16_t neighbor : neighbors(best)) {
      const float cosine = direction.dot(records_[neighbor].direction);
      if (cosine > highest) {
        highest = cosine;
        next = neighbor;
      }
    }
    if (next == best) return best;
    best = next;
  }
}

std::span<const uint16_t> ViewpointModel::neighbors(size_t index) const {
  return {neighbors_[index].data(), neighbor_counts_[index]};
}

double ViewpointModel::angle_up_to_symmetry(const Rigid3& a, const Rigid3& b) const {
  const auto angle = [&](const Rigid3& pose) {
    if (!symmetry_axis_) return rotation_angle(pose, b);
    const Eigen::Vector3d u = pose.rotation * symmetry_axis_->direction;
    const Eigen::Vector3d v = b.rotation * symmetry_axis_->direction;
    return std::atan2(u.cross(v).norm(), u.dot(v));
  };
  double least = angle(a);
  for (const Rigid3& turn : symmetry_rotations_) least = std::min(least, angle(a * turn));
  return least;
}

}  // namespace sightline
