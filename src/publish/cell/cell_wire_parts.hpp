// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cell.pb.h>

#include <string_view>

#include "publish/cell/wire_names.hpp"
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

/// Who says it, as which of its messages, and when: what a host says goes by this.
template <typename Message, typename Out>
void put_sender(const Out& from, Message& out) {
  out.set_version(kCellVersion);
  out.set_host(from.host);
  out.set_boot(from.boot);
  out.set_sequence(from.sequence);
  out.set_time_utc_ns(from.time_utc_ns);
}
template <typename Message, typename Out>
Status read_sender(const Message& in, Out& out) {
  out.host = in.host();
  if (!is_camera_name(out.host)) return refuse("lacks a name");
  out.boot = in.boot();
  out.sequence = in.sequence();
  out.time_utc_ns = in.time_utc_ns();
  return is_utc(out.time_utc_ns) ? Status() : refuse("has a time that is none");
}
void put(const Rigid3& pose, cell::v1::Pose& out);
Result<Rigid3> pose_of(const cell::v1::Pose& in);

}  // namespace sightline::publish
