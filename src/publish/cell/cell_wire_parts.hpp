// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cell.pb.h>

#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

/// What all messages have in common.
namespace sightline::publish {

Error refuse(std::string_view what);

/// A whole message of this version.
template <typename Message>
Result<Message> parse(std::string_view bytes) {
  Message message;
  if (bytes.size() > kMostCellBytes) return refuse("is too long");
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return refuse("is not of this format");
  }
  if (message.version() != kCellVersion) return refuse("is of another version");
  return message;
}

bool is_utc(int64_t ns);
void put(const Rigid3& pose, cell::v1::Pose& out);
Result<Rigid3> pose_of(const cell::v1::Pose& in);

}  // namespace sightline::publish
