// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/half_size_frame.hpp"

#include <algorithm>
#include <cmath>

#include "observe/terms/image_colors.hpp"
#include "sightline/base/check.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::observe {
namespace {

// `width` x `height` means of squares of so many pixels.
void shrink_into(const PlaneView& from, int shrink, int width, int height,
                 std::vector<uint8_t>& to) {
  to.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  shrink_plane({from.data, width * shrink, height * shrink, from.stride}, shrink,
               {to.data(), width, height, width});
}

MutablePlaneView as_plane(std::vector<uint8_t>& bytes, int width, int height) {
  return {bytes.data(), width, height, width};
}

// Each pixel of a plane of half that size four times, within a box.
void repeat_plane(const PlaneView& from, int width, const PixelBox& box, std::vector<uint8_t>& to) {
  for (int y = box.top; y < box.bottom; ++y) {
    const uint8_t* row = from.row(std::min(y / 2, from.height - 1));
    uint8_t* out = to.data() + static_cast<size_t>(y) * static_cast<size_t>(width);
    for (int x = box.left; x < box.right; ++x) out[x] = row[std::min(x / 2, from.width - 1)];
  }
}

}  // namespace

std::optional<CalibratedCamera> scaled(CalibratedCamera camera, int width, int height,
                                       double factor) {
  CameraModel::Parameters lens = camera.model.parameters();
  lens.width = width;
  lens.height = height;
  lens.fx *= factor;
  lens.fy *= factor;
  lens.cx = factor * (lens.cx + 0.5) - 0.5;  // (0, 0) is the center of a pixel
  lens.cy = factor * (lens.cy + 0.5) - 0.5;
  camera.rms_px *= factor;
  const auto model = CameraModel::create(lens, camera.name);
  if (!model) return std::nullopt;
  camera.model = *model;
  return camera;
}

bool HalfSizeFrame::can_store(const Frame& frame, int width, int height) {
  const FrameInfo& info = frame.info();
  return info.status != FrameStatus::kDamaged && info.width == width && info.height == height;
}

void HalfSizeFrame::store(const Frame& frame, const CameraModel& camera, int shrink,
                          bool keep_full_luma) {
  SL_CHECK(camera.width() * shrink <= frame.info().width &&
               camera.height() * shrink <= frame.info().height,
           "the frame is smaller than what is searched");
  info = frame.info();
  width = camera.width();
  height = camera.height();
  const I420View full = frame.i420();
  image.width = width / 2;
  image.height = height / 2;
  const std::array<PlaneView, 3> half = {frame.half_gray(), full.u, full.v};
  for (size_t i = 0; i < half.size(); ++i) {
    shrink_into(half[i], shrink, image.width, image.height, image.planes[i]);
  }
  full_luma.clear();
  if (keep_full_luma) shrink_into(frame.gray(), shrink, width, height, full_luma);
  expose(exposure.update(image.view(0)));
  smooth();
  image.in_color = has_colors(image.view(1), image.view(2));
  valid = true;
}

void HalfSizeFrame::expose(double gain) {
  if (gain == 1) return;
  const int w = image.width, h = image.height;
  expose_luma(gain, image.view(0), as_plane(image.planes[0], w, h));
  expose_color(gain, image.view(1), as_plane(image.planes[1], w, h));
  expose_color(gain, image.view(2), as_plane(image.planes[2], w, h));
  if (full_luma.empty()) return;
  expose_luma(gain, {full_luma.data(), width, height, width}, as_plane(full_luma, width, height));
}

void HalfSizeFrame::smooth() {
  for (size_t i = 0; i < image.planes.size(); ++i) {
    const int passes = smoothing[i].update(image.view(i));
    filter.smooth(as_plane(image.planes[i], image.width, image.height), passes);
    if (i == 0) image.sharpness = BinomialFilter::sharpness(passes);
    // Pixels of half the size: the same blur takes four times as many passes.
    if (i == 0 && !full_luma.empty()) {
      filter.smooth(as_plane(full_luma, width, height), 4 * passes);
    }
  }
}

void HalfSizeFrame::magnify(HalfSizeImage& to, const PixelBox& box) const {
  to.width = width;
  to.height = height;
  to.in_color = image.in_color;
  to.sharpness = image.sharpness;
  for (std::vector<uint8_t>& plane : to.planes) plane.resize(full_luma.size());
  for (int y = box.top; y < box.bottom; ++y) {
    const auto row = static_cast<ptrdiff_t>(y) * to.width;
    std::copy(full_luma.begin() + row + box.left, full_luma.begin() + row + box.right,
              to.planes[0].begin() + row + box.left);
  }
  for (size_t plane = 1; plane < 3; ++plane) {
    repeat_plane(image.view(plane), to.width, box, to.planes[plane]);
  }
}

std::optional<CalibratedCamera> magnified(CalibratedCamera camera) {
  const CameraModel::Parameters& lens = camera.model.parameters();
  return scaled(std::move(camera), 2 * lens.width, 2 * lens.height, 2);
}

std::optional<CalibratedCamera> reduced(CalibratedCamera camera) {
  const CameraModel::Parameters& lens = camera.model.parameters();
  return scaled(std::move(camera), lens.width / 2, lens.height / 2, 0.5);
}

void reduce(const HalfSizeImage& from, HalfSizeImage& to) {
  to.width = from.width / 2;
  to.height = from.height / 2;
  to.in_color = from.in_color;
  to.sharpness = std::sqrt(from.sharpness);  // a blur of half as many pixels
  for (size_t plane = 0; plane < from.planes.size(); ++plane) {
    shrink_into(from.view(plane), 2, to.width, to.height, to.planes[plane]);
  }
}

}  // namespace sightline::observe
