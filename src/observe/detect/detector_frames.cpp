// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/detector_frames.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

// Pixels that are not background, and those around them.
void dilate_foreground(const ForegroundMap& map, std::vector<uint8_t>& mask) {
  const auto width = static_cast<size_t>(map.width);
  mask.assign(map.classes.size(), 0);
  for (int y = 0; y < map.height; ++y) {
    const uint8_t* row = map.row(y);
    for (int x = 0; x < map.width; ++x) {
      if (row[x] == ForegroundMap::kBackground) continue;
      const int top = std::max(0, y - kForegroundMargin);
      const int bottom = std::min(map.height - 1, y + kForegroundMargin);
      const int left = std::max(0, x - kForegroundMargin);
      const int right = std::min(map.width - 1, x + kForegroundMargin);
      for (int v = top; v <= bottom; ++v) {
        uint8_t* to = mask.data() + static_cast<size_t>(v) * width;
        std::fill(to + left, to + right + 1, uint8_t{1});
      }
    }
  }
}

// Each pixel four times.
void magnify(const ForegroundMap& from, const HalfSizeImage& size, ForegroundMap& to) {
  to.width = size.width;
  to.height = size.height;
  to.share = from.share;
  to.classes.resize(static_cast<size_t>(to.width) * static_cast<size_t>(to.height));
  for (int y = 0; y < to.height; ++y) {
    const uint8_t* row = from.row(std::min(y / 2, from.height - 1));
    uint8_t* out = to.classes.data() + static_cast<size_t>(y) * static_cast<size_t>(to.width);
    for (int x = 0; x < to.width; ++x) out[x] = row[std::min(x / 2, from.width - 1)];
  }
}

}  // namespace

DetectorFrames::DetectorFrames(std::vector<DetectorCamera> cameras, const DetectorOptions& options,
                               Executor executor)
    : cameras_(std::move(cameras)),
      max_age_(options.max_age),
      usual_speed_(options.usual_speed),
      executor_(std::move(executor)),
      slots_(cameras_.size()) {}

void DetectorFrames::magnify_where_small(const SearchDistances& distances, double width) {
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const CalibratedCamera& camera = cameras_[i].calibration;
    const bool small =
        camera.model.parameters().fx * width < kSmallObjectPx * distances.cameras[i].farthest;
    slots_[i].magnified = small ? magnified(camera) : std::nullopt;
  }
}

void DetectorFrames::add(CameraId camera, const Frame& frame, const ForegroundMap* foreground) {
  for (size_t i = 0; i < cameras_.size(); ++i) {
    Slot& slot = slots_[i];
    if (cameras_[i].id != camera ||
        !slot.frame.store(frame, cameras_[i].calibration.model, slot.magnified.has_value())) {
      continue;
    }
    if (slot.frame.info.place) {
      cameras_[i].calibration.world_from_camera = slot.frame.info.place->world_from_camera;
      if (slot.magnified) {
        slot.magnified->world_from_camera = cameras_[i].calibration.world_from_camera;
      }
    }
    const HalfSizeImage& image = slot.frame.image;
    slot.has_foreground = foreground != nullptr && foreground->width == image.width &&
                          foreground->height == image.height;
    if (!slot.has_foreground) continue;
    slot.foreground = *foreground;
    if (slot.magnified) magnify(*foreground, slot.frame.magnified, slot.magnified_foreground);
  }
}

size_t DetectorFrames::needed() const { return std::min<size_t>(2, cameras_.size()); }

bool DetectorFrames::show_foreground() const {
  const auto showing = std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.frame.valid && slot.has_foreground && slot.foreground.share > kMinForegroundShare;
  });
  return static_cast<size_t>(showing) >= needed();
}

bool DetectorFrames::select(bool focused) {
  active_.clear();
  newest_ = Time{};
  for (const Slot& slot : slots_) {
    if (slot.frame.valid) newest_ = std::max(newest_, slot.frame.info.capture);
  }
  for (size_t i = 0; i < slots_.size(); ++i) {
    const HalfSizeFrame& frame = slots_[i].frame;
    if (frame.valid && newest_ - frame.info.capture <= max_age_) active_.push_back(i);
  }
  for (const size_t i : active_) work_.images += slots_[i].magnified ? 2 : 1;
  edges_.resize(active_.size());
  borders_.resize(active_.size());
  masks_.resize(active_.size());
  magnified_masks_.resize(active_.size());
  magnified_edges_.resize(active_.size());
  magnified_cameras_.resize(active_.size());
  search_cameras_.resize(active_.size());
  fit_cameras_.resize(active_.size());
  executor_(active_.size(), [&](size_t i) { prepare(i, focused); });
  set_reference(newest_);
  return !active_.empty();
}

void DetectorFrames::prepare(size_t i, bool focused) {
  const CalibratedCamera& camera = cameras_[active_[i]].calibration;
  const HalfSizeImage& image = slots_[active_[i]].frame.image;
  edges_[i].compute(image);
  masks_[i].clear();
  if (focused && foreground(i) != nullptr) {
    dilate_foreground(*foreground(i), masks_[i]);
    edges_[i].keep_where(masks_[i]);
  }
  SearchCamera& search = search_cameras_[i];
  search.camera = &camera;
  search.camera_from_world = camera.world_from_camera.inverse();
  search.usual_speed = usual_speed_;
  fit_cameras_[i] = {&camera, search.camera_from_world, &image, &edges_[i], 0, foreground(i)};
  const Slot& slot = slots_[active_[i]];
  if (!slot.magnified) return;
  magnified_edges_[i].compute(slot.frame.magnified);
  if (!masks_[i].empty()) {
    dilate_foreground(slot.magnified_foreground, magnified_masks_[i]);
    magnified_edges_[i].keep_where(magnified_masks_[i]);
  }
  magnified_cameras_[i] = {&*slot.magnified,
                           search.camera_from_world,
                           &slot.frame.magnified,
                           &magnified_edges_[i],
                           0,
                           slot.has_foreground ? &slot.magnified_foreground : nullptr,
                           nullptr,
                           true};
  fit_cameras_[i].magnified = &magnified_cameras_[i];
}

void DetectorFrames::compute_responses(int margin, Edges edges) {
  executor_(active_.size(), [&](size_t i) {
    if (edges == Edges::kBorders) borders_[i].compute(image(i), edges_[i]);
    search_cameras_[i].respond_to(
        edges_[i], edges == Edges::kBorders ? borders_[i].bins() : edges_[i].bins(), margin);
  });
}

void DetectorFrames::set_reference(Time reference) {
  for (size_t i = 0; i < active_.size(); ++i) {
    fit_cameras_[i].seconds = to_seconds(info(i).capture - reference);
    magnified_cameras_[i].seconds = fit_cameras_[i].seconds;
    search_cameras_[i].seconds = fit_cameras_[i].seconds;
  }
}

const ForegroundMap* DetectorFrames::foreground(size_t i) const {
  const Slot& slot = slots_[active_[i]];
  return slot.has_foreground ? &slot.foreground : nullptr;
}

std::vector<SilhouetteCamera> DetectorFrames::silhouette_cameras(
    const SearchDistances& distances) const {
  std::vector<SilhouetteCamera> out;
  for (size_t i = 0; i < active_.size(); ++i) {
    if (foreground(i) == nullptr) continue;
    const CalibratedCamera& camera = cameras_[active_[i]].calibration;
    const CameraDistances& reach = distances.cameras[active_[i]];
    out.push_back({&camera,
                   camera.world_from_camera.inverse(),
                   foreground(i),
                   reach.nearest,
                   reach.farthest,
                   {},
                   {}});
    out.back().sum_up();
  }
  if (out.size() < needed()) out.clear();
  return out;
}

bool DetectorFrames::show_colors() const {
  return std::ranges::any_of(fit_cameras_,
                             [](const FitCamera& camera) { return has_colors(*camera.image); });
}

}  // namespace sightline::observe
