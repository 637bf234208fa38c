// SPDX-License-Identifier: Apache-2.0
#include "shot_store.hpp"

#include <fstream>

#include "sightline/base/files.hpp"

namespace sightline::bench {
namespace {

size_t bytes_of(const test::SceneRigOptions& options) {
  const auto w = static_cast<size_t>(options.lens.width),
             h = static_cast<size_t>(options.lens.height);
  return w * h + 2 * ((w + 1) / 2) * ((h + 1) / 2);
}

template <typename View, typename Visit>
void each_row(const View& view, const Visit& visit) {
  for (const auto* plane : {&view.y, &view.u, &view.v}) {
    for (int y = 0; y < plane->height; ++y) visit(plane->row(y), plane->width);
  }
}

}  // namespace

ShotStore::ShotStore(const test::SceneRigOptions& options, std::filesystem::path folder,
                     const std::string& name)
    : options_(options), rig_(std::make_unique<test::SceneRig>(options)) {
  if (folder.empty()) return;
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  file_ = folder / fmt::format("{}_{}_{}.i420", name, options.seed, rig_->shots().size());
  const auto size = std::filesystem::file_size(file_, ignored);
  if (!ignored) stored_ = size / bytes_of(options_);
}

const test::SceneRig& ShotStore::rig() { return *rig_; }

FramePtr ShotStore::shoot(size_t index) {
  const test::SceneShot& shot = rig_->shots()[index];
  if (index < stored_) {
    std::ifstream in(file_, std::ios::binary);
    in.seekg(static_cast<std::streamoff>(index * bytes_of(options_)));
    auto image = std::make_shared<Image>(options_.lens.width, options_.lens.height);
    each_row(image->mutable_view(),
             [&](uint8_t* row, int width) { in.read(reinterpret_cast<char*>(row), width); });
    if (in) return Frame::decoded(rig_->info_of(shot), std::move(image));
  }
  FramePtr frame = rig_->shoot(shot);
  if (!file_.empty() && index == stored_) {
    std::ofstream out(file_, std::ios::binary | std::ios::app);
    each_row(frame->i420(), [&](const uint8_t* row, int width) {
      out.write(reinterpret_cast<const char*>(row), width);
    });
    ++stored_;
  }
  return frame;
}

}  // namespace sightline::bench
