// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/target_views.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "pipeline/calibrate/image_sets.hpp"
#include "pipeline/calibrate/target_finder.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/replay.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline {

using namespace pipeline;

namespace {

/// All targets that are looked for, each with its finder.
class Finders {
 public:
  static Result<Finders> create(const CalibrationTarget& target, const TargetViewsOptions& options,
                                size_t cameras) {
    Finders out;
    out.by_any_ = options.by_any;
    CalibrationTarget first = target;
    first.others.clear();
    std::vector<CalibrationTarget> parts{first};
    parts.insert(parts.end(), target.others.begin(), target.others.end());
    int offset = 0;
    for (const CalibrationTarget& part : parts) {
      SL_ASSIGN(auto finder, TargetFinder::create(part, options.window, cameras));
      out.parts_.push_back({part, std::move(finder), offset, {}});
      offset += part.own_corner_count();
    }
    return out;
  }

  struct Part {
    CalibrationTarget target;
    std::unique_ptr<TargetFinder> finder;
    int offset;  // of its corners' ids
    std::vector<TimedCorners> found;
  };
  std::vector<Part>& parts() { return parts_; }

  /// A camera may see any of them; each has to be seen by somebody.
  Status finish(const std::vector<ViewedCamera>& cameras) const {
    std::vector<char> seen(cameras.size(), 0);
    for (const Part& part : parts_) {
      for (size_t c = 0; c < cameras.size(); ++c) seen[c] = seen[c] || part.finder->found_any(c);
    }
    const std::vector<char> all(cameras.size(), 1), none(cameras.size(), 0);
    const bool somebody = std::count(seen.begin(), seen.end(), 1) > 0;
    SL_RETURN_IF_ERROR(parts_[0].finder->finish(cameras, by_any_ && somebody ? all
                                                         : parts_.size() > 1 ? seen
                                                                             : none));
    for (size_t k = 1; k < parts_.size(); ++k) {
      SL_RETURN_IF_ERROR(parts_[k].finder->finish(cameras, all));
      bool any = false;
      for (size_t c = 0; c < cameras.size(); ++c) any = any || parts_[k].finder->found_any(c);
      if (any) continue;
      return make_error(ErrorCode::kInvalidInput, parts_[k].target.name,
                        "the {} is in no image of any camera", parts_[k].target.describe());
    }
    return {};
  }

 private:
  std::vector<Part> parts_;
  bool by_any_ = false;
};

/// One set of a target that stands in the room: each camera's median over its images.
void add_fixed_set(const std::vector<TimedCorners>& found, CalibrationViews& views) {
  constexpr size_t kLeastImages = 3;
  std::map<size_t, std::map<int, std::vector<Eigen::Vector2d>>> pixels;
  std::map<size_t, size_t> images;
  for (const TimedCorners& image : found) {
    images[image.camera] += !image.corners.empty();
    for (const TargetCorner& c : image.corners) pixels[image.camera][c.id].push_back(c.pixel);
  }
  const auto median = [](const std::vector<Eigen::Vector2d>& from, int axis) {
    std::vector<double> values;
    for (const Eigen::Vector2d& p : from) values.push_back(p[axis]);
    const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  bool any = false;
  for (const auto& [camera, corners] : pixels) {
    TargetView view{camera, views.sets, 0, {}, "all images"};
    const size_t least = std::min(kLeastImages, images[camera]);
    for (const auto& [id, at] : corners) {
      if (at.size() < least) continue;
      view.corners.push_back({id, {median(at, 0), median(at, 1)}, Eigen::Vector2d::Zero()});
    }
    any = any || !view.corners.empty();
    if (!view.corners.empty()) views.views.push_back(std::move(view));
  }
  views.sets += any;
}

Result<std::vector<size_t>> chosen_cameras(const Recording& recording,
                                           const std::vector<std::string>& names) {
  std::vector<size_t> chosen;
  for (size_t i = 0; i < recording.cameras.size(); ++i) {
    if (names.empty() || std::count(names.begin(), names.end(), recording.cameras[i].name) > 0) {
      chosen.push_back(i);
    }
  }
  for (const std::string& name : names) {
    const bool there = std::any_of(recording.cameras.begin(), recording.cameras.end(),
                                   [&](const RecordedCamera& c) { return c.name == name; });
    if (there) continue;
    return make_error(ErrorCode::kInvalidInput, recording.path.string(), "has no camera '{}'",
                      name);
  }
  return chosen;
}

double shortest_period_s(const Recording& recording, const std::vector<size_t>& chosen) {
  double shortest = 1e9;
  for (const size_t i : chosen) {
    const double period = to_seconds(recording.cameras[i].frame_period());
    if (period > 0) shortest = std::min(shortest, period);
  }
  return shortest < 1e9 ? shortest : 1.0;
}

}  // namespace

Result<CalibrationViews> views_of_recording(const std::filesystem::path& path,
                                            const CalibrationTarget& target,
                                            const TargetViewsOptions& options) {
  SL_ASSIGN(Recording opened, open_recording(path));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(const std::vector<size_t> chosen, chosen_cameras(*recording, options.cameras));
  CalibrationViews views{.target = target, .cameras = {}, .sets = 0, .views = {}};
  std::vector<size_t> index(recording->cameras.size(), SIZE_MAX);
  for (const size_t i : chosen) {
    index[i] = views.cameras.size();
    const RecordedCamera& camera = recording->cameras[i];
    views.cameras.push_back({camera.name, camera.width, camera.height, 0});
  }
  SL_ASSIGN(Finders finders, Finders::create(target, options, chosen.size()));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
  const size_t total = recording->frame_count();
  std::vector<size_t> seen(chosen.size(), 0);
  for (size_t done = 0;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    for (const FramePtr& frame : *frames) {
      if (options.on_progress) options.on_progress(++done, total);
      const size_t camera = index[frame->info().camera.index()];
      if (camera == SIZE_MAX || frame->info().status != FrameStatus::kGood) continue;
      if (seen[camera]++ % options.every != 0) continue;
      ++views.cameras[camera].images;
      const double time_s = to_seconds(frame->info().capture - recording->first_capture());
      for (Finders::Part& part : finders.parts()) {
        part.found.push_back({camera, time_s, part.finder->look(camera, frame)});
      }
    }
  }
  SL_RETURN_IF_ERROR(finders.finish(views.cameras));
  const double period = shortest_period_s(*recording, chosen) * static_cast<double>(options.every);
  for (Finders::Part& part : finders.parts()) {
    const size_t begin = views.views.size();
    if (part.target.fixed) {
      add_fixed_set(part.found, views);
    } else {
      add_motion(part.found, 2.5 * period);
      group_into_sets(part.found, options.set_span_s > 0 ? options.set_span_s : 0.5 * period,
                      views);
    }
    for (size_t v = begin; v < views.views.size(); ++v) {
      for (TargetCorner& corner : views.views[v].corners) corner.id += part.offset;
    }
  }
  return views;
}

Result<CalibrationViews> views_of_stills(const std::vector<CameraStills>& stills,
                                         const CalibrationTarget& target,
                                         const TargetViewsOptions& options) {
  CalibrationViews views{.target = target, .cameras = {}, .sets = 0, .views = {}};
  SL_ASSIGN(Finders finders, Finders::create(target, options, stills.size()));
  size_t total = 0, done = 0;
  for (const CameraStills& camera : stills) total += camera.files.size();
  size_t base_sets = 0;
  const std::vector<std::vector<size_t>> sets = sets_of_stills(stills, base_sets);
  for (size_t c = 0; c < stills.size(); ++c) {
    views.cameras.push_back({stills[c].name, 0, 0, 0});
    ViewedCamera& camera = views.cameras.back();
    for (size_t i = 0; i < stills[c].files.size(); i += options.every) {
      SL_ASSIGN(auto image, read_image(stills[c].files[i]));
      FrameInfo info;
      info.width = image->width();
      info.height = image->height();
      if (camera.images++ == 0) {
        camera.width = info.width;
        camera.height = info.height;
      } else if (camera.width != info.width || camera.height != info.height) {
        return make_error(ErrorCode::kInvalidInput, stills[c].files[i].string(),
                          "is {}x{}, but the first image of camera {} is {}x{}: a calibration "
                          "belongs to one image size",
                          info.width, info.height, camera.name, camera.width, camera.height);
      }
      const FramePtr frame = Frame::decoded(info, std::move(image));
      if (options.on_progress) options.on_progress(++done, total);
      size_t first_set = 0;  // of this target: others have sets of their own behind
      for (Finders::Part& part : finders.parts()) {
        auto corners = part.finder->look(c, frame);
        if (part.target.fixed) {
          part.found.push_back({c, 0, std::move(corners)});
          continue;
        }
        for (TargetCorner& corner : corners) corner.id += part.offset;
        const size_t set = first_set + sets[c][i];
        first_set += base_sets;
        if (corners.empty()) continue;
        views.views.push_back(
            {c, set, 0, std::move(corners), stills[c].files[i].filename().string()});
      }
    }
  }
  SL_RETURN_IF_ERROR(finders.finish(views.cameras));
  const auto moving = std::count_if(finders.parts().begin(), finders.parts().end(),
                                    [](const Finders::Part& p) { return !p.target.fixed; });
  views.sets = base_sets * static_cast<size_t>(moving);
  for (Finders::Part& part : finders.parts()) {
    if (!part.target.fixed) continue;
    for (TimedCorners& image : part.found) {
      for (TargetCorner& corner : image.corners) corner.id += part.offset;
    }
    add_fixed_set(part.found, views);
  }
  return views;
}

}  // namespace sightline
