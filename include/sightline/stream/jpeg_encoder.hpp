// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// Images as JPEG, straight from their planes (libjpeg-turbo). Keeps its memory from image to
/// image. One thread at a time.
class JpegEncoder {
 public:
  /// `quality`: 1 (small) to 100.
  static Result<std::unique_ptr<JpegEncoder>> create(int quality);
  ~JpegEncoder();
  JpegEncoder(const JpegEncoder&) = delete;
  JpegEncoder& operator=(const JpegEncoder&) = delete;

  /// A BT.601 image of limited range as a 4:2:0 JPEG file (which has full range) of the same size.
  Result<std::string> encode(const I420View& image);

 private:
  struct Impl;
  explicit JpegEncoder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
