// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_configure.hpp"

#include <libcamera/stream.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "capture/libcamera/libcamera_error.hpp"
#include "capture/libcamera/libcamera_formats.hpp"

namespace sightline::capture {
namespace {

using libcamera::StreamConfiguration;
using libcamera::StreamRole;

constexpr int kMinBuffers = 4, kMaxBuffers = 16;

std::vector<const FourccFormat*> formats_of(const StreamConfiguration& stream) {
  std::vector<const FourccFormat*> formats;
  for (const auto& pixels : stream.formats().pixelformats()) {
    const FourccFormat* const format = find_libcamera_format(pixels.toString());
    if (format != nullptr && format->kind != FormatKind::kH264) formats.push_back(format);
  }
  return formats;
}

libcamera::PixelFormat pixels_of(const StreamConfiguration& stream, const FourccFormat* format) {
  for (const auto& pixels : stream.formats().pixelformats()) {
    if (find_libcamera_format(pixels.toString()) == format) return pixels;
  }
  return {};
}

bool has_size(const StreamConfiguration& stream, const FourccFormat* format,
              const libcamera::Size& size) {
  const auto pixels = pixels_of(stream, format);
  const auto sizes = stream.formats().sizes(pixels);
  return sizes.empty() || std::find(sizes.begin(), sizes.end(), size) != sizes.end() ||
         stream.formats().range(pixels).contains(size);
}

std::string list_of(const StreamConfiguration& stream) {
  std::string text;
  for (const auto& pixels : stream.formats().pixelformats()) {
    const FourccFormat* const format = find_libcamera_format(pixels.toString());
    const std::string name = format != nullptr ? std::string(format->name) : pixels.toString();
    for (const auto& size : stream.formats().sizes(pixels)) {
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, size.toString());
    }
  }
  return text.empty() ? "nothing" : text;
}

bool is_automatic(const LibcameraOptions& options) {
  return options.format.empty() || options.format == "auto";
}

// Sets format and size in the camera's own proposal.
Result<const FourccFormat*> choose(const LibcameraOptions& options, const FourccFormat* named,
                                   const libcamera::Camera& camera, StreamConfiguration& stream,
                                   const std::string& where) {
  if (options.width > 0 && options.height > 0) {
    stream.size = {static_cast<unsigned>(options.width), static_cast<unsigned>(options.height)};
  }
  const auto offered = formats_of(stream);
  for (const FourccFormat& format : fourcc_formats()) {
    if (!is_automatic(options) && &format != named) continue;
    if (std::find(offered.begin(), offered.end(), &format) == offered.end()) continue;
    if (!has_size(stream, &format, stream.size)) continue;
    stream.pixelFormat = pixels_of(stream, &format);
    return &format;
  }
  return make_error(ErrorCode::kInvalidInput, where, "{} has no {} {}; it has: {}", camera.id(),
                    is_automatic(options) ? "usable format for" : options.format,
                    stream.size.toString(), list_of(stream));
}

}  // namespace

Result<LibcameraConfiguration> configure_libcamera(libcamera::Camera& camera,
                                                   const LibcameraOptions& options,
                                                   const std::string& where) {
  const FourccFormat* const named =
      is_automatic(options) ? nullptr : find_libcamera_format(options.format);
  const bool raw = named != nullptr && named->kind == FormatKind::kBayer;
  LibcameraConfiguration result;
  result.configuration =
      camera.generateConfiguration({raw ? StreamRole::Raw : StreamRole::VideoRecording});
  if (!result.configuration || result.configuration->empty()) {
    return make_error(ErrorCode::kInvalidInput, where, "{} offers no {} images", camera.id(),
                      raw ? "raw" : "video");
  }
  StreamConfiguration& stream = result.configuration->at(0);
  SL_ASSIGN(const FourccFormat* format, choose(options, named, camera, stream, where));
  const auto asked_size = stream.size;
  const auto asked_pixels = stream.pixelFormat;
  stream.bufferCount = static_cast<unsigned>(std::clamp(options.buffers, kMinBuffers, kMaxBuffers));
  // What the camera makes of the choice must be the choice.
  const auto status = result.configuration->validate();
  if (status == libcamera::CameraConfiguration::Invalid || stream.size != asked_size ||
      stream.pixelFormat != asked_pixels) {
    return make_error(ErrorCode::kInvalidInput, where, "{} gives {} when asked for {} {}",
                      camera.id(), stream.toString(), format->name, asked_size.toString());
  }
  if (const int r = camera.configure(result.configuration.get()); r < 0) {
    return libcamera_error("configure", camera.id(), r, where);
  }
  SL_ASSIGN(result.stream, stream_format(*format, static_cast<int>(stream.size.width),
                                         static_cast<int>(stream.size.height),
                                         static_cast<ptrdiff_t>(stream.stride)));
  return result;
}

}  // namespace sightline::capture
