// SPDX-License-Identifier: Apache-2.0
#include "observe/track/exposed_frames.hpp"

namespace sightline::observe {

ExposedFrames::ExposedFrames(int width, int height)
    : pool_(std::make_shared<ImagePool>(width, height)) {}

const Frame& ExposedFrames::show(const Frame& frame) {
  gain_ = exposure_.update(frame.gray());
  if (gain_ == 1) return frame;
  shown_ = exposed(frame);
  return *shown_;
}

FramePtr ExposedFrames::show_like(const FramePtr& frame) {
  return gain_ == 1 ? frame : exposed(*frame);
}

FramePtr ExposedFrames::exposed(const Frame& frame) {
  auto image = pool_->get();
  const I420View from = frame.i420();
  const MutableI420View to = image->mutable_view();
  expose_luma(gain_, from.y, to.y);
  expose_color(gain_, from.u, to.u);
  expose_color(gain_, from.v, to.v);
  return Frame::decoded(frame.info(), std::move(image), {}, pool_);
}

}  // namespace sightline::observe
