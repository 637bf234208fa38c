// SPDX-License-Identifier: Apache-2.0
#include "observe/track/region_measurement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "observe/track/track_constants.hpp"
#include "sightline/observe/terms/line_term.hpp"

namespace sightline::observe {

using namespace tuning;

double OutlineAgreement::sigma_px(const ContourLine& line, double floor_px) const {
  return std::max(floor_px, scale * std::sqrt(line.variance + floor_px * floor_px));
}

OutlineAgreement RegionMeasurement::judge(const PosePrior& prior, double separation,
                                          PlacedOutline& outline) {
  const TrackerOptions& options = camera_.options;
  OutlineAgreement out;
  out.separation = separation;
  int measured = 0;
  for (ContourLine& line : outline.lines()) {
    if (!line.measured) continue;
    ++measured;
    const double own = 0.5 * static_cast<double>(line.inside_evidence - line.outside_evidence);
    out.evidence += own;
    line.measured = own >= kLineEvidence;
  }
  out.evidence = measured > 0 ? out.evidence / measured : 0;
  residuals_.clear();
  const double floor = options.region_floor_px;
  for (const ContourLine& line : outline.lines()) {
    if (!line.measured) continue;
    residuals_.push_back({line.by_pose, line.mean, std::sqrt(line.variance + floor * floor)});
  }
  out.step =
      fit_lines(residuals_, prior.information, prior.offset_of(outline.pose()), options.huber);
  out.scale = residual_scale(residuals_, out.step, scratch_);
  double noise = 0;
  for (ContourLine& line : outline.lines()) {
    if (!line.measured) continue;
    const double sigma = out.sigma_px(line, floor);
    const double residual = std::abs(line.by_pose.dot(out.step) - line.mean);
    line.measured = residual < kOutlierSigmas * sigma && sigma < 2 * options.max_line_noise_px;
    if (!line.measured) continue;
    noise += sigma;
    ++out.lines_used;
  }
  out.noise_px = out.lines_used > 0 ? noise / out.lines_used : 0;
  out.seen = out.lines_used >= options.min_lines &&
             out.lines_used >= options.min_line_share * static_cast<int>(outline.lines().size()) &&
             out.evidence >= options.min_evidence && out.separation >= options.min_separation &&
             out.noise_px <= options.max_line_noise_px;
  return out;
}

PoseTermPtr RegionMeasurement::term(const PlacedOutline& outline,
                                    const OutlineAgreement& agreement) const {
  const TrackerOptions& options = camera_.options;
  std::vector<LineMatch> matches;
  matches.reserve(static_cast<size_t>(agreement.lines_used));
  for (const ContourLine& line : outline.lines()) {
    if (!line.measured) continue;
    LineMatch& match = matches.emplace_back();
    match.point_in_object = line.point_in_object;
    match.center = line.center;
    match.normal = line.normal;
    match.offset[0] = static_cast<float>(line.mean);
    match.sigma_px = agreement.sigma_px(line, options.region_floor_px);
  }
  const double share = outline.independent_share(options.region_correlation_px);
  return std::make_shared<LineTerm>("region", camera_.owner, std::move(matches), options.huber,
                                    options.region_error, share);
}

}  // namespace sightline::observe
