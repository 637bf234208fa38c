// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/camera.h>

#include <memory>
#include <string>

#include "capture/decode/stream_format.hpp"
#include "sightline/base/result.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"

namespace sightline::capture {

struct LibcameraConfiguration {
  std::unique_ptr<libcamera::CameraConfiguration> configuration;  ///< with one stream
  StreamFormat stream;
};

/// Sets format and size of an acquired camera, which must be what the options ask for; "auto" is
/// the first format in the order of fourcc_formats() that the camera has. kInvalidInput: it has
/// not, with a list of what it has.
Result<LibcameraConfiguration> configure_libcamera(libcamera::Camera& camera,
                                                   const LibcameraOptions& options,
                                                   const std::string& where);

}  // namespace sightline::capture
