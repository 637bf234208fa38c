// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "record/replay_camera.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

using namespace record;

namespace {

class VirtualReplayOfFiles final : public VirtualReplay {
 public:
  VirtualReplayOfFiles(std::vector<std::unique_ptr<ReplayCamera>> cameras,
                       std::vector<Duration> time_offsets)
      : cameras_(std::move(cameras)), time_offsets_(std::move(time_offsets)) {
    time_offsets_.resize(cameras_.size());
  }

  Result<std::optional<std::vector<FramePtr>>> next() override {
    std::optional<Time> earliest;
    for (size_t i = 0; i < cameras_.size(); ++i) {
      const auto capture = capture_of(i);
      if (capture && (!earliest || *capture < *earliest)) earliest = capture;
    }
    if (!earliest) return std::optional<std::vector<FramePtr>>();
    std::vector<FramePtr> set;
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (capture_of(i) != earliest) continue;
      const auto row = cameras_[i]->row();
      SL_ASSIGN(const FramePtr frame, cameras_[i]->take(*row));
      set.push_back(Frame::with_time_offset(frame, time_offsets_[i]));
    }
    return std::optional(std::move(set));
  }

 private:
  std::optional<Time> capture_of(size_t camera) const {
    const auto& row = cameras_[camera]->row();
    if (!row) return std::nullopt;
    return row->capture + time_offsets_[camera];
  }

  std::vector<std::unique_ptr<ReplayCamera>> cameras_;
  std::vector<Duration> time_offsets_;
};

}  // namespace

Result<std::unique_ptr<VirtualReplay>> VirtualReplay::open(
    std::shared_ptr<const Recording> recording, const VideoReaderOptions& options,
    std::vector<Duration> time_offsets, AxisHistories axes) {
  std::vector<std::unique_ptr<ReplayCamera>> cameras;
  time_offsets.resize(recording->cameras.size());
  axes.resize(recording->cameras.size());
  for (size_t i = 0; i < recording->cameras.size(); ++i) {
    SL_ASSIGN(auto camera,
              ReplayCamera::open(recording, i, CameraId(static_cast<uint32_t>(i)),
                                 ReplayCameraOptions{options, 0, axes[i], time_offsets[i]}));
    cameras.push_back(std::move(camera));
  }
  return std::unique_ptr<VirtualReplay>(
      std::make_unique<VirtualReplayOfFiles>(std::move(cameras), std::move(time_offsets)));
}

}  // namespace sightline
