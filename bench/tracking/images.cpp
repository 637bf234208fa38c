// SPDX-License-Identifier: Apache-2.0
#include "images.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "sightline/image/convert.hpp"
#include "sightline/record/overlay_video.hpp"

namespace sightline::bench {
namespace {

constexpr size_t kColumns = 4, kRows = 3;

/// 2x2 pixels to one, every plane.
void halve_into(const I420View& from, const MutableI420View& to, int x, int y) {
  const auto plane = [](const PlaneView& a, const MutablePlaneView& b, int left, int top) {
    for (int row = 0; row < a.height / 2; ++row) {
      const uint8_t *upper = a.row(2 * row), *lower = a.row(2 * row + 1);
      uint8_t* out = b.row(top + row) + left;
      for (int i = 0; i < a.width / 2; ++i) {
        out[i] = static_cast<uint8_t>(
            (upper[2 * i] + upper[2 * i + 1] + lower[2 * i] + lower[2 * i + 1] + 2) / 4);
      }
    }
  };
  plane(from.y, to.y, x, y);
  plane(from.u, to.u, x / 2, y / 2);
  plane(from.v, to.v, x / 2, y / 2);
}

void fill(const MutableI420View& image, int x0, int y0, int x1, int y1, Rgb color) {
  const Yuv c = to_yuv(color);
  for (int y = std::max(0, y0); y < std::min(image.height(), y1); ++y) {
    for (int x = std::max(0, x0); x < std::min(image.width(), x1); ++x) {
      image.y.row(y)[x] = c.y;
      image.u.row(y / 2)[x / 2] = c.u;
      image.v.row(y / 2)[x / 2] = c.v;
    }
  }
}

Rgb color_of(TrackState state) {
  switch (state) {
    case TrackState::kTracking:
      return {0, 150, 40};
    case TrackState::kDegraded:
      return {200, 170, 0};
    case TrackState::kCoasting:
      return {240, 110, 0};
    default:
      return {210, 0, 0};
  }
}

}  // namespace

Result<std::unique_ptr<Images>> Images::create(const Installation& installation, const Rig& rig,
                                               size_t shots) {
  auto images = std::make_unique<Images>();
  if (shots == 0) return images;
  SL_ASSIGN(images->renderer_, make_renderer(installation, rig, CameraId(0)));
  const CameraModel& camera = installation.cameras[0].calibration.model;
  images->sheet_ = std::make_unique<Image>(static_cast<int>(kColumns) * camera.width() / 2,
                                           static_cast<int>(kRows) * camera.height() / 2);
  const size_t own = shots / installation.cameras.size();
  images->every_ = std::max<size_t>(1, own / (kColumns * kRows));
  return images;
}

Status Images::show(const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  if (!renderer_ || frame.info().camera != CameraId(0)) return {};
  const size_t index = seen_++;
  if (index % every_ != every_ - 1 || placed_ == kColumns * kRows) return {};
  Image image(frame.info().width, frame.info().height);
  copy_i420(frame.i420(), image.mutable_view());
  std::vector<PoseAt> poses;
  renderer_->draw(image.mutable_view(), frame.info().capture, tracks, poses);
  const int column = static_cast<int>(placed_ % kColumns),
            row = static_cast<int>(placed_ / kColumns);
  halve_into(image.view(), sheet_->mutable_view(), column * image.width() / 2,
             row * image.height() / 2);
  ++placed_;
  return {};
}

Status Images::write(const std::filesystem::path& path) const {
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  return sheet_ ? write_png(path, sheet_->view()) : Status();
}

Status write_error_plot(const std::filesystem::path& path, std::span<const Sample> samples) {
  constexpr int kWidth = 900, kHalf = 240, kMargin = 12;
  constexpr double kLow = 0.01, kHigh = 100;
  Image plot(kWidth, 2 * kHalf);
  const MutableI420View view = plot.mutable_view();
  fill(view, 0, 0, kWidth, 2 * kHalf, {255, 255, 255});
  const auto height_of = [&](double value) {
    const double share = std::log(std::clamp(value, kLow, kHigh) / kLow) / std::log(kHigh / kLow);
    return kHalf - kMargin - static_cast<int>(share * (kHalf - 2 * kMargin));
  };
  for (const int top : {0, kHalf}) {
    for (double value = kLow; value <= 1.01 * kHigh; value *= 10) {
      const int y = top + height_of(value);
      fill(view, kMargin, y, kWidth - kMargin, y + 1, {190, 190, 200});
    }
  }
  const double step = static_cast<double>(kWidth - 2 * kMargin) /
                      static_cast<double>(std::max<size_t>(samples.size(), 1));
  for (size_t i = 0; i < samples.size(); ++i) {
    const Sample& s = samples[i];
    const int x = kMargin + static_cast<int>(step * static_cast<double>(i));
    const int end = std::max(x + 2, kMargin + static_cast<int>(step * static_cast<double>(i + 1)));
    for (const auto& [top, value] : {std::pair{0, s.mm}, std::pair{kHalf, s.deg}}) {
      if (s.visible < 0.5) fill(view, x, top + kHalf - 10, end, top + kHalf - 5, {150, 150, 150});
      if (has_pose(s.state)) {
        const int y = top + height_of(value);
        fill(view, x, y - 2, x + 4, y + 2, color_of(s.state));
      } else {
        fill(view, x, top + 2, end, top + 8, color_of(s.state));
      }
    }
  }
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  return write_png(path, plot.view());
}

}  // namespace sightline::bench
