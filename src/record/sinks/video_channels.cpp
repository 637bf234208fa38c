// SPDX-License-Identifier: Apache-2.0
#include "record/sinks/video_channels.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "sightline/image/h264.hpp"

namespace sightline::record {
namespace {

constexpr std::string_view kVideoSchema = R"({"title":"foxglove.CompressedVideo","type":"object",
"properties":{"timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},
"nsec":{"type":"integer"}}},"frame_id":{"type":"string"},"data":{"type":"string",
"contentEncoding":"base64"},"format":{"type":"string"}}})";

}  // namespace

std::string base64(const std::vector<uint8_t>& bytes) {
  constexpr char kLetters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t left = bytes.size() - i;
    const uint32_t three = uint32_t{bytes[i]} << 16 | (left > 1 ? uint32_t{bytes[i + 1]} << 8 : 0) |
                           (left > 2 ? uint32_t{bytes[i + 2]} : 0);
    out += kLetters[three >> 18 & 63];
    out += kLetters[three >> 12 & 63];
    out += left > 1 ? kLetters[three >> 6 & 63] : '=';
    out += left > 2 ? kLetters[three & 63] : '=';
  }
  return out;
}

bool VideoChannels::append(McapFile& file, const ViewPacket& packet) {
  const EncodedPacket& encoded = packet.packet;
  const auto [found, is_new] = cameras_.try_emplace(packet.camera);
  Camera& camera = found->second;
  if (packet.number != camera.number + 1) camera.whole = false;
  camera.number = packet.number;
  // Somebody who comes in here can decode it.
  if (encoded.keyframe && !annex_b_parameter_sets(*encoded.bytes).empty()) camera.whole = true;
  if (!camera.whole) return false;
  if (camera.channel == 0) {
    if (schema_ == 0) schema_ = file.add_schema("foxglove.CompressedVideo", kVideoSchema);
    camera.channel = file.add_channel(schema_, "/cameras/" + packet.camera + "/video");
  }
  const int64_t utc_ns = utc_ns_of(encoded.capture);
  const nlohmann::ordered_json json{
      {"timestamp", {{"sec", utc_ns / 1'000'000'000}, {"nsec", utc_ns % 1'000'000'000}}},
      {"frame_id", packet.camera},
      {"format", "h264"},
      {"data", base64(*encoded.bytes)}};
  file.append(camera.channel, utc_ns, json.dump());
  return true;
}

}  // namespace sightline::record
