// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/head_inputs.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/calibrate/calibration_file.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNeverChange = 0.2 * kDegree;
constexpr double kTurned = 3 * kDegree;    // of an axis, over the settings
constexpr double kRate = 1 * kDegree;      // [rad/s] from which an image is one in motion
constexpr double kTravel = 0.5 * kDegree;  // after which play has been passed
constexpr size_t kMostMoving = 200;
constexpr size_t kLeastAtZoom = 4;

bool all_finite(const HeadRecording& recording) {
  for (const AxisReading& r : recording.readings) {
    if (!std::isfinite(r.pan) || !std::isfinite(r.tilt) || !std::isfinite(r.zoom)) return false;
  }
  for (const HeadImage& image : recording.images) {
    for (const BodySight& sight : image.sights) {
      for (const TargetCorner& c : sight.corners) {
        if (!c.pixel.allFinite()) return false;
      }
    }
  }
  return true;
}

Status check_readings(const HeadSights& sights) {
  const std::string where = head_place(sights);
  Eigen::Vector2d range = Eigen::Vector2d::Zero();
  for (const HeadRecording& recording : sights.recordings) {
    if (recording.readings.empty()) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "{} has no angles of it (axes.csv): give the camera an axes source "
                        "(docs/turning.md), and record again",
                        recording.name);
    }
    if (!all_finite(recording)) {
      return make_error(ErrorCode::kInvalidInput, where, "an angle or a corner of {} is not finite",
                        recording.name);
    }
    range = range.cwiseMax(Readings(recording.readings, Time{}).range());
  }
  if (range.maxCoeff() >= kNeverChange) return {};
  return make_error(ErrorCode::kInvalidInput, where,
                    "its angles never change (by {:.3f} degrees at most): turn the head to a dozen "
                    "places while it is recorded; if it was, it does not say so",
                    range.maxCoeff() / kDegree);
}

/// Values of the zoom at which the head stood, those that are near to each other as one.
std::vector<double> find_zooms(const HeadInputs& in) {
  std::vector<double> all;
  for (const HeadView& view : make_views(in, 0.15, 0)) {
    if (!view.moving()) all.push_back(view.zoom);
  }
  std::sort(all.begin(), all.end());
  std::vector<double> zooms;
  const double apart = all.empty() ? 0 : std::max(0.005 * (all.back() - all.front()), 1e-6);
  for (size_t first = 0; first < all.size();) {
    size_t last = first;
    double sum = 0;
    while (last < all.size() && all[last] - all[first] <= apart) sum += all[last++];
    zooms.push_back(sum / static_cast<double>(last - first));
    first = last;
  }
  return zooms;
}

Status check_zoom(const HeadInputs& in, const AxesOptions& options) {
  const std::string where = head_place(in.sights);
  if (in.zooms.size() > 1 && !options.zoom) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "its zoom changes from {:g} to {:g} between settings: ask for a zoom table "
                      "(--zoom), or leave the zoom alone while recording",
                      in.zooms.front(), in.zooms.back());
  }
  if (!options.zoom) return {};
  if (in.zooms.size() < 2) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "a zoom table is asked for, and the zoom stands at {:g} all the time: record "
                      "{} settings at each of two or more values of it",
                      in.zooms.empty() ? 0.0 : in.zooms[0], kLeastAtZoom);
  }
  std::vector<size_t> counts(in.zooms.size(), 0);
  for (const HeadView& view : make_views(in, 0.15, 0)) {
    if (!view.moving()) ++counts[view.lens];
  }
  for (size_t z = 0; z < counts.size(); ++z) {
    if (counts[z] >= kLeastAtZoom) continue;
    return make_error(ErrorCode::kInvalidInput, where,
                      "at the zoom's {:g} there are {} settings, a row of the table takes {}",
                      in.zooms[z], counts[z], kLeastAtZoom);
  }
  return {};
}

/// Enough of both axes.
Status check_settings(const HeadInputs& in, const AxesOptions& options) {
  const std::string where = head_place(in.sights);
  size_t count = 0, seen = 0;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const HeadSetting& setting : in.settings) seen += !setting.moving;
  for (const HeadView& view : make_views(in, 0.15, 0)) {
    if (view.moving()) continue;
    ++count;
    low = low.cwiseMin(view.rest);
    high = high.cwiseMax(view.rest);
  }
  if (count < options.min_settings) {
    return make_error(
        ErrorCode::kInvalidInput, where,
        "the target is seen at {} settings of the head at rest{}, {} are needed: turn it to a "
        "dozen "
        "places from which the target is seen, and let it stand at each of them for a second",
        count,
        seen > count ? fmt::format(" ({} more, at which the readings do not rest)", seen - count)
                     : "",
        options.min_settings);
  }
  for (int axis = 0; axis < 2; ++axis) {
    if (high[axis] - low[axis] >= kTurned) continue;
    return make_error(ErrorCode::kInvalidInput, where,
                      "{} is between {:.2f} and {:.2f} degrees at all settings: only one axis was "
                      "turned. Turn both of them, by ten degrees or more",
                      axis == 0 ? "pan" : "tilt", low[axis] / kDegree, high[axis] / kDegree);
  }
  return {};
}

/// Evenly over all that are in motion.
void thin_out(std::vector<HeadView>& views) {
  const auto moving = static_cast<size_t>(
      std::count_if(views.begin(), views.end(), [](const HeadView& v) { return v.moving(); }));
  if (moving <= kMostMoving) return;
  size_t seen = 0, kept = 0;
  std::erase_if(views, [&](const HeadView& view) {
    if (!view.moving()) return false;
    const bool keep = ++seen * kMostMoving / moving > kept;
    kept += keep;
    return !keep;
  });
}

}  // namespace

std::string head_place(const HeadSights& sights) { return "camera " + sights.cameras[0].name; }

Status check_sights(const HeadSights& sights, const std::vector<CalibratedCamera>& calibration) {
  for (size_t c = 0; c < sights.cameras.size(); ++c) {
    const ViewedCamera& camera = sights.cameras[c];
    const CalibratedCamera* known = find_camera(calibration, camera.name);
    if (known == nullptr) {
      return make_error(ErrorCode::kInvalidInput, "camera " + camera.name,
                        "is not in the calibration: its lens has to be known first (sightline "
                        "calibrate solve)");
    }
    if (known->model.width() != camera.width || known->model.height() != camera.height) {
      return make_error(ErrorCode::kInvalidInput, "camera " + camera.name,
                        "its images are {}x{}, its lens is calibrated for {}x{}", camera.width,
                        camera.height, known->model.width(), known->model.height());
    }
  }
  return check_readings(sights);
}

size_t zoom_index(const std::vector<double>& zooms, double zoom) {
  if (zooms.size() < 2) return 0;
  const double apart = 0.01 * (zooms.back() - zooms.front());
  for (size_t z = 0; z < zooms.size(); ++z) {
    if (std::abs(zooms[z] - zoom) <= apart) return z;
  }
  return SIZE_MAX;
}

Result<HeadInputs> gather_inputs(const HeadSights& sights, const AxesOptions& options) {
  HeadInputs out;
  out.sights = sights;
  for (size_t r = 0; r < sights.recordings.size(); ++r) {
    out.times.emplace_back(sights.recordings[r]);
    const double step = out.times.back().readings.step();
    out.step = r == 0 ? step : std::min(out.step, step);
    SL_ASSIGN(const auto settings, head_settings(sights, r, out.times[r], options.min_corners));
    out.settings.insert(out.settings.end(), settings.begin(), settings.end());
  }
  SL_RETURN_IF_ERROR(check_settings(out, options));
  out.zooms = find_zooms(out);
  SL_RETURN_IF_ERROR(check_zoom(out, options));
  SL_ASSIGN(out.fixed, fixed_sights(sights, out.times, out.settings, options.min_corners));
  return out;
}

std::vector<HeadView> make_views(const HeadInputs& inputs, double latency_s, double slack_s) {
  std::vector<HeadView> out;
  for (const HeadSetting& setting : inputs.settings) {
    HeadView view;
    view.setting = &setting;
    view.times = &inputs.times[setting.recording];
    const Readings& readings = view.times->readings;
    const double middle = (setting.from_s + setting.to_s) / 2 + latency_s;
    if (setting.moving) {
      const auto at = readings.at(middle);
      if (!at || !readings.at(setting.from_s + kMostLatency) ||
          at->rates.cwiseAbs().maxCoeff() < kRate) {
        continue;
      }
      view.zoom = at->zoom;
    } else {
      const auto rest = rest_of(setting, *view.times, latency_s, slack_s);
      if (!rest) continue;
      view.rest = rest->angles;
      view.scatter = rest->scatter;
      view.zoom = rest->zoom;
    }
    view.lens = zoom_index(inputs.zooms, view.zoom);
    if (view.lens == SIZE_MAX) continue;
    view.sides = readings.sides(middle, kTravel);
    // Behind a turn nobody knows where in the play an axis is, and its error goes with the rate.
    if (setting.moving && (view.sides[0] == 0 || view.sides[1] == 0)) continue;
    for (const BodySight& sight : setting.sights) {
      view.weights.emplace_back(sight.corners.size(), 1.0);
    }
    out.push_back(std::move(view));
  }
  thin_out(out);
  return out;
}

}  // namespace sightline::calibrate
