// SPDX-License-Identifier: Apache-2.0
#include "observe/track/exposed_frames.hpp"

#include <chrono>

#include "observe/terms/exposure.hpp"

namespace sightline::observe {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(200);
constexpr double kAnotherLight = 1.25;  // gain or its inverse, from which it changes

}  // namespace

const Frame& ExposedFrames::show(const Frame& frame) {
  const Time now = frame.info().capture;
  if (!looked_ || now < *looked_ || now - *looked_ >= kLook) {
    const double wanted = exposure_gain(frame.gray(), gain_ > 1);
    const bool other = wanted > kAnotherLight * gain_ || kAnotherLight * wanted < gain_;
    if (!looked_ || other) gain_ = wanted;
    looked_ = now;
  }
  if (gain_ == 1) return frame;
  shown_ = exposed(frame);
  return *shown_;
}

FramePtr ExposedFrames::show_like(const FramePtr& frame) {
  return gain_ == 1 ? frame : exposed(*frame);
}

FramePtr ExposedFrames::exposed(const Frame& frame) {
  const int width = frame.info().width, height = frame.info().height;
  if (!pool_ || width != width_ || height != height_) {
    pool_ = std::make_shared<ImagePool>(width, height);
    width_ = width;
    height_ = height;
  }
  auto image = pool_->get();
  const I420View from = frame.i420();
  const MutableI420View to = image->mutable_view();
  expose_luma(gain_, from.y, to.y);
  expose_color(gain_, from.u, to.u);
  expose_color(gain_, from.v, to.v);
  return Frame::decoded(frame.info(), std::move(image), {}, pool_);
}

}  // namespace sightline::observe
