// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "record/media/av.hpp"
#include "sightline/image/image.hpp"

extern "C" {
#include <libswscale/swscale.h>
}

namespace sightline::record {

/// Brings decoded pictures of one stream into I420, BT.601 limited range: a copy where they are
/// that already, a bit-exact swscale conversion for other samplings and for full range (JPEG).
class ToImage {
 public:
  Status convert(const AVFrame& frame, Image& image, const std::string& where);

 private:
  Status prepare_scaler(const AVFrame& frame, const std::string& where);

  struct Free {
    void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
  };
  std::unique_ptr<SwsContext, Free> scaler_;
  int scaler_format_ = AV_PIX_FMT_NONE;
  bool scaler_full_range_ = false;
};

/// Planes of a yuv420p frame.
I420View view_of(const AVFrame& frame);

}  // namespace sightline::record
