// SPDX-License-Identifier: Apache-2.0
#include "calibrate/capture/guide_state.hpp"

#include <algorithm>
#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr int kPatience = 3;           // times as long for cameras that do not see it all the time
constexpr double kLargestStep = 0.08;  // of the width, way of a moving corner between two images

/// What is asked of a camera that the report calls good: its figures say more than our rules.
CaptureGuideOptions half_of(CaptureGuideOptions options) {
  options.tilt_deg /= 2;
  options.depth_ratio = 1 + (options.depth_ratio - 1) / 2;
  options.coverage = std::min(options.coverage, 0.5);
  options.region_coverage /= 2;
  return options;
}

double largest_motion(const SteadyView& view) {
  double most = 0;
  for (const TargetCorner& corner : view.corners) most = std::max(most, corner.px_per_s.norm());
  return most;
}

}  // namespace

GuideState::GuideState(const CalibrationTarget& target, const std::vector<ViewedCamera>& cameras,
                       const std::vector<CameraPrior>& priors, const CaptureGuideOptions& chosen)
    : options(chosen),
      views{.target = target, .cameras = cameras, .sets = 0, .views = {}},
      windows(cameras.size()),
      progress(cameras.size()),
      needs(cameras.size()),
      pairs(cameras.size()) {
  SL_CHECK(priors.empty() || priors.size() == cameras.size(), "a prior for each camera, or none");
  for (size_t c = 0; c < cameras.size(); ++c) {
    records.emplace_back(target, priors.empty() ? CameraPrior{} : priors[c]);
    progress[c].lens_known = records[c].lens_known();
    views.cameras[c].images = 0;
  }
  update();
}

CaptureStep GuideState::find_still(Time now, Duration still, Sets& set, bool& brief) const {
  CaptureStep step;
  Time latest_begin = Time::min(), earliest_end = Time::max();
  bool blurred = false;
  for (size_t c = 0; c < windows.size(); ++c) {
    if (!windows[c].sees_it(now, options.min_corners)) continue;
    SteadyView view;
    const auto state = windows[c].steady(options, still, records[c].width(), view);
    if (state == SightWindow::State::kNotSeen) continue;
    if (state == SightWindow::State::kMoving) return {CaptureStep::Kind::kMoving, c};
    if (state == SightWindow::State::kTooShort) {
      brief = true;
      step = {CaptureStep::Kind::kMoving, c};
      continue;
    }
    latest_begin = std::max(latest_begin, view.from);
    earliest_end = std::min(earliest_end, view.to);
    if (view.edge_px > options.widest_edge_px) {
      blurred = true;
      step.camera = c;
      continue;
    }
    set[c] = std::move(view);
  }
  if (std::ranges::none_of(set, [](const auto& v) { return v.has_value(); })) {
    if (blurred) step.kind = CaptureStep::Kind::kBlurred;
    return step;
  }
  // All stood still, but was it at the same time?
  if (latest_begin > earliest_end) return {CaptureStep::Kind::kMoving, step.camera};
  return {CaptureStep::Kind::kTaken, 0};
}

CaptureStep GuideState::find_moment(const TargetSight& sight, Sets& set) const {
  Duration longest{};
  for (const SightWindow& window : windows) {
    if (window.sees_it(sight.capture, 1)) longest = std::max(longest, window.period());
  }
  const auto own = windows[sight.camera].moment(sight.capture - 2 * longest, options.min_corners);
  if (!own) return {CaptureStep::Kind::kNotSeen, sight.camera};
  CaptureStep step{CaptureStep::Kind::kNotSeen, sight.camera};
  for (size_t c = 0; c < windows.size(); ++c) {
    auto view = windows[c].moment(own->capture, options.min_corners);
    if (!view) continue;
    const double step_px = largest_motion(*view) * to_seconds(windows[c].period());
    if (step_px > kLargestStep * records[c].width()) {
      step = {CaptureStep::Kind::kMoving, c};
    } else if (view->edge_px > options.widest_edge_px) {
      step = {CaptureStep::Kind::kBlurred, c};
    } else {
      set[c] = std::move(view);
    }
  }
  const bool any = std::ranges::any_of(set, [](const auto& v) { return v.has_value(); });
  return any ? CaptureStep{CaptureStep::Kind::kTaken, sight.camera} : step;
}

CaptureStep GuideState::find_set(const TargetSight& sight, Sets& set) const {
  bool brief = false;
  CaptureStep found = options.moving ? find_moment(sight, set)
                                     : find_still(sight.capture, options.still, set, brief);
  if (brief && found.kind == CaptureStep::Kind::kTaken) {
    // It just came into the view of that camera, or is seen there now and then: wait for a while.
    std::ranges::fill(set, std::nullopt);
    found = find_still(sight.capture, kPatience * options.still, set, brief);
  }
  if (found.kind != CaptureStep::Kind::kTaken) return found;
  for (size_t c = 0; c < set.size(); ++c) {
    if (set[c] && records[c].is_new(set[c]->corners, options)) {
      return {CaptureStep::Kind::kTaken, c};
    }
  }
  return {CaptureStep::Kind::kKnown, found.camera};
}

Status GuideState::check(const Sets& set) const {
  CalibrationViews one{.target = views.target, .cameras = {}, .sets = 1, .views = {}};
  for (size_t c = 0; c < set.size(); ++c) {
    if (!set[c]) continue;
    one.views.push_back({one.cameras.size(), 0, 0, set[c]->corners, "the live image"});
    one.cameras.push_back({name(c), records[c].width(), records[c].height(), 1});
  }
  return check_views(one);
}

void GuideState::take(const Sets& set) {
  double time_s = 0;
  std::vector<size_t> seen_by;
  for (size_t c = 0; c < set.size(); ++c) {
    if (!set[c]) continue;
    seen_by.push_back(c);
    time_s += to_seconds(set[c]->capture.time_since_epoch());
  }
  time_s /= static_cast<double>(seen_by.size());
  for (const size_t c : seen_by) {
    const double own_s = to_seconds(set[c]->capture.time_since_epoch());
    views.views.push_back({c, views.sets, options.moving ? own_s - time_s : 0, set[c]->corners,
                           fmt::format("set {}", views.sets)});
    records[c].take(set[c]->corners);
  }
  note_seen(seen_by);
  ++views.sets;
  update();
}

void GuideState::note_seen(const std::vector<size_t>& seen_by) {
  if (seen_by.empty()) return;
  if (std::ranges::find(seen_by, last_camera) == seen_by.end()) last_camera = seen_by.front();
  pairs.add(seen_by);
}

void GuideState::update() {
  for (size_t c = 0; c < records.size(); ++c) {
    const bool good = report && report->cameras[c].grade == CalibrationGrade::kGood;
    needs[c] = needs_of(records[c], good ? half_of(options) : options);
    CameraProgress& p = progress[c];
    p.views = records[c].views().size();
    p.coverage = records[c].coverage();
    p.depth_ratio = records[c].depth_ratio();
    for (size_t side = 0; side < 4; ++side) {
      p.tilted[side] = records[c].tilt_deg(static_cast<TiltSide>(side)) >= options.tilt_deg;
    }
    p.complete = needs[c].none();
    p.share = needs[c].share;
  }
}

CaptureAdvice GuideState::report_advice() const {
  CaptureAdvice advice;
  if (!report) {
    advice.kind = CaptureAdvice::Kind::kWait;
    advice.words = "nothing is missing; solving";
    return advice;
  }
  for (size_t c = 0; c < report->cameras.size(); ++c) {
    const CameraReport& camera = report->cameras[c];
    if (camera.grade == CalibrationGrade::kGood) continue;
    advice.camera = c;
    if (camera.sigma && camera.sigma->worst > 2) {
      const ProjectionSigma& sigma = *camera.sigma;
      size_t worst = 0;
      for (size_t i = 0; i < sigma.values.size(); ++i) {
        if (sigma.values[i] > sigma.values[worst] || !std::isfinite(sigma.values[worst])) worst = i;
      }
      const int column = static_cast<int>(worst) % sigma.columns;
      const int row = static_cast<int>(worst) / sigma.columns;
      advice.region = ImageRegion{column * 3 / sigma.columns, row * 3 / sigma.rows};
      advice.words = show_words(name(c), advice, false);
      return advice;
    }
    size_t other = c == 0 ? 1 : 0;
    for (size_t o = 0; o < records.size(); ++o) {
      if (o != c && pairs.of(c, o) > pairs.of(c, other)) other = o;
    }
    const bool place = camera.split_half && records.size() > 1 &&
                       camera.split_half->center_mm > 10 * camera.working_distance;
    if (place) {
      advice.kind = CaptureAdvice::Kind::kTogether;
      advice.other = other;
      advice.words = fmt::format(
          "{}: its place is uncertain by {:.1f} mm; more poses that it sees "
          "together with {}",
          name(c), camera.split_half->center_mm, name(other));
    } else {
      advice.words = camera.remarks.size() > 1 ? fmt::format("{}: {}", name(c), camera.remarks[1])
                                               : show_words(name(c), advice, false);
    }
    return advice;
  }
  advice.kind = CaptureAdvice::Kind::kWait;
  advice.words = "nothing is missing; solving";
  return advice;
}

size_t GuideState::next_camera() const {
  // Where the person is; otherwise where least is missing, so that walks are few. Views that are
  // missing in number alone come along with the others.
  const auto rank = [&](size_t c) {
    const CameraNeeds& n = needs[c];
    const bool special =
        n.region || n.tilt || n.distance != CaptureAdvice::Distance::kAny || progress[c].views == 0;
    return (special ? 4.0 : 0.0) + (c == last_camera ? 2.0 : 0.0) + progress[c].share;
  };
  size_t best = records.size();
  for (size_t c = 0; c < records.size(); ++c) {
    if (progress[c].complete) continue;
    if (best == records.size() || rank(c) > rank(best)) best = c;
  }
  return best;
}

}  // namespace sightline::calibrate
