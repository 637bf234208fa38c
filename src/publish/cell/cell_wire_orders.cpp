// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "publish/cell/cell_wire_parts.hpp"
#include "publish/cell/wire_names.hpp"
#include "sightline/publish/cell/cell_order.hpp"

namespace sightline {
namespace {

using namespace publish;
using Kind = CellOrder::Kind;

constexpr int kMostRecordings = 8;
constexpr size_t kLongestText = 1000;
constexpr double kFarthest_px = 1e5;
constexpr double kLongest_s = 1e7;

bool in_range(double value, double low, double high) { return value >= low && value <= high; }

Status read_hint(const cell::v1::Order& in, CellOrder& out) {
  if (out.kind == Kind::kHintPose) {
    SL_ASSIGN(out.world_from_object, pose_of(in.pose()));
    return {};
  }
  out.camera = in.camera();
  if (!is_camera_name(out.camera)) return refuse("lacks a name");
  out.pixel = {in.x(), in.y()};
  const bool placed = in_range(in.x(), -1, kFarthest_px) && in_range(in.y(), -1, kFarthest_px) &&
                      in_range(in.radius(), 0, kFarthest_px);
  if (!placed) return refuse("has a place in an image that is none");
  if (in.radius() > 0) out.radius_px = in.radius();
  return {};
}

Status read_recording(const cell::v1::Order& in, CellOrder& out) {
  if (in.recordings_size() > kMostRecordings) return refuse("has too many kinds of recordings");
  for (const std::string& kind : in.recordings()) {
    if (!is_camera_name(kind)) return refuse("has a kind of recording that is none");
    out.recordings.push_back(kind);
  }
  if (!in_range(in.seconds(), 0, kLongest_s)) return refuse("has a time that is none");
  if (in.seconds() > 0) out.seconds = in.seconds();
  return {};
}

Status read_what(const cell::v1::Order& in, CellOrder& out) {
  switch (out.kind) {
    case Kind::kHintImage:
    case Kind::kHintPose:
    case Kind::kForget:
      out.object = in.object();
      if (!is_object_name(out.object)) return refuse("lacks a name");
      return out.kind == Kind::kForget ? Status() : read_hint(in, out);
    case Kind::kReload:
      return {};
    case Kind::kRecord:
    case Kind::kStopRecording:
      return read_recording(in, out);
    case Kind::kMark:
      out.text = in.text();
      if (out.text.size() > kLongestText || !is_utf8(out.text)) return refuse("has an odd text");
      return {};
  }
  return refuse("is of no known kind");
}

}  // namespace

std::string encode(const CellOrder& order) {
  cell::v1::Order out;
  put_sender(order, out);
  out.set_kind(static_cast<uint32_t>(order.kind));
  out.set_object(order.object);
  if (order.kind == Kind::kHintImage) {
    out.set_camera(order.camera);
    out.set_x(order.pixel.x());
    out.set_y(order.pixel.y());
    out.set_radius(order.radius_px.value_or(0));
  }
  if (order.kind == Kind::kHintPose) put(order.world_from_object, *out.mutable_pose());
  for (const std::string& kind : order.recordings) out.add_recordings(kind);
  out.set_seconds(order.seconds.value_or(0));
  out.set_text(order.text);
  return out.SerializeAsString();
}

Result<CellOrder> decode_order(std::string_view bytes) {
  SL_ASSIGN(const cell::v1::Order in, parse<cell::v1::Order>(bytes));
  CellOrder out;
  SL_RETURN_IF_ERROR(read_sender(in, out));
  if (in.kind() < static_cast<uint32_t>(Kind::kHintImage) ||
      in.kind() > static_cast<uint32_t>(Kind::kMark)) {
    return refuse("is of no known kind");
  }
  out.kind = static_cast<Kind>(in.kind());
  SL_RETURN_IF_ERROR(read_what(in, out));
  return out;
}

}  // namespace sightline
