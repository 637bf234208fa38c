// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_formats.hpp"

#include <fmt/format.h>

namespace sightline::capture {

const FourccFormat* find_libcamera_format(std::string_view name) {
  // DRM names colors from the high byte of a little-endian word down, V4L2 in the order of memory.
  if (name == "RGB888") return find_fourcc_format(std::string_view("BGR24"));
  if (name == "BGR888") return find_fourcc_format(std::string_view("RGB24"));
  if (name == "R8") return find_fourcc_format(std::string_view("GREY"));
  if (name == "R10" || name == "R12" || name == "R16") {
    return find_fourcc_format(fmt::format("Y{}", name.substr(1)));
  }
  constexpr std::string_view kPacked = "_CSI2P";
  if (name.ends_with(kPacked)) {
    return find_fourcc_format(fmt::format("{}P", name.substr(0, name.size() - kPacked.size())));
  }
  return find_fourcc_format(name);
}

}  // namespace sightline::capture
