// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "support/scene_rig.hpp"

namespace sightline::bench {

/// The images of one sequence, rendered once: kept in a file where a folder is given (about
/// 0.5 MB an image), so that a second run sees the same without rendering. The file's name holds
/// everything that was asked for; delete the folder after changing the renderer.
class ShotStore {
 public:
  ShotStore(const test::SceneRigOptions& options, std::filesystem::path folder,
            const std::string& name);

  /// Cameras, truth and shots; its images come from shoot().
  const test::SceneRig& rig();
  FramePtr shoot(size_t index);

 private:
  test::SceneRigOptions options_;
  std::filesystem::path file_;
  std::unique_ptr<test::SceneRig> rig_;
  size_t stored_ = 0;
};

}  // namespace sightline::bench
