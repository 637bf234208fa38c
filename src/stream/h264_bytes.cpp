// SPDX-License-Identifier: Apache-2.0
#include "h264_bytes.hpp"

namespace sightline {
namespace {

/// Position of the next 00 00 01 at or after `from`, or the size. Looks at every third byte while
/// it cannot end a start code.
size_t find_start_code(std::span<const uint8_t> bytes, size_t from) {
  for (size_t last = from + 2; last < bytes.size();) {
    if (bytes[last] > 1) {
      last += 3;
    } else if (bytes[last] == 1 && bytes[last - 1] == 0 && bytes[last - 2] == 0) {
      return last - 2;
    } else {
      ++last;
    }
  }
  return bytes.size();
}

}  // namespace

std::optional<NalUnit> NalReader::next() {
  while (true) {
    const size_t code = find_start_code(stream_, at_);
    if (code == stream_.size()) return std::nullopt;
    const size_t body = code + 3;
    const size_t following = find_start_code(stream_, body);
    size_t begin = code;
    while (begin > at_ && stream_[begin - 1] == 0) --begin;
    size_t end = following;
    while (end > body && stream_[end - 1] == 0) --end;
    at_ = following == stream_.size() ? following : end;
    if (end == body) {
      at_ = following;
      continue;
    }
    return NalUnit{begin, static_cast<uint8_t>(stream_[body] & 0x1f),
                   stream_.subspan(body, end - body)};
  }
}

void append_escaped(std::span<const uint8_t> raw, std::vector<uint8_t>& to) {
  int zeros = 0;
  for (const uint8_t byte : raw) {
    if (zeros >= 2 && byte <= 3) {
      to.push_back(3);
      zeros = 0;
    }
    to.push_back(byte);
    zeros = byte == 0 ? zeros + 1 : 0;
  }
  if (zeros >= 2) to.push_back(3);
}

std::vector<uint8_t> unescaped(std::span<const uint8_t> escaped) {
  std::vector<uint8_t> raw;
  raw.reserve(escaped.size());
  int zeros = 0;
  for (const uint8_t byte : escaped) {
    if (zeros >= 2 && byte == 3) {
      zeros = 0;
      continue;
    }
    raw.push_back(byte);
    zeros = byte == 0 ? zeros + 1 : 0;
  }
  return raw;
}

}  // namespace sightline
