// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/cell_options.hpp"

namespace sightline {

// Names of objects may hold what separates levels, or stands for several.
std::string topic_level(std::string name) {
  for (char& c : name) {
    if (c == '/' || c == '+' || c == '#') c = '_';
  }
  return name;
}

}  // namespace sightline
