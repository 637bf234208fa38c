// SPDX-License-Identifier: Apache-2.0
#include "start_argument.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "pose_argument.hpp"

namespace sightline::cli {
namespace {

template <typename List, typename NameOf>
Result<uint32_t> find_name(const List& list, const std::string& name, const char* what,
                           const std::string& where, NameOf name_of) {
  std::vector<std::string> known;
  for (const auto& entry : list) {
    if (name_of(entry) == name) return static_cast<uint32_t>(known.size());
    known.push_back(name_of(entry));
  }
  return make_error(ErrorCode::kInvalidInput, where, "there is no {} \"{}\"; known: {}", what, name,
                    fmt::join(known, ", "));
}

Result<ImageHint> parse_place(const std::string& camera, const std::vector<double>& numbers,
                              const Installation& installation, const std::string& where) {
  SL_ASSIGN(const uint32_t index, find_name(installation.cameras, camera, "camera", where,
                                            [](const CameraConfig& c) { return c.name; }));
  ImageHint out;
  out.camera = CameraId(index);
  if (numbers.size() < 2 || numbers.size() > 3) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "a place is CAMERA:x,y or CAMERA:x,y,radius");
  }
  out.pixel = {numbers[0], numbers[1]};
  if (numbers.size() == 3) out.radius_px = numbers[2];
  const CameraModel& lens = installation.cameras[index].calibration.model;
  if (!lens.contains(out.pixel)) {
    return make_error(ErrorCode::kInvalidInput, where, "({}, {}) is not in the image of {}, {}x{}",
                      numbers[0], numbers[1], camera, lens.width(), lens.height());
  }
  if (!(out.radius_px > 0)) {
    return make_error(ErrorCode::kInvalidInput, where, "the radius must be positive [px]");
  }
  return out;
}

}  // namespace

Result<StartArgument> parse_start(const std::string& argument, const Installation& installation,
                                  const std::string& option) {
  const std::string where = fmt::format("{} {}", option, argument);
  const size_t equals = argument.find('=');
  const size_t colon = argument.find(':', equals == std::string::npos ? 0 : equals);
  const bool in_image = colon != std::string::npos;
  const size_t from = in_image ? colon : equals;
  const auto numbers = equals == std::string::npos
                           ? std::nullopt
                           : parse_numbers(std::string_view(argument).substr(from + 1));
  if (!numbers) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "is neither NAME=CAMERA:x,y[,radius] nor NAME=tx,ty,tz,qw,qx,qy,qz");
  }
  SL_ASSIGN(const uint32_t object,
            find_name(installation.objects, argument.substr(0, equals), "object", where,
                      [](const ObjectConfig& o) { return o.description.name; }));
  if (in_image) {
    const std::string camera = argument.substr(equals + 1, colon - equals - 1);
    SL_ASSIGN(const ImageHint hint, parse_place(camera, *numbers, installation, where));
    return StartArgument{ObjectId(object), hint};
  }
  SL_ASSIGN(const Rigid3 pose, parse_pose(*numbers, where));
  return StartArgument{ObjectId(object), pose};
}

}  // namespace sightline::cli
