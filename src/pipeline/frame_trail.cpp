// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/frame_trail.hpp"

#include <algorithm>

namespace sightline {
namespace {

// Every second frame goes, from the second one on: the oldest is where the search stands.
void drop_every_second(std::deque<FramePtr>& frames) {
  std::deque<FramePtr> kept;
  for (size_t i = 0; i < frames.size(); i += 2) kept.push_back(std::move(frames[i]));
  frames = std::move(kept);
}

}  // namespace

FrameTrail::FrameTrail(size_t cameras, size_t max_frames)
    : max_frames_(std::max<size_t>(2, max_frames)), cameras_(cameras) {}

void FrameTrail::open() {
  std::lock_guard lock(mutex_);
  open_ = true;
  for (Camera& camera : cameras_) {
    camera.frames.clear();
    camera.skip = camera.skipped = 0;
  }
}

void FrameTrail::close() {
  std::lock_guard lock(mutex_);
  open_ = false;
  for (Camera& camera : cameras_) camera.frames.clear();
}

std::shared_ptr<ImagePool> FrameTrail::pool_of(Camera& camera, const FrameInfo& info) const {
  if (!camera.pool || camera.width != info.width || camera.height != info.height) {
    camera.pool = std::make_shared<ImagePool>(info.width, info.height, max_frames_ + 2);
    camera.width = info.width;
    camera.height = info.height;
    camera.frames.clear();
  }
  return camera.pool;
}

void FrameTrail::push(CameraId camera, const Frame& frame) {
  if (frame.info().status == FrameStatus::kDamaged || camera.index() >= cameras_.size()) return;
  std::shared_ptr<ImagePool> pool;
  {
    std::lock_guard lock(mutex_);
    Camera& to = cameras_[camera.index()];
    if (!open_ || to.skipped < to.skip) {
      ++to.skipped;
      return;
    }
    to.skipped = 0;
    pool = pool_of(to, frame.info());
  }
  FramePtr copy = frame.copy_for(camera, std::move(pool));
  std::lock_guard lock(mutex_);
  if (!open_) return;
  Camera& to = cameras_[camera.index()];
  to.frames.push_back(std::move(copy));
  if (to.frames.size() < max_frames_) return;
  drop_every_second(to.frames);
  to.skip = 2 * to.skip + 1;
}

std::vector<FramePtr> FrameTrail::take_until(Time time) {
  std::vector<FramePtr> out;
  std::lock_guard lock(mutex_);
  for (Camera& camera : cameras_) {
    FramePtr newest;
    while (!camera.frames.empty() && camera.frames.front()->info().capture <= time) {
      newest = std::move(camera.frames.front());
      camera.frames.pop_front();
    }
    if (newest) out.push_back(std::move(newest));
  }
  return out;
}

Time FrameTrail::newest() const {
  Time newest = Time::min();
  std::lock_guard lock(mutex_);
  for (const Camera& camera : cameras_) {
    if (!camera.frames.empty()) newest = std::max(newest, camera.frames.back()->info().capture);
  }
  return newest;
}

}  // namespace sightline
