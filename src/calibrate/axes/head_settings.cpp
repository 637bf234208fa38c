// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/head_settings.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "sightline/base/check.hpp"

namespace sightline {

const SightedBody::Part& SightedBody::part(int point) const {
  for (const Part& p : parts) {
    if (point >= p.first_point && point < p.first_point + p.target.own_corner_count()) return p;
  }
  SL_CHECK(false, "a point of the body");
}

Eigen::Vector3d SightedBody::point(int id) const {
  const Part& p = part(id);
  const Eigen::Vector2d at = p.target.corner(id - p.first_point);
  return p.body_from_target * Eigen::Vector3d(at.x(), at.y(), 0);
}

int SightedBody::point_count() const {
  int count = 0;
  for (const Part& p : parts) {
    count = std::max(count, p.first_point + p.target.own_corner_count());
  }
  return count;
}

namespace calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMostStep = 0.5 * kDegree;  // what is larger is no step but a turn
constexpr double kStillPx = 0.5;             // corners move by less from one image to the next
constexpr double kStillAllPx = 1.0;          // and from the first to the last
constexpr double kLeastRest = 0.35;          // [s] at rest, by the picture
constexpr double kNextImage = 0.6;           // [s]; images farther apart say nothing of motion
constexpr double kTurnedPx = 4;              // the picture has moved, whatever noise there is
constexpr double kSettles = 0.1;             // [s] for which readings go on after the head stands
constexpr double kBodyMovedPx = 1.0;         // before a camera that stands still

size_t corner_count(const std::vector<BodySight>& sights) {
  size_t count = 0;
  for (const BodySight& sight : sights) count += sight.corners.size();
  return count;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Medians of points that at least half of the images show.
std::vector<BodySight> median_sights(const std::vector<const HeadImage*>& images) {
  std::map<size_t, std::map<int, std::array<std::vector<double>, 2>>> pixels;
  for (const HeadImage* image : images) {
    for (const BodySight& sight : image->sights) {
      for (const TargetCorner& c : sight.corners) {
        auto& at = pixels[sight.body][c.id];
        at[0].push_back(c.pixel.x());
        at[1].push_back(c.pixel.y());
      }
    }
  }
  std::vector<BodySight> out;
  for (const auto& [body, points] : pixels) {
    BodySight sight{body, {}};
    for (const auto& [id, at] : points) {
      if (2 * at[0].size() < images.size()) continue;
      sight.corners.push_back({id, {median(at[0]), median(at[1])}, Eigen::Vector2d::Zero()});
    }
    if (!sight.corners.empty()) out.push_back(std::move(sight));
  }
  return out;
}

/// Images of the head in which enough is seen.
std::vector<const HeadImage*> head_images(const HeadRecording& recording, size_t min_corners) {
  std::vector<const HeadImage*> out;
  for (const HeadImage& image : recording.images) {
    if (image.camera == 0 && corner_count(image.sights) >= min_corners) out.push_back(&image);
  }
  return out;
}

double at_s(const HeadTimes& times, const HeadImage& image) {
  return to_seconds(image.capture - times.origin);
}

Error moved_before(const HeadSights& sights, size_t camera, size_t recording, double moved,
                   double from_s) {
  return make_error(
      ErrorCode::kInvalidInput, "camera " + sights.cameras[camera].name,
      "sees the board {:.1f} px from where it was, {:.2f} s after the beginning of {}: it was "
      "moved "
      "while the head looked at it. Leave it where it is for the whole recording; another place of "
      "it is another recording",
      moved, from_s, sights.recordings[recording].name);
}

/// A camera that stands still sees what moved between two times, if something did.
Status check_moved(const HeadSights& sights, size_t recording, const HeadTimes& times,
                   double from_s, double to_s) {
  for (size_t camera = 1; camera < sights.cameras.size(); ++camera) {
    const HeadImage *before = nullptr, *after = nullptr;
    for (const HeadImage& image : sights.recordings[recording].images) {
      if (image.camera != camera) continue;
      if (at_s(times, image) <= from_s) before = &image;
      if (at_s(times, image) >= to_s && after == nullptr) after = &image;
    }
    if (before == nullptr || after == nullptr) continue;
    const double moved = moved_px(before->sights, after->sights);
    if (moved > kBodyMovedPx) return moved_before(sights, camera, recording, moved, to_s);
  }
  return {};
}

/// The picture turns, and for as long as readings may be late they say that nothing does.
Status check_frozen(const HeadSights& sights, size_t recording, const HeadTimes& times,
                    const std::vector<const HeadImage*>& images) {
  for (size_t i = 1; i < images.size(); ++i) {
    const double from = at_s(times, *images[i - 1]), to = at_s(times, *images[i]);
    const double moved = moved_px(images[i - 1]->sights, images[i]->sights);
    const double late = to + kMostLatency + kSettles;
    if (moved < kTurnedPx || !times.readings.at(late) ||
        !times.readings.constant(from - kSettles, late, times.tolerance)) {
      continue;
    }
    SL_RETURN_IF_ERROR(check_moved(sights, recording, times, from, to));
    const auto still = times.readings.at(to);
    return make_error(ErrorCode::kInvalidInput, "camera " + sights.cameras[0].name,
                      "the angles are frozen while the picture turns: {:.2f} s after the beginning "
                      "of {} it moves "
                      "by {:.0f} px and the readings stay at {:.2f}, {:.2f} degrees. Was what it "
                      "looks at carried "
                      "away? Otherwise see what the head sends (axes.csv), and record again",
                      to, sights.recordings[recording].name, moved,
                      (still ? still->angles.x() : 0) / kDegree,
                      (still ? still->angles.y() : 0) / kDegree);
  }
  return {};
}

}  // namespace

HeadTimes::HeadTimes(const HeadRecording& recording)
    : origin(recording.images.empty() ? Time{} : recording.images.front().capture),
      readings(recording.readings, origin),
      tolerance(std::max({0.03 * kDegree, 4 * readings.noise(),
                          readings.step() < kMostStep ? 2.1 * readings.step() : 0})) {}

double moved_px(const std::vector<BodySight>& a, const std::vector<BodySight>& b) {
  std::vector<double> moved;
  for (const BodySight& before : a) {
    for (const BodySight& now : b) {
      if (before.body != now.body) continue;
      std::map<int, Eigen::Vector2d> at;
      for (const TargetCorner& c : before.corners) at[c.id] = c.pixel;
      for (const TargetCorner& c : now.corners) {
        const auto found = at.find(c.id);
        if (found != at.end()) moved.push_back((c.pixel - found->second).norm());
      }
    }
  }
  return moved.size() < 4 ? -1 : median(std::move(moved));
}

Result<std::vector<HeadSetting>> head_settings(const HeadSights& sights, size_t recording,
                                               const HeadTimes& times, size_t min_corners) {
  const auto images = head_images(sights.recordings[recording], min_corners);
  SL_RETURN_IF_ERROR(check_frozen(sights, recording, times, images));
  std::vector<HeadSetting> out;
  for (size_t first = 0; first < images.size();) {
    size_t last = first;
    while (last + 1 < images.size()) {
      const auto &now = *images[last], &next = *images[last + 1];
      const double step = moved_px(now.sights, next.sights);
      const double all = moved_px(images[first]->sights, next.sights);
      if (at_s(times, next) - at_s(times, now) > kNextImage || step < 0 || step > kStillPx ||
          all < 0 || all > kStillAllPx) {
        break;
      }
      ++last;
    }
    const double from = at_s(times, *images[first]), to = at_s(times, *images[last]);
    const bool by_picture = to - from >= kLeastRest;
    // A single image now and then: the head has stood still for as long as readings may be late.
    const bool by_readings =
        times.readings.at(from - kMostLatency).has_value() &&
        times.readings.at(to + kMostLatency).has_value() &&
        times.readings.constant(from - kMostLatency, to + kMostLatency, times.tolerance);
    if (by_picture || by_readings) {
      const std::vector<const HeadImage*> run(images.begin() + static_cast<ptrdiff_t>(first),
                                              images.begin() + static_cast<ptrdiff_t>(last) + 1);
      out.push_back({recording, from, to, false, run.size(), median_sights(run)});
    } else {
      for (size_t i = first; i <= last; ++i) {
        const double time = at_s(times, *images[i]);
        out.push_back({recording, time, time, true, 1, images[i]->sights});
      }
    }
    first = last + 1;
  }
  return out;
}

std::optional<Readings::Rest> rest_of(const HeadSetting& setting, const HeadTimes& times,
                                      double latency_s, double slack_s) {
  const double half = (setting.to_s - setting.from_s) / 2;
  const double slack = std::min(slack_s, half - 0.05);  // negative: a moment longer
  return times.readings.rest(setting.from_s + latency_s + slack, setting.to_s + latency_s - slack,
                             times.tolerance);
}

Result<std::vector<FixedSight>> fixed_sights(const HeadSights& sights,
                                             const std::vector<HeadTimes>& times,
                                             const std::vector<HeadSetting>& settings,
                                             size_t min_corners) {
  std::vector<FixedSight> out;
  for (size_t camera = 1; camera < sights.cameras.size(); ++camera) {
    for (size_t r = 0; r < sights.recordings.size(); ++r) {
      std::vector<const HeadImage*> all;
      for (const HeadSetting& setting : settings) {
        if (setting.recording != r || setting.moving) continue;
        std::vector<const HeadImage*> during;
        for (const HeadImage& image : sights.recordings[r].images) {
          const double time = at_s(times[r], image);
          if (image.camera != camera || time < setting.from_s || time > setting.to_s) continue;
          during.push_back(&image);
        }
        if (during.empty()) continue;
        all.insert(all.end(), during.begin(), during.end());
        const double moved = moved_px(median_sights({all.front()}), median_sights(during));
        if (moved < kBodyMovedPx) continue;
        return moved_before(sights, camera, r, moved, setting.from_s);
      }
      for (BodySight& sight : median_sights(all)) {
        if (sight.corners.size() >= min_corners) out.push_back({camera, r, std::move(sight)});
      }
    }
  }
  return out;
}

}  // namespace calibrate
}  // namespace sightline
