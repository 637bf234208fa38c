// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/config/installation.hpp"
#include "sightline/observe/detect/search_hint.hpp"

namespace sightline::cli {

/// Where an object is at the start, as the command line says it.
struct StartArgument {
  ObjectId object;
  SearchHint hint;
};

/// "NAME=CAMERA:x,y[,radius]": its middle is so near to that pixel (60 px, where nothing is said);
/// "NAME=tx,ty,tz,qw,qx,qy,qz" or "NAME=rvec,tvec": its pose in the world. `option` stands in
/// errors; refused: unknown names, numbers that are none, pixels out of the image.
Result<StartArgument> parse_start(const std::string& argument, const Installation& installation,
                                  const std::string& option);

}  // namespace sightline::cli
