// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "record/replay_camera.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {

using namespace record;

namespace {

class VirtualReplayOfFiles final : public VirtualReplay {
 public:
  explicit VirtualReplayOfFiles(std::vector<std::unique_ptr<ReplayCamera>> cameras)
      : cameras_(std::move(cameras)) {}

  Result<std::optional<std::vector<FramePtr>>> next() override {
    std::optional<Time> earliest;
    for (const auto& camera : cameras_) {
      const auto& row = camera->row();
      if (row && (!earliest || row->capture < *earliest)) earliest = row->capture;
    }
    if (!earliest) return std::optional<std::vector<FramePtr>>();
    std::vector<FramePtr> set;
    for (const auto& camera : cameras_) {
      const auto row = camera->row();
      if (!row || row->capture != *earliest) continue;
      SL_ASSIGN(FramePtr frame, camera->take(*row));
      set.push_back(std::move(frame));
    }
    return std::optional(std::move(set));
  }

 private:
  std::vector<std::unique_ptr<ReplayCamera>> cameras_;
};

}  // namespace

Result<std::unique_ptr<VirtualReplay>> VirtualReplay::open(
    std::shared_ptr<const Recording> recording, const VideoReaderOptions& options) {
  std::vector<std::unique_ptr<ReplayCamera>> cameras;
  for (size_t i = 0; i < recording->cameras.size(); ++i) {
    SL_ASSIGN(auto camera, ReplayCamera::open(recording, i, CameraId(static_cast<uint32_t>(i)),
                                              ReplayCameraOptions{options, 0}));
    cameras.push_back(std::move(camera));
  }
  return std::unique_ptr<VirtualReplay>(std::make_unique<VirtualReplayOfFiles>(std::move(cameras)));
}

}  // namespace sightline
