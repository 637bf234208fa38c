// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/detector_frames.hpp"

#include <algorithm>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/pixels/foreground_masks.hpp"

namespace sightline::observe {
namespace {

// Whether any pixel of the mask in that box is set.
bool any_in(const std::vector<uint8_t>& mask, int width, int height, const PixelBox& box) {
  const int left = std::max(0, box.left), right = std::min(width, box.right);
  for (int y = std::max(0, box.top); y < std::min(height, box.bottom); ++y) {
    const auto row = mask.begin() + static_cast<ptrdiff_t>(y) * width;
    if (std::any_of(row + left, row + right, [](uint8_t set) { return set != 0; })) return true;
  }
  return false;
}

}  // namespace

DetectorFrames::DetectorFrames(std::vector<DetectorCamera> cameras, const DetectorOptions& options,
                               Executor executor, std::vector<SearchSize> sizes)
    : cameras_(std::move(cameras)),
      sizes_(std::move(sizes)),
      max_age_(options.max_age),
      usual_speed_(options.usual_speed),
      executor_(std::move(executor)),
      slots_(cameras_.size()) {
  for (size_t i = sizes_.size(); i < cameras_.size(); ++i) {
    const CameraModel& model = cameras_[i].calibration.model;
    sizes_.push_back({model.width(), model.height(), 1});
  }
}

void DetectorFrames::show_at_its_size(const SearchDistances& distances, double width) {
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const CalibratedCamera& camera = cameras_[i].calibration;
    const double px_times_distance = camera.model.parameters().fx * width;
    const bool small = px_times_distance < kSmallObjectPx * distances.cameras[i].farthest;
    auto twice = small ? magnified(camera) : std::nullopt;
    const bool large = px_times_distance >= kLargeObjectPx * distances.cameras[i].nearest;
    auto half = large ? reduced(camera) : std::nullopt;
    slots_[i].reduced = half ? std::make_unique<ReducedLook>(*std::move(half)) : nullptr;
    slots_[i].magnified = twice ? std::make_unique<MagnifiedLook>(*std::move(twice)) : nullptr;
  }
}

void DetectorFrames::add(CameraId camera, const Frame& frame, const ForegroundMap* foreground) {
  for (size_t i = 0; i < cameras_.size(); ++i) {
    Slot& slot = slots_[i];
    const SearchSize& size = sizes_[i];
    if (cameras_[i].id != camera || !HalfSizeFrame::can_store(frame, size.width, size.height)) {
      continue;
    }
    if (slot.frame.valid) slot.difference.remember(slot.frame.image, slot.frame.info.capture);
    slot.frame.store(frame, cameras_[i].calibration.model, size.shrink, slot.magnified != nullptr);
    if (slot.frame.info.place) {
      cameras_[i].calibration.world_from_camera = slot.frame.info.place->world_from_camera;
    }
    const HalfSizeImage& image = slot.frame.image;
    slot.has_foreground = foreground != nullptr && foreground->width == size.width / 2 &&
                          foreground->height == size.height / 2;
    if (!slot.has_foreground) continue;
    shrink(*foreground, size.shrink, image.width, image.height, slot.foreground);
  }
}

size_t DetectorFrames::needed() const { return std::min<size_t>(2, cameras_.size()); }

bool DetectorFrames::show_foreground() const {
  const auto showing = std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.frame.valid && slot.has_foreground && slot.foreground.share > kMinForegroundShare;
  });
  return static_cast<size_t>(showing) >= needed();
}

bool DetectorFrames::show_motion() {
  executor_(slots_.size(), [&](size_t i) {
    Slot& slot = slots_[i];
    slot.motion.clear();
    // A camera that turns sees everything move.
    if (!slot.frame.valid || slot.frame.info.place) return;
    slot.difference.find(slot.frame.image, slot.frame.info.capture, slot.motion);
  });
  const auto showing = std::count_if(slots_.begin(), slots_.end(),
                                     [](const Slot& slot) { return !slot.motion.empty(); });
  return static_cast<size_t>(showing) >= needed();
}

bool DetectorFrames::moves_at(const Eigen::Vector3d& point, double radius) const {
  size_t showing = 0;
  for (size_t i = 0; i < slots_.size(); ++i) {
    if (slots_[i].motion.empty()) continue;
    const CalibratedCamera& camera = cameras_[i].calibration;
    const Eigen::Vector3d there = camera.world_from_camera.inverse() * point;
    const auto pixel = camera.model.project(there);
    const HalfSizeImage& image = slots_[i].frame.image;
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() >= 2 * image.width ||
        pixel->y() >= 2 * image.height)
      continue;
    const auto reach = static_cast<int>(radius * camera.model.parameters().fx / (2 * there.norm()));
    const auto x = static_cast<int>(pixel->x() / 2), y = static_cast<int>(pixel->y() / 2);
    showing += any_in(slots_[i].motion, image.width, image.height,
                      {x - reach, y - reach, x + reach + 1, y + reach + 1});
  }
  return showing >= needed();
}

bool DetectorFrames::select(Where where) {
  active_.clear();
  newest_ = Time{};
  for (const Slot& slot : slots_) {
    if (slot.frame.valid) newest_ = std::max(newest_, slot.frame.info.capture);
  }
  for (size_t i = 0; i < slots_.size(); ++i) {
    const HalfSizeFrame& frame = slots_[i].frame;
    if (frame.valid && newest_ - frame.info.capture <= max_age_) active_.push_back(i);
  }
  work_.images += active_.size();
  edges_.resize(active_.size());
  borders_.resize(active_.size());
  masks_.resize(active_.size());
  search_cameras_.resize(active_.size());
  fit_cameras_.resize(active_.size());
  executor_(active_.size(), [&](size_t i) { prepare(i, where); });
  set_reference(newest_);
  return !active_.empty();
}

bool DetectorFrames::shows(size_t i, Where where) const {
  if (where == Where::kMotion) return !masks_[i].empty();
  return where == Where::kEverywhere || foreground(i) == nullptr || foreground(i)->share > 0;
}

void DetectorFrames::prepare(size_t i, Where where) {
  const CalibratedCamera& camera = cameras_[active_[i]].calibration;
  const HalfSizeImage& image = slots_[active_[i]].frame.image;
  edges_[i].compute(image);
  masks_[i].clear();
  if (where == Where::kForeground && foreground(i) != nullptr) {
    dilate_foreground(*foreground(i), masks_[i]);
  } else if (where == Where::kMotion) {
    masks_[i] = slots_[active_[i]].motion;
  }
  if (!masks_[i].empty()) edges_[i].keep_where(masks_[i]);
  SearchCamera& search = search_cameras_[i];
  search.camera = &camera;
  search.camera_from_world = camera.world_from_camera.inverse();
  search.usual_speed = usual_speed_;
  fit_cameras_[i] = {&camera, search.camera_from_world, &image, &edges_[i], 0, foreground(i)};
  Slot& slot = slots_[active_[i]];
  if (slot.reduced) {
    slot.reduced->show(fit_cameras_[i], masks_[i]);
    fit_cameras_[i].reduced = slot.reduced.get();
  }
  if (!slot.magnified) return;
  slot.magnified->show(fit_cameras_[i], slot.frame, masks_[i]);
  fit_cameras_[i].magnified = slot.magnified.get();
}

void DetectorFrames::compute_responses(int margin, Edges edges) {
  executor_(active_.size(), [&](size_t i) {
    if (edges == Edges::kBorders) borders_[i].compute(image(i), edges_[i]);
    // Some of many poses will ask for it; there each camera has a thread.
    if (edges == Edges::kBorders && fit_cameras_[i].magnified != nullptr) {
      (void)fit_cameras_[i].magnified->camera();
    }
    search_cameras_[i].respond_to(
        edges_[i], edges == Edges::kBorders ? borders_[i].bins() : edges_[i].bins(), margin);
  });
}

void DetectorFrames::magnify_about(std::span<const RigMotion> motions,
                                   const ViewpointModel& object) {
  for (size_t i = 0; i < active_.size(); ++i) {
    MagnifiedLook* look = slots_[active_[i]].magnified.get();
    if (look == nullptr) continue;
    const FitCamera& camera = fit_cameras_[i];
    Eigen::AlignedBox2d box;
    for (const RigMotion& motion : motions) {
      const Eigen::Vector3d center =
          camera.camera_from_world * (motion.at(camera.seconds) * object.center());
      const auto pixel = camera.camera->model.project(center);
      if (!pixel) continue;
      const double reach =
          kMagnifiedReach * object.radius() * camera.camera->model.parameters().fx / center.norm() +
          2 * kSearchReach;
      const Eigen::Vector2d around = Eigen::Vector2d::Constant(reach);
      box.extend(Eigen::AlignedBox2d(*pixel - around, *pixel + around));
    }
    // Far off the image there is nothing to be seen either.
    const auto whole = [](double value) {
      return static_cast<int>(std::lround(std::clamp(value, -1e6, 1e6)));
    };
    look->set_box(box.isEmpty() ? PixelBox{}
                                : PixelBox{whole(box.min().x()), whole(box.min().y()),
                                           whole(box.max().x()), whole(box.max().y())});
  }
}

void DetectorFrames::set_reference(Time reference) {
  for (size_t i = 0; i < active_.size(); ++i) {
    fit_cameras_[i].seconds = to_seconds(info(i).capture - reference);
    if (MagnifiedLook* look = slots_[active_[i]].magnified.get()) {
      look->set_seconds(fit_cameras_[i].seconds);
    }
    if (ReducedLook* look = slots_[active_[i]].reduced.get()) {
      look->set_seconds(fit_cameras_[i].seconds);
    }
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

SearchWork DetectorFrames::work() const {
  SearchWork out = work_;
  for (const Slot& slot : slots_) {
    if (slot.magnified) out.images += slot.magnified->images();
    if (slot.reduced) out.images += slot.reduced->images();
  }
  return out;
}

bool DetectorFrames::show_colors() const {
  return std::ranges::any_of(fit_cameras_,
                             [](const FitCamera& camera) { return camera.image->in_color; });
}

}  // namespace sightline::observe
