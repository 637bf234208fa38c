// SPDX-License-Identifier: Apache-2.0
#include "observe/track/edge_measurement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

namespace {

double nearest_step(const EdgeLine& edge, const Vector6& pose) {
  const double at = edge.by_pose.dot(pose);
  auto best = static_cast<double>(edge.offset[0]);
  for (size_t k = 1; k < static_cast<size_t>(edge.offsets); ++k) {
    const auto other = static_cast<double>(edge.offset[k]);
    if (std::abs(other - at) < std::abs(best - at)) best = other;
  }
  return best;
}

}  // namespace

// Steps at the outline count where its colors say that it is.
void EdgeMeasurement::keep_steps_of_outline(const PlacedOutline& outline, double noise_px) {
  const double reach = kOutlineSigmas * std::max(0.5, noise_px);
  for (size_t i = outer_.from; i < outer_.to; ++i) {
    EdgeLine& edge = edges_[i];
    const ContourLine& line = outline.lines()[edge.line];
    int kept = 0;
    for (size_t k = 0; k < static_cast<size_t>(edge.offsets); ++k) {
      if (std::abs(static_cast<double>(edge.offset[k]) - line.mean) > reach) continue;
      edge.offset[static_cast<size_t>(kept++)] = edge.offset[k];
    }
    edge.offsets = line.measured ? kept : 0;
  }
}

// The pose that outline and nearest steps agree on, from the placed one.
Vector6 EdgeMeasurement::fit(const PosePrior& prior, const PlacedOutline& outline,
                             const OutlineAgreement& agreement) {
  const Vector6 at = prior.offset_of(outline.pose());
  Vector6 step = agreement.step;
  for (int round = 0; round < kEdgeRounds; ++round) {
    residuals_.clear();
    for (const EdgeLine& edge : edges_) {
      if (edge.offsets == 0) continue;
      residuals_.push_back({edge.by_pose, nearest_step(edge, step), kEdgeAgreesPx});
    }
    for (const ContourLine& line : outline.lines()) {
      if (!line.measured) continue;
      residuals_.push_back({line.by_pose, line.mean, agreement.noise_px});
    }
    step = fit_lines(residuals_, prior.information, at, camera_.options.huber);
  }
  return step;
}

// Texture along the border makes steps that lie beside the outline everywhere: then color and
// brightness contradict each other in the median.
bool EdgeMeasurement::outline_steps_agree(const PlacedOutline& outline, const Vector6& step) {
  scratch_.clear();
  for (size_t i = outer_.from; i < outer_.to; ++i) {
    const EdgeLine& edge = edges_[i];
    const ContourLine& line = outline.lines()[edge.line];
    if (edge.offsets == 0 || !line.measured) continue;
    scratch_.push_back(nearest_step(edge, step) - line.mean);
  }
  if (scratch_.size() < kMinEdges) return false;
  const auto middle = scratch_.begin() + static_cast<ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  return std::abs(*middle) < kMaxEdgeBiasPx;
}

// Appends the lines as matches if they look like the object's edges at `step`; returns their noise
// [px], 0 if they do not.
double EdgeMeasurement::add_matches(Range range, const Vector6& step, double weight,
                                    double min_share, std::vector<LineMatch>& matches) {
  const TrackerOptions& options = camera_.options;
  const std::span<const EdgeLine> edges(edges_.data() + range.from, range.to - range.from);
  residuals_.clear();
  // Only the strongest step proves that this is an edge: a nearest one is always found.
  size_t agree = 0;
  for (const EdgeLine& edge : edges) {
    if (edge.offsets == 0) continue;
    residuals_.push_back({edge.by_pose, nearest_step(edge, step), options.edge_floor_px});
    const double off = edge.by_pose.dot(step) - static_cast<double>(edge.offset[0]);
    agree += std::abs(off) < kEdgeAgreesPx ? 1 : 0;
  }
  const auto found = static_cast<double>(residuals_.size());
  if (residuals_.size() < kMinEdges || static_cast<double>(agree) < min_share * found) return 0;
  const double scale = std::max(1.0, residual_scale(residuals_, step, scratch_));
  const double sigma = scale * options.edge_floor_px;
  if (sigma > options.max_edge_noise_px) return 0;
  for (const EdgeLine& edge : edges) {
    if (edge.offsets == 0) continue;
    const double residual = edge.by_pose.dot(step) - nearest_step(edge, step);
    if (std::abs(residual) > kOutlierSigmas * sigma) continue;
    LineMatch& match = matches.emplace_back();
    match.point_in_object = edge.point_in_object;
    match.center = edge.center;
    match.normal = edge.normal;
    match.offset = edge.offset;
    match.offsets = edge.offsets;
    match.sigma_px = sigma / std::sqrt(weight);
  }
  return sigma;
}

int EdgeMeasurement::add_term(std::vector<LineMatch> matches, const LineError& error,
                              double independent_share, std::vector<PoseTermPtr>& terms) const {
  if (matches.empty()) return 0;
  const auto used = static_cast<int>(matches.size());
  terms.push_back(std::make_shared<LineTerm>("edge", camera_.owner, std::move(matches),
                                             camera_.options.huber, error, independent_share));
  return used;
}

void EdgeMeasurement::place_edges(const PlaneView& gray, const PlacedOutline& outline) {
  const TrackerOptions& options = camera_.options;
  edges_.clear();
  edges_of_outline(outline.lines(), false, options.edge_reach_px, edges_);
  limbs_ = {0, edges_.size()};
  edges_of_outline(outline.lines(), true, options.edge_reach_px, edges_);
  creases_ = {limbs_.to, edges_.size()};
  outer_ = {0, edges_.size()};
  place_inner_edges(outline.view(), camera_.camera->model, outline.camera_from_object(),
                    outline.occluders(), options.edge_reach_px, outline.revolved(), edges_);
  inner_ = {outer_.to, edges_.size()};
  find_steps(gray, camera_.light, options.min_edge_step, edges_);
  if (!outline.rolling()) return;
  for (EdgeLine& edge : edges_) {
    const auto rolled = static_cast<float>(outline.rolled_px(edge.by_pose, edge.center.y()));
    for (float& offset : edge.offset) offset -= rolled;
  }
}

void EdgeMeasurement::pull(const PlaneView& gray, const PosePrior& prior, PlacedOutline& outline) {
  for (int round = 0; round < kPullRounds; ++round) {
    place_edges(gray, outline);
    outline.place(outline.pose() * Rigid3::exp(fit(prior, outline, {})));
  }
}

EdgeSupport EdgeMeasurement::support(const PlaneView& gray, const PosePrior& prior,
                                     const PlacedOutline& outline,
                                     const OutlineAgreement& agreement) {
  place_edges(gray, outline);
  EdgeSupport out;
  out.step = fit(prior, outline, agreement);
  for (size_t i = outer_.from; i < outer_.to; ++i) {
    const EdgeLine& edge = edges_[i];
    out.lines += edge.searched ? 1 : 0;
    if (edge.offsets == 0) continue;
    const double off = edge.by_pose.dot(out.step) - nearest_step(edge, out.step);
    out.agree += std::abs(off) < kEdgeAgreesPx ? 1 : 0;
    out.by_chance += std::min(1.0, edge.offsets * kEdgeAgreesPx / edge.reach_px);
  }
  return out;
}

EdgeResult EdgeMeasurement::measure(const PlaneView& gray, const PosePrior& prior,
                                    const PlacedOutline& outline, const OutlineAgreement& agreement,
                                    std::vector<PoseTermPtr>& terms) {
  place_edges(gray, outline);
  keep_steps_of_outline(outline, agreement.noise_px);
  const Vector6 step = fit(prior, outline, agreement);
  std::vector<LineMatch> smooth, sharp;
  smooth.reserve(limbs_.to);
  sharp.reserve(edges_.size() - limbs_.to);
  EdgeResult out;
  const auto add = [&](Range range, double weight, double min_share, auto& matches) {
    out.noise_px = std::max(out.noise_px, add_matches(range, step, weight, min_share, matches));
  };
  if (outline_steps_agree(outline, step)) {
    add(limbs_, kSamePixels, 0.0, smooth);
    add(creases_, kSamePixels, 0.0, sharp);
  }
  add(inner_, 1.0, kMinEdgeShare, sharp);
  const TrackerOptions& options = camera_.options;
  const double share = outline.independent_share(options.edge_correlation_px);
  out.used += add_term(std::move(smooth), options.limb_error, share, terms);
  out.used += add_term(std::move(sharp), options.edge_error, share, terms);
  return out;
}

}  // namespace sightline::observe
