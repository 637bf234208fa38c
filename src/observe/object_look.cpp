// SPDX-License-Identifier: Apache-2.0
#include "object_look.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "surface_likeness.hpp"

namespace sightline::observe {
namespace {

// The prediction is never believed better than this [rad, m]: it only places lines.
constexpr double kLeastRotation = 0.006;
constexpr double kLeastTranslation = 0.0015;

constexpr double kBorder = 2;          // [px] that a line keeps from the picture's border
constexpr double kOffsetsSpan = 7.5;   // segments that measure_lines() tries to either side
constexpr double kSpreadSigmas = 2.0;  // of the prediction that the coarsest pass covers
constexpr int kMaxScale = 8;
// Neighbouring pixels share noise and clutter, so a posterior is surer than it should be.
constexpr double kPlacingInflation = 2.0;
constexpr double kLearnGap = 1.5, kLearnReach = 16;  // [px]

constexpr double kOutlier = 3.0;        // [sigma] of lines that are not handed out
constexpr double kMaxNoise = 2.5;       // [px] of a line that agrees
constexpr double kLineEvidence = 0.15;  // (inside - outside) / 2 of a line that counts
constexpr double kStepThreshold = 3.0;  // grey levels per pixel
constexpr double kEdgeReach = 5;        // [px]
constexpr double kMinEdgeShare = 0.55;  // of lines with a step that must agree
constexpr double kEdgeAgrees = 1.0;     // [px]
constexpr size_t kFewestPoints = 8;
constexpr int kPrinted = 12;              // points from which on edges are not asked
constexpr double kMaxTextureNoise = 0.8;  // [px]
constexpr size_t kTellingPoints = 10;     // found, for texture to tell sides apart
constexpr double kPointTells = 0.5;       // -log likelihood
constexpr size_t kFewestEdges = 16;
constexpr int kEdgeRounds = 2;          // of choosing the nearest step
constexpr double kMaxEdgeNoise = 0.75;  // [px]
constexpr double kOutlineReach = 2.0;   // [sigma of a line]
constexpr double kMaxEdgeBias = 0.5;    // [px] between colour and brightness, median
constexpr double kSamePixels = 0.5;     // share of an outline's pixels that its edges count for

double nearest_step(const EdgeLine& edge, const Vector6& pose) {
  const double at = edge.by_pose.dot(pose);
  auto best = static_cast<double>(edge.offset[0]);
  for (size_t k = 1; k < static_cast<size_t>(edge.offsets); ++k) {
    const auto other = static_cast<double>(edge.offset[k]);
    if (std::abs(other - at) < std::abs(best - at)) best = other;
  }
  return best;
}

Matrix6 placing_prior(const Matrix6& covariance) {
  Matrix6 wider = covariance;
  wider.diagonal().head<3>().array() += kLeastRotation * kLeastRotation;
  wider.diagonal().tail<3>().array() += kLeastTranslation * kLeastTranslation;
  return wider.ldlt().solve(Matrix6::Identity());
}

}  // namespace

ObjectLook::ObjectLook(const LookCamera& camera, TrackedObject object)
    : camera_(camera), object_(std::move(object)) {
  if (object_.cues.texture && object_.depth) {
    texture_ = std::make_unique<TexturePoints>(camera_.camera->model, object_.depth);
  }
}

double ObjectLook::pixels_per_meter() const {
  const Rigid3 camera_from_object = camera_.camera_from_world * world_from_object_;
  const Eigen::Vector3d center = camera_from_object * object_.views->center();
  return camera_.camera->model.parameters().fx / std::max(center.norm(), 1e-3);
}

double ObjectLook::independent_share(double correlation_px) const {
  const View view = object_.views->view(view_);
  const double spacing = static_cast<double>(view.contour_length) * pixels_per_meter() /
                         std::max(1.0, static_cast<double>(view.contour.size()));
  return std::clamp(spacing / correlation_px, 0.02, 1.0);
}

void ObjectLook::place(const Rigid3& world_from_object) {
  world_from_object_ = world_from_object;
  const Rigid3 camera_from_object = camera_.camera_from_world * world_from_object;
  view_ = object_.views->nearest(camera_from_object);
  place_lines(object_.views->view(view_), camera_.camera->model, camera_from_object, hiders_,
              kBorder, lines_);
  look_.lines_total = static_cast<int>(lines_.size());
}

void ObjectLook::refine(double huber) {
  residuals_.clear();
  for (const ContourLine& line : lines_) {
    if (!line.measured) continue;
    residuals_.push_back({line.by_pose, line.mean, std::sqrt(kPlacingInflation * line.variance)});
  }
  const Vector6 at = difference(at_.world_from_object, world_from_object_);
  const Vector6 step = fit_lines(residuals_, prior_, at, huber);
  place(world_from_object_ * Rigid3::exp(step));
}

void ObjectLook::fit_outline(const ColorReader& frame, double spread_px, bool fresh_colors) {
  const double needed = kSpreadSigmas * spread_px / kOffsetsSpan;
  int scale = std::clamp(static_cast<int>(std::ceil(needed)), 1, kMaxScale);
  colors_ = fresh_colors ? nullptr : appearance_.of_side(side_);
  const bool own_colors = colors_ == nullptr;
  double gap = std::max(kLearnGap, spread_px);
  for (;;) {
    if (own_colors) {
      collect_colors(frame, lines_, std::min(gap, 6.0), kLearnReach, foreground_, background_);
      fresh_.forget();
      colors_ = fresh_.learn(foreground_, background_, 1.0f) ? &fresh_ : nullptr;
      gap = kLearnGap;
    }
    if (colors_ == nullptr) return;
    measure_lines(frame, *colors_, scale, lines_);
    refine(camera_.options.huber);
    if (scale == 1) break;
    scale = scale > 3 ? scale / 2 : scale - 1;
  }
  if (own_colors) {
    collect_colors(frame, lines_, kLearnGap, kLearnReach, foreground_, background_);
    fresh_.forget();
    if (!fresh_.learn(foreground_, background_, 1.0f)) {
      colors_ = nullptr;
      return;
    }
  }
  measure_lines(frame, *colors_, 1, lines_);
  correct_for_gamma(camera_.options.gamma, camera_.options.blur_px, lines_);
}

// Does the picture look like the object at the fitted pose? Lines that do not are left out.
bool ObjectLook::judge() {
  if (colors_ == nullptr) return false;
  look_.separation = colors_->separation();
  double evidence = 0;
  int measured = 0;
  for (ContourLine& line : lines_) {
    if (!line.measured) continue;
    ++measured;
    const double own = 0.5 * static_cast<double>(line.inside_evidence - line.outside_evidence);
    evidence += own;
    line.measured = own >= kLineEvidence;
  }
  look_.evidence = measured > 0 ? evidence / measured : 0;
  residuals_.clear();
  const double floor = camera_.options.region_floor_px;
  for (const ContourLine& line : lines_) {
    if (!line.measured) continue;
    residuals_.push_back({line.by_pose, line.mean, std::sqrt(line.variance + floor * floor)});
  }
  const Vector6 at = difference(at_.world_from_object, world_from_object_);
  region_step_ = fit_lines(residuals_, prior_, at, camera_.options.huber);
  region_scale_ = residual_scale(residuals_, region_step_, scratch_);
  double noise = 0;
  look_.lines_used = 0;
  for (ContourLine& line : lines_) {
    if (!line.measured) continue;
    const double sigma = std::max(floor, region_scale_ * std::sqrt(line.variance + floor * floor));
    const double residual = std::abs(line.by_pose.dot(region_step_) - line.mean);
    line.measured = residual < kOutlier * sigma && sigma < 2 * kMaxNoise;
    if (!line.measured) continue;
    noise += sigma;
    ++look_.lines_used;
  }
  look_.noise_px = look_.lines_used > 0 ? noise / look_.lines_used : 0;
  const TrackerOptions& options = camera_.options;
  return look_.lines_used >= options.min_lines &&
         look_.lines_used >= options.min_line_share * look_.lines_total &&
         look_.evidence >= options.min_evidence && look_.separation >= options.min_separation &&
         look_.noise_px <= kMaxNoise;
}

PoseTermPtr ObjectLook::region_term() {
  const TrackerOptions& options = camera_.options;
  std::vector<LineMatch> matches;
  matches.reserve(static_cast<size_t>(look_.lines_used));
  for (const ContourLine& line : lines_) {
    if (!line.measured) continue;
    LineMatch& match = matches.emplace_back();
    match.point_in_object = line.point_in_object;
    match.center = line.center;
    match.normal = line.normal;
    match.offset[0] = static_cast<float>(line.mean);
    const double floor = options.region_floor_px;
    match.sigma_px = std::max(floor, region_scale_ * std::sqrt(line.variance + floor * floor));
  }
  const double share = independent_share(options.region_correlation_px);
  return std::make_shared<LineTerm>("region", camera_.camera, std::move(matches), options.huber,
                                    options.region_error, share);
}

// The lines [from, to) of edges_ as matches, if they look like the object's edges at `step`.
void ObjectLook::add_edges(size_t from, size_t to, const Vector6& step, double weight,
                           double min_share, std::vector<LineMatch>& matches) {
  const std::span<const EdgeLine> edges(edges_.data() + from, to - from);
  residuals_.clear();
  // Only the strongest step proves that this is an edge: a nearest one is always found.
  size_t agree = 0;
  for (const EdgeLine& edge : edges) {
    if (edge.offsets == 0) continue;
    residuals_.push_back({edge.by_pose, nearest_step(edge, step), camera_.options.edge_floor_px});
    const double off = edge.by_pose.dot(step) - static_cast<double>(edge.offset[0]);
    agree += std::abs(off) < kEdgeAgrees ? 1 : 0;
  }
  const auto found = static_cast<double>(residuals_.size());
  if (residuals_.size() < kFewestEdges || static_cast<double>(agree) < min_share * found) {
    return;
  }
  const double scale = std::max(1.0, residual_scale(residuals_, step, scratch_));
  const double sigma = scale * camera_.options.edge_floor_px;
  if (sigma > kMaxEdgeNoise) return;
  look_.edge_noise_px = std::max(look_.edge_noise_px, sigma);
  for (const EdgeLine& edge : edges) {
    if (edge.offsets == 0) continue;
    const double residual = edge.by_pose.dot(step) - nearest_step(edge, step);
    if (std::abs(residual) > kOutlier * sigma) continue;
    LineMatch& match = matches.emplace_back();
    match.point_in_object = edge.point_in_object;
    match.center = edge.center;
    match.normal = edge.normal;
    match.offset = edge.offset;
    match.offsets = edge.offsets;
    match.sigma_px = sigma / std::sqrt(weight);
  }
}

// Print along the border makes steps that lie beside the outline everywhere: then colour and
// brightness contradict each other in the median.
bool ObjectLook::outline_steps_agree(size_t outer, const Vector6& step) {
  scratch_.clear();
  for (size_t i = 0; i < outer; ++i) {
    const EdgeLine& edge = edges_[i];
    const ContourLine& line = lines_[edge.line];
    if (edge.offsets == 0 || !line.measured) continue;
    scratch_.push_back(nearest_step(edge, step) - line.mean);
  }
  if (scratch_.size() < kFewestEdges) return false;
  const auto middle = scratch_.begin() + static_cast<ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  return std::abs(*middle) < kMaxEdgeBias;
}

void ObjectLook::add_edge_term(std::vector<LineMatch> matches, const LineError& error,
                               std::vector<PoseTermPtr>& terms) {
  if (matches.empty()) return;
  const TrackerOptions& options = camera_.options;
  look_.edges_used += static_cast<int>(matches.size());
  terms.push_back(std::make_shared<LineTerm>("edge", camera_.camera, std::move(matches),
                                             options.huber, error,
                                             independent_share(options.edge_correlation_px)));
}

void ObjectLook::edge_terms(const Frame& frame, std::vector<PoseTermPtr>& terms) {
  const TrackerOptions& options = camera_.options;
  edges_.clear();
  edges_of_outline(lines_, false, kEdgeReach, edges_);
  const size_t limbs = edges_.size();
  edges_of_outline(lines_, true, kEdgeReach, edges_);
  const size_t outer = edges_.size();
  const View view = object_.views->view(view_);
  place_inner_edges(view, camera_.camera->model, camera_.camera_from_world * world_from_object_,
                    hiders_, kEdgeReach, edges_);
  find_steps(frame.grey(), camera_.light, kStepThreshold, edges_);
  // Steps of an outline count where its colours say that it is.
  for (size_t i = 0; i < outer; ++i) {
    EdgeLine& edge = edges_[i];
    const ContourLine& line = lines_[edge.line];
    const double reach = kOutlineReach * std::max(0.5, look_.noise_px);
    int kept = 0;
    for (size_t k = 0; k < static_cast<size_t>(edge.offsets); ++k) {
      if (std::abs(static_cast<double>(edge.offset[k]) - line.mean) > reach) continue;
      edge.offset[static_cast<size_t>(kept++)] = edge.offset[k];
    }
    edge.offsets = line.measured ? kept : 0;
  }

  const Vector6 at = difference(at_.world_from_object, world_from_object_);
  Vector6 step = region_step_;
  for (int round = 0; round < kEdgeRounds; ++round) {
    residuals_.clear();
    for (const EdgeLine& edge : edges_) {
      if (edge.offsets == 0) continue;
      residuals_.push_back({edge.by_pose, nearest_step(edge, step), kEdgeAgrees});
    }
    for (const ContourLine& line : lines_) {
      if (!line.measured) continue;
      residuals_.push_back({line.by_pose, line.mean, look_.noise_px});
    }
    step = fit_lines(residuals_, prior_, at, options.huber);
  }
  std::vector<LineMatch> smooth, sharp;
  smooth.reserve(limbs);
  sharp.reserve(edges_.size() - limbs);
  if (outline_steps_agree(outer, step)) {
    add_edges(0, limbs, step, kSamePixels, 0.0, smooth);
    add_edges(limbs, outer, step, kSamePixels, 0.0, sharp);
  }
  add_edges(outer, edges_.size(), step, 1.0, kMinEdgeShare, sharp);
  add_edge_term(std::move(smooth), options.limb_error, terms);
  add_edge_term(std::move(sharp), options.edge_error, terms);
}

PoseTermPtr ObjectLook::texture_term(const Frame& frame) {
  const TrackerOptions& options = camera_.options;
  const Rigid3 fitted = world_from_object_ * Rigid3::exp(region_step_);
  const Rigid3 camera_from_object = camera_.camera_from_world * fitted;
  texture_->find(frame.grey(), camera_from_object, hiders_, at_.doubtful);
  const auto& found = texture_->found();
  if (found.size() < kFewestPoints) return nullptr;
  const LineProjector projector(camera_.camera->model, camera_from_object);
  residuals_.clear();
  for (const TexturePoints::Found& point : found) {
    for (const Eigen::Vector2d& axis : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
      LineResidual& residual = residuals_.emplace_back();
      residual.sigma = options.texture_floor_px;
      if (!projector.distance(point.point_in_object, point.pixel, axis, residual.offset,
                              residual.by_pose)) {
        return nullptr;
      }
      residual.offset = -residual.offset;
    }
  }
  const Vector6 at = difference(at_.world_from_object, fitted);
  const Vector6 step = fit_lines(residuals_, prior_, at, options.huber);
  const double scale = std::max(1.0, residual_scale(residuals_, step, scratch_));
  const double sigma = scale * options.texture_floor_px;
  if (sigma > kMaxTextureNoise) return nullptr;
  std::vector<PointMatch> matches;
  matches.reserve(found.size());
  for (size_t i = 0; i < found.size(); ++i) {
    const auto off = [&](size_t k) {
      return std::abs(residuals_[k].by_pose.dot(step) - residuals_[k].offset);
    };
    if (std::max(off(2 * i), off(2 * i + 1)) > kOutlier * sigma) continue;
    matches.push_back({found[i].point_in_object, found[i].pixel, sigma});
  }
  look_.points_used = static_cast<int>(matches.size());
  if (matches.size() < kFewestPoints) return nullptr;
  return std::make_shared<CornerTerm>(camera_.camera, std::move(matches), options.huber,
                                      options.texture_error, "texture");
}

void ObjectLook::forget_learned() {
  appearance_.forget();
  if (texture_) texture_->forget();
}

void ObjectLook::compare_sides(const Frame& frame, bool texture_tells,
                               std::vector<PoseHypothesis>& alike) {
  std::vector<Rigid3> poses = {world_from_object_ * Rigid3::exp(region_step_)};
  for (const Rigid3& turn : object_.lookalikes.turns) poses.push_back(poses[0] * turn);
  std::vector<double> costs(poses.size(), 0.0);
  bool told = false;
  if (object_.spots) {
    const I420View picture = frame.i420();
    const std::array<PlaneView, 3> half = {frame.half_grey(), picture.u, picture.v};
    std::vector<double> likeness;
    for (const Rigid3& pose : poses) {
      likeness.push_back(surface_likeness(*object_.spots, camera_.camera->model,
                                          camera_.camera_from_world * pose, half));
    }
    told = *std::max_element(likeness.begin(), likeness.end()) >= kLeastLikeness;
    for (size_t k = 0; told && k < poses.size(); ++k) costs[k] += likeness_cost(likeness[k]);
  }
  if (texture_ && texture_tells) {
    std::vector<size_t> found;
    for (const Rigid3& pose : poses) {
      texture_->find(frame.grey(), camera_.camera_from_world * pose, hiders_, true);
      found.push_back(texture_->found().size());
    }
    const bool matches = *std::max_element(found.begin(), found.end()) >= kTellingPoints;
    for (size_t k = 0; matches && k < poses.size(); ++k) {
      costs[k] -= kPointTells * static_cast<double>(found[k]);
    }
    told |= matches;
  }
  for (size_t k = 0; told && k < poses.size(); ++k) alike.push_back({poses[k], costs[k]});
}

void ObjectLook::note_texture(const Frame& frame) {
  if (!texture_) return;
  double left = 1e9, top = 1e9, right = -1e9, bottom = -1e9;
  for (const ContourLine& line : lines_) {
    left = std::min(left, line.center.x());
    right = std::max(right, line.center.x());
    top = std::min(top, line.center.y());
    bottom = std::max(bottom, line.center.y());
  }
  texture_->note_candidates(frame.grey(), static_cast<int>(left), static_cast<int>(top),
                            static_cast<int>(right), static_cast<int>(bottom));
}

void ObjectLook::keep_texture(const Rigid3& world_from_object) {
  if (texture_) texture_->keep_candidates(camera_.camera_from_world * world_from_object);
}

void ObjectLook::drop_texture() {
  if (texture_) texture_->drop_candidates();
}

void ObjectLook::measure(const Frame& frame, const LookAt& at, bool fresh_colors,
                         std::span<const HidingSphere> spheres, std::vector<PoseTermPtr>& terms) {
  look_ = {};
  at_ = at;
  prior_ = placing_prior(at.covariance);
  hiders_ = {camera_.scene.tile, spheres};
  place(at.world_from_object);
  const Rigid3 object_from_camera = (camera_.camera_from_world * at.world_from_object).inverse();
  side_ =
      Appearance::side_of((object_from_camera.translation - object_.views->center()).normalized());
  if (lines_.empty()) return;
  const double sigma_rotation = std::sqrt(at.covariance.topLeftCorner<3, 3>().trace() / 3);
  const double sigma_translation = std::sqrt(at.covariance.bottomRightCorner<3, 3>().trace() / 3);
  const double spread_px =
      pixels_per_meter() * (sigma_translation + object_.views->radius() * sigma_rotation);
  const ColorReader reader(frame.i420());
  fit_outline(reader, spread_px, fresh_colors);
  look_.seen = judge();
  if (!look_.seen) return;
  if (texture_) {
    if (PoseTermPtr term = texture_term(frame)) terms.push_back(std::move(term));
  }
  if (object_.cues.region) terms.push_back(region_term());
  // On a printed object most steps of brightness are print.
  if (object_.cues.edge && look_.points_used < kPrinted) {
    edge_terms(frame, terms);
  }
}

double ObjectLook::outline_distance(const Rigid3& world_from_object) const {
  const Vector6 off = difference(world_from_object_, world_from_object);
  double squares = 0;
  for (const ContourLine& line : lines_) squares += std::pow(line.by_pose.dot(off), 2);
  return std::sqrt(squares / std::max<double>(1, static_cast<double>(lines_.size())));
}

void ObjectLook::collect(const Frame& frame, std::vector<uint16_t>& foreground,
                         std::vector<uint16_t>& background) {
  collect_colors(ColorReader(frame.i420()), lines_, kLearnGap, kLearnReach, foreground, background);
}

}  // namespace sightline::observe
