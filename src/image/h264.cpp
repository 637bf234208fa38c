// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/h264.hpp"

#include <iterator>

namespace sightline {
namespace {

/// Position of the next 00 00 01 at or after `from`, or the size. Reads every third byte only, as
/// long as it cannot be part of a start code.
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
    return NalUnit{begin, nal_type(stream_.subspan(body, 1)), stream_.subspan(body, end - body)};
  }
}

void append_nal_unit(std::span<const uint8_t> body, std::vector<uint8_t>& to) {
  static constexpr uint8_t kStartCode[] = {0, 0, 0, 1};
  to.insert(to.end(), std::begin(kStartCode), std::end(kStartCode));
  to.insert(to.end(), body.begin(), body.end());
}

std::vector<uint8_t> annex_b_parameter_sets(std::span<const uint8_t> access_unit) {
  std::vector<uint8_t> sets;
  bool sps = false, pps = false;
  NalReader reader(access_unit);
  while (const auto nal = reader.next()) {
    sps |= nal->type == NalType::kSequenceParameterSet;
    pps |= nal->type == NalType::kPictureParameterSet;
    if (nal->type == NalType::kSequenceParameterSet || nal->type == NalType::kPictureParameterSet) {
      append_nal_unit(nal->body, sets);
    }
  }
  if (!sps || !pps) sets.clear();
  return sets;
}

bool annex_b_has_idr(std::span<const uint8_t> access_unit) {
  NalReader reader(access_unit);
  while (const auto nal = reader.next()) {
    if (nal->type == NalType::kIdrSlice) return true;
  }
  return false;
}

bool annex_b_can_start_decoding(std::span<const uint8_t> access_unit) {
  NalReader reader(access_unit);
  while (const auto nal = reader.next()) {
    if (nal->type == NalType::kIdrSlice || nal->type == NalType::kSequenceParameterSet) return true;
    if (nal->type == NalType::kSlice) return false;  // it refers to images that were not seen
  }
  return false;
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
