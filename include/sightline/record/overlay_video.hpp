// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

struct OverlayVideoOptions {
  int width = 0;
  int height = 0;
  double rate_hz = 30;  ///< nominal, for players
};

/// One video for people to look at (`sightline replay --overlay`): H.264 where this libavcodec has
/// x264, else MPEG-4, in Matroska, encoded in the calling thread. Not thread-safe.
class OverlayVideoWriter {
 public:
  /// Replaces a file that exists.
  static Result<std::unique_ptr<OverlayVideoWriter>> create(const std::filesystem::path& path,
                                                            const OverlayVideoOptions& options);
  virtual ~OverlayVideoWriter() = default;  ///< close()s, ignoring errors

  /// Appends an image of the size given to create(). `capture` must grow; shown at 1 ms.
  virtual Status append(const I420View& image, Time capture) = 0;
  virtual Status close() = 0;
};

/// Writes one image as PNG (24-bit RGB), replacing the file whole.
Status write_png(const std::filesystem::path& path, const I420View& image);

}  // namespace sightline
