// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/target_views.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "pipeline/calibrate/image_sets.hpp"
#include "sightline/observe/fiducial/target_detector.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/replay.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline {

using namespace pipeline;

namespace {

/// Finds the target in the images of all cameras, and says why not.
class Finder {
 public:
  static Result<std::unique_ptr<Finder>> create(const CalibrationTarget& target,
                                                const TargetViewsOptions& options, size_t cameras) {
    auto finder = std::unique_ptr<Finder>(new Finder(target));
    for (size_t c = 0; c < cameras; ++c) {
      SL_ASSIGN(auto detector,
                TargetDetector::create(target, TargetDetectorOptions{.window = options.window}));
      finder->detectors_.push_back(std::move(detector));
    }
    finder->found_.resize(cameras, 0);
    finder->unexplained_.resize(cameras);
    return finder;
  }

  std::vector<TargetCorner> look(size_t camera, const FramePtr& frame) {
    std::vector<TargetCorner> corners;
    for (const DetectedCorner& c : detectors_[camera]->detect(*frame)) {
      corners.push_back({c.id, c.pixel, Eigen::Vector2d::Zero()});
    }
    found_[camera] += !corners.empty();
    if (corners.empty() && unexplained_[camera].size() < 6) unexplained_[camera].push_back(frame);
    return corners;
  }

  /// After all images: refuses a target that a camera never showed, and the other layout.
  Status finish(const std::vector<ViewedCamera>& cameras) const {
    for (size_t c = 0; c < cameras.size(); ++c) {
      const CharucoLayout layout = detectors_[c]->layout();
      if (target_.layout != CharucoLayout::kAny && layout != CharucoLayout::kAny &&
          layout != target_.layout) {
        const bool dark = layout == CharucoLayout::kDarkFirst;
        return make_error(
            ErrorCode::kInvalidInput, "camera " + cameras[c].name,
            "the print has the other layout for its even number of rows: {} at its top-left. Write "
            "layout = \"{}\" (or \"any\") into the target file",
            dark ? "a dark square" : "a marker", dark ? "dark_first" : "marker_first");
      }
      if (found_[c] > 0) continue;
      std::string reason;
      for (const FramePtr& frame : unexplained_[c]) {
        reason = explain_missing_target(target_, *frame);
        if (!reason.empty()) break;
      }
      return make_error(
          ErrorCode::kInvalidInput, "camera " + cameras[c].name,
          "the {} is in none of its {} images{}", target_.describe(), cameras[c].images,
          reason.empty() ? "; is it in view, large and sharp enough?" : ": " + reason);
    }
    return {};
  }

 private:
  explicit Finder(const CalibrationTarget& target) : target_(target) {}

  CalibrationTarget target_;
  std::vector<std::unique_ptr<TargetDetector>> detectors_;
  std::vector<size_t> found_;
  std::vector<std::vector<FramePtr>> unexplained_;
};

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
  SL_ASSIGN(auto finder, Finder::create(target, options, chosen.size()));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
  const size_t total = recording->frame_count();
  std::vector<TimedCorners> found;
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
      found.push_back({camera, time_s, finder->look(camera, frame)});
    }
  }
  SL_RETURN_IF_ERROR(finder->finish(views.cameras));
  const double period = shortest_period_s(*recording, chosen) * static_cast<double>(options.every);
  add_motion(found, 2.5 * period);
  group_into_sets(found, options.set_span_s > 0 ? options.set_span_s : 0.5 * period, views);
  return views;
}

Result<CalibrationViews> views_of_stills(const std::vector<CameraStills>& stills,
                                         const CalibrationTarget& target,
                                         const TargetViewsOptions& options) {
  CalibrationViews views{.target = target, .cameras = {}, .sets = 0, .views = {}};
  SL_ASSIGN(auto finder, Finder::create(target, options, stills.size()));
  size_t total = 0, done = 0;
  for (const CameraStills& camera : stills) total += camera.files.size();
  const std::vector<std::vector<size_t>> sets = sets_of_stills(stills, views.sets);
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
      auto corners = finder->look(c, Frame::decoded(info, std::move(image)));
      if (options.on_progress) options.on_progress(++done, total);
      if (corners.empty()) continue;
      views.views.push_back(
          {c, sets[c][i], 0, std::move(corners), stills[c].files[i].filename().string()});
    }
  }
  SL_RETURN_IF_ERROR(finder->finish(views.cameras));
  return views;
}

}  // namespace sightline
