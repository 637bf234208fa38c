// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace sightline {

/// One way in which a camera can send images.
struct FormatInfo {
  std::string pixel_format;  ///< as the camera's own standard spells it: "YUYV", "BayerRG8"
  int width = 0;             ///< largest, where the camera takes any size up to it
  int height = 0;
  std::vector<double> rates_hz;  ///< ascending; two of them: the ends of a range; empty: unknown
};

/// A camera that is plugged in, as `sightline cameras` lists it.
struct DeviceInfo {
  std::string scheme;  ///< "aravis", "v4l2", "libcamera"
  std::string id;      ///< stable over replugging and reboot; `source = "scheme:id"` opens it
  std::string model;   ///< vendor and model, for a person
  std::string serial;  ///< empty: it has none
  std::string where;   ///< address, USB port or device node, now
  std::vector<FormatInfo> formats;  ///< empty: not asked for, or not told (see note)
  std::string note;                 ///< "controlled by another client", "no permission", or empty
};

}  // namespace sightline
