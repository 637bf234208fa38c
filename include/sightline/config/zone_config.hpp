// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "sightline/geometry/box3.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline {

/// A part of the world: that an object comes into it, and goes, is told, and may be recorded.
struct ZoneConfig {
  std::string name;
  Box3 box{};                         ///< world frame
  std::vector<std::string> objects;   ///< by name; empty: any
  std::vector<RecordingKind> record;  ///< what begins when one comes in

  bool watches(const std::string& object) const {
    return objects.empty() || std::ranges::find(objects, object) != objects.end();
  }
  bool operator==(const ZoneConfig&) const = default;
};

}  // namespace sightline
