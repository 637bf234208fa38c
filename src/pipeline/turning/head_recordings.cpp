// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/head_recordings.hpp"

#include <algorithm>
#include <map>
#include <memory>

#include "pipeline/calibrate/target_finder.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

using namespace pipeline;

namespace {

/// A target, and where its corners are among the points of bodies.
struct Sought {
  CalibrationTarget target;
  std::unique_ptr<TargetFinder> finder;
  size_t body = SIZE_MAX;  ///< one that is for all recordings
  int first_point = 0;
};

class Collector {
 public:
  Collector(const std::vector<CalibratedCamera>& calibration, const HeadRecordingsOptions& options)
      : calibration_(calibration), options_(options) {}

  /// `known`: sizes of the cameras' images, the head first.
  Status begin(const CalibrationTarget& target, std::vector<ViewedCamera> cameras) {
    out_.cameras = std::move(cameras);
    CalibrationTarget first = target;
    first.others.clear();
    std::vector<CalibrationTarget> all{first};
    all.insert(all.end(), target.others.begin(), target.others.end());
    for (const CalibrationTarget& one : all) {
      Sought sought{one, nullptr, SIZE_MAX, 0};
      SL_ASSIGN(sought.finder, TargetFinder::create(one, options_.window, out_.cameras.size()));
      if (one.fixed) place_fixed(sought);
      sought_.push_back(std::move(sought));
    }
    return {};
  }

  Status add(const Recording& opened, const std::string& name);

  Result<HeadSights> finish() const {
    const std::vector<char> all(out_.cameras.size(), 1);
    std::vector<char> but_head = all;
    but_head[0] = 0;
    bool any = false;
    for (const Sought& s : sought_) any = any || s.finder->found_any(0);
    for (const Sought& s : sought_) {
      SL_RETURN_IF_ERROR(s.finder->finish(out_.cameras, any ? all : but_head));
    }
    return out_;
  }

 private:
  void place_fixed(Sought& sought) {
    const bool known = sought.target.world_from_target.has_value();
    if (known && tags_ != SIZE_MAX) {
      SightedBody& body = out_.bodies[tags_];
      sought.body = tags_;
      sought.first_point = body.point_count();
      body.name = "the targets whose places are known";
      body.parts.push_back({sought.target, *sought.target.world_from_target, sought.first_point});
      return;
    }
    sought.body = out_.bodies.size();
    if (known) tags_ = sought.body;
    out_.bodies.push_back({sought.target.name,
                           {{sought.target, sought.target.world_from_target.value_or(Rigid3()), 0}},
                           known ? std::optional(Rigid3()) : std::nullopt});
  }

  const std::vector<CalibratedCamera>& calibration_;
  const HeadRecordingsOptions& options_;
  HeadSights out_;
  std::vector<Sought> sought_;
  size_t tags_ = SIZE_MAX;
};

Status Collector::add(const Recording& opened, const std::string& name) {
  const auto recording = std::make_shared<const Recording>(opened);
  std::vector<size_t> index(recording->cameras.size(), SIZE_MAX);
  std::vector<Duration> offsets(recording->cameras.size(), Duration(0));
  for (size_t i = 0; i < recording->cameras.size(); ++i) {
    const auto at =
        std::ranges::find(out_.cameras, recording->cameras[i].name, &ViewedCamera::name);
    if (at == out_.cameras.end()) continue;
    index[i] = static_cast<size_t>(at - out_.cameras.begin());
    offsets[i] = from_seconds(find_camera(calibration_, at->name)->time_offset_s);
    if (index[i] == 0) out_.recordings.push_back({name, recording->cameras[i].axes, {}});
  }
  std::vector<size_t> bodies;
  for (const Sought& s : sought_) {
    bodies.push_back(s.body != SIZE_MAX ? s.body : out_.bodies.size());
    if (s.body != SIZE_MAX) continue;
    out_.bodies.push_back({s.target.name + " in " + name, {{s.target, Rigid3(), 0}}, std::nullopt});
  }
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, offsets));
  std::vector<size_t> seen(recording->cameras.size(), 0);
  const size_t total = recording->frame_count();
  for (size_t done = 0;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    for (const FramePtr& frame : *frames) {
      if (options_.on_progress) options_.on_progress(++done, total);
      const size_t from = frame->info().camera.index(), camera = index[from];
      if (camera == SIZE_MAX || frame->info().status != FrameStatus::kGood) continue;
      if (seen[from]++ % options_.every != 0) continue;
      ++out_.cameras[camera].images;
      std::map<size_t, BodySight> sights;
      for (size_t k = 0; k < sought_.size(); ++k) {
        for (TargetCorner corner : sought_[k].finder->look(camera, frame)) {
          corner.id += sought_[k].first_point;
          sights[bodies[k]].corners.push_back(corner);
        }
      }
      HeadImage image{camera, frame->info().capture, {}};
      for (auto& [body, sight] : sights) image.sights.push_back({body, std::move(sight.corners)});
      if (!image.sights.empty()) out_.recordings.back().images.push_back(std::move(image));
    }
  }
  return {};
}

}  // namespace

Result<HeadSights> sights_of_head(const std::vector<std::filesystem::path>& recordings,
                                  const CalibrationTarget& target,
                                  const std::vector<CalibratedCamera>& calibration,
                                  const HeadRecordingsOptions& options) {
  const CalibratedCamera* head = find_camera(calibration, options.camera);
  if (head == nullptr) {
    return make_error(ErrorCode::kInvalidInput, "camera " + options.camera,
                      "is not in the calibration: its lens has to be known first (sightline "
                      "calibrate solve)");
  }
  std::vector<Recording> opened;
  std::vector<ViewedCamera> cameras{{options.camera, head->model.width(), head->model.height(), 0}};
  for (const auto& path : recordings) {
    SL_ASSIGN(opened.emplace_back(), open_recording(path));
    bool has_head = false;
    for (const RecordedCamera& camera : opened.back().cameras) {
      const CalibratedCamera* known = find_camera(calibration, camera.name);
      const bool is_head = camera.name == options.camera;
      if (is_head) cameras[0] = {camera.name, camera.width, camera.height, 0};
      has_head = has_head || is_head;
      if (is_head && camera.axes.empty()) {
        return make_error(ErrorCode::kInvalidInput, path.string(),
                          "has no angles of camera {} (axes.csv): give the camera an axes source "
                          "(docs/turning.md), and record again",
                          camera.name);
      }
      if (is_head || known == nullptr || known->axes) continue;
      if (std::ranges::count(cameras, camera.name, &ViewedCamera::name) > 0) continue;
      cameras.push_back({camera.name, camera.width, camera.height, 0});
    }
    if (has_head) continue;
    return make_error(ErrorCode::kInvalidInput, path.string(), "has no camera '{}'",
                      options.camera);
  }
  Collector collector(calibration, options);
  SL_RETURN_IF_ERROR(collector.begin(target, std::move(cameras)));
  for (size_t r = 0; r < opened.size(); ++r) {
    SL_RETURN_IF_ERROR(
        collector.add(opened[r], recordings[r].filename().empty()
                                     ? recordings[r].parent_path().filename().string()
                                     : recordings[r].filename().string()));
  }
  return collector.finish();
}

}  // namespace sightline
