// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "sightline/image/planes.hpp"

namespace sightline {

/// "NAME: no signal since HH:MM:SS UTC"
std::string no_signal_text(std::string_view name, int64_t since_utc_ns);

/// What a stream shows while its camera is away: the last image without color and dimmed, or
/// plain gray, with a text across the middle. One thread at a time.
class NoSignalSlate {
 public:
  /// For images of this size. Without a readable font (said once in the log) the text is left
  /// out: a stream must stay up. An empty path means DejaVu Sans of the system.
  static std::unique_ptr<NoSignalSlate> create(int width, int height,
                                               const std::filesystem::path& font_file);
  ~NoSignalSlate();
  NoSignalSlate(const NoSignalSlate&) = delete;
  NoSignalSlate& operator=(const NoSignalSlate&) = delete;

  /// Fills `image`. `last`, if given, has the same size; it may be the image itself. A text
  /// that is wider than the image is broken after the first ": ".
  void draw(const MutableI420View& image, const I420View* last, std::string_view text);

 private:
  struct Impl;
  explicit NoSignalSlate(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
