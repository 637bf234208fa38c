// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/axes/opentrackio.hpp"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "capture/axes/axis_sources.hpp"

namespace sightline {
namespace {

using Json = nlohmann::json;

constexpr size_t kHeader = 16, kSummed = 14;
constexpr uint8_t kEncodingJson = 0x01, kEncodingCbor = 0x02;
constexpr double kDegree = std::numbers::pi / 180;

// Senders take the sums modulo 256 or, as Fletcher did, 255.
uint16_t fletcher16(std::span<const uint8_t> head, std::span<const uint8_t> body,
                    uint32_t modulus) {
  uint32_t sum = 0, sums = 0;
  for (const auto part : {head, body}) {
    for (const uint8_t byte : part) {
      sum = (sum + byte) % modulus;
      sums = (sums + sum) % modulus;
    }
  }
  return static_cast<uint16_t>(sums << 8 | sum);
}

uint32_t big_endian(std::span<const uint8_t> bytes) {
  uint32_t value = 0;
  for (const uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

const Json* member(const Json* object, const char* key) {
  if (object == nullptr || !object->is_object()) return nullptr;
  const auto found = object->find(key);
  return found == object->end() ? nullptr : &*found;
}

std::optional<double> number(const Json* object, const char* key) {
  const Json* value = member(object, key);
  if (value == nullptr || !value->is_number()) return std::nullopt;
  const double number = value->get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

// Of the transforms, from the stage to the lens, that of the camera.
const Json* camera_rotation(const Json& sample) {
  const Json* transforms = member(&sample, "transforms");
  if (transforms == nullptr || !transforms->is_array() || transforms->empty()) return nullptr;
  for (const Json& transform : *transforms) {
    const Json* id = member(&transform, "id");
    if (id != nullptr && *id == "Camera") return member(&transform, "rotation");
  }
  return member(&transforms->back(), "rotation");
}

bool is_of_protocol(const Json& sample) {
  const Json* name = member(member(&sample, "protocol"), "name");
  return name == nullptr || *name == "OpenTrackIO";
}

// The library's reader of CBOR calls itself for each level, and for pieces of strings within
// pieces: this goes before, in a loop. Whether it is one item, no deeper than kDeepest, whose
// strings are in one piece, without tags, and whose lengths fit.
bool is_plain_cbor(std::string_view cbor) {
  constexpr size_t kDeepest = 16;
  constexpr uint64_t kUntilBreak = UINT64_MAX;
  constexpr int kBytes = 2, kText = 3, kArray = 4, kMap = 5, kTag = 6;
  std::array<uint64_t, kDeepest> left{};  // items to come, by level
  size_t depth = 0, at = 0;
  do {
    if (at >= cbor.size()) return false;
    const auto head = static_cast<uint8_t>(cbor[at++]);
    const int kind = head >> 5, size = head & 31;
    const bool ends = head == 0xFF;
    uint64_t number = static_cast<uint64_t>(size);
    if (size >= 24 && size <= 27) {
      const size_t bytes = size_t{1} << (size - 24);
      if (cbor.size() - at < bytes) return false;
      number = 0;
      for (size_t i = 0; i < bytes; ++i) number = number << 8 | static_cast<uint8_t>(cbor[at++]);
    } else if (size == 31 && (kind == kArray || kind == kMap)) {
      number = kUntilBreak;
    } else if (size > 27 && !ends) {
      return false;
    }
    if (kind == kTag) return false;
    if (ends) {
      if (depth == 0 || left[depth - 1] != kUntilBreak) return false;
      --depth;
    } else if (kind == kBytes || kind == kText) {
      if (number > cbor.size() - at) return false;
      at += number;
    } else if (kind == kArray || kind == kMap) {
      if (number != kUntilBreak && number > cbor.size()) return false;
      if (number != kUntilBreak && kind == kMap) number *= 2;
      if (number > 0) {
        if (depth == kDeepest) return false;
        left[depth++] = number;
        continue;
      }
    }
    while (depth > 0 && left[depth - 1] != kUntilBreak && --left[depth - 1] == 0) --depth;
  } while (depth > 0);
  return at == cbor.size();
}

std::optional<OpenTrackIoSample> read_sample(const Json& sample) {
  if (!sample.is_object() || !is_of_protocol(sample)) return std::nullopt;
  const Json* rotation = camera_rotation(sample);
  const auto pan = number(rotation, "pan"), tilt = number(rotation, "tilt");
  if (!pan || !tilt || std::abs(*pan) > 360 || std::abs(*tilt) > 360) return std::nullopt;
  OpenTrackIoSample out;
  out.reading.pan = *pan * kDegree;
  out.reading.tilt = *tilt * kDegree;
  const Json* lens = member(&sample, "lens");
  const auto raw = number(member(lens, "rawEncoders"), "zoom");
  out.reading.zoom = raw.value_or(number(member(lens, "encoders"), "zoom").value_or(0));
  if (const auto source = number(&sample, "sourceNumber"); source && std::abs(*source) < 1e6) {
    out.source = static_cast<int>(*source);
  }
  const Json* stamp = member(member(&sample, "timing"), "sampleTimestamp");
  const auto seconds = number(stamp, "seconds"), rest = number(stamp, "nanoseconds");
  if (seconds && rest && std::abs(*seconds) < 1e9 * 9 && std::abs(*rest) <= 1e9) {
    out.device_ns = static_cast<int64_t>(*seconds) * 1'000'000'000 + static_cast<int64_t>(*rest);
  }
  return out;
}

}  // namespace

std::optional<OpenTrackIoSample> parse_opentrackio(std::string_view json) {
  return read_sample(Json::parse(json.begin(), json.end(), nullptr, false));
}

std::optional<OpenTrackIoSample> parse_opentrackio_cbor(std::string_view cbor) {
  if (!is_plain_cbor(cbor)) return std::nullopt;
  return read_sample(Json::from_cbor(cbor.begin(), cbor.end(), true, false));
}

OpenTrackIoAssembler::Outcome OpenTrackIoAssembler::add(std::span<const uint8_t> datagram) {
  if (!datagram.empty() && datagram[0] == '{') {
    sequence_ = -1;
    if (datagram.size() > kLongest) return Outcome::kBad;
    encoding_ = kEncodingJson;
    sample_.assign(datagram.begin(), datagram.end());
    return Outcome::kSample;
  }
  constexpr std::string_view kIdentifier = "OTrk";
  if (datagram.size() < kHeader || (datagram[5] != kEncodingJson && datagram[5] != kEncodingCbor) ||
      !std::equal(kIdentifier.begin(), kIdentifier.end(), datagram.begin())) {
    return Outcome::kBad;
  }
  const auto payload = datagram.subspan(kHeader);
  const uint32_t flag_and_length = big_endian(datagram.subspan(12, 2));
  const uint32_t checksum = big_endian(datagram.subspan(kSummed, 2));
  const auto summed = datagram.first(kSummed);
  if ((flag_and_length & 0x7FFF) != payload.size() ||
      (checksum != fletcher16(summed, payload, 256) &&
       checksum != fletcher16(summed, payload, 255))) {
    return Outcome::kBad;
  }
  const int sequence = static_cast<int>(big_endian(datagram.subspan(6, 2)));
  const uint32_t offset = big_endian(datagram.subspan(8, 4));
  if (offset == 0) {
    sample_.clear();
    sequence_ = sequence;
    encoding_ = datagram[5];
  }
  if (sequence != sequence_ || datagram[5] != encoding_ || offset != sample_.size() ||
      sample_.size() + payload.size() > kLongest) {
    sequence_ = -1;
    return Outcome::kBad;
  }
  sample_.append(payload.begin(), payload.end());
  if ((flag_and_length & 0x8000) == 0) return Outcome::kPart;
  sequence_ = -1;
  return Outcome::kSample;
}

std::optional<OpenTrackIoSample> OpenTrackIoAssembler::read() const {
  return encoding_ == kEncodingCbor ? parse_opentrackio_cbor(sample_) : parse_opentrackio(sample_);
}

namespace capture {
namespace {

class OpenTrackIoSource final : public AxisSource {
 public:
  OpenTrackIoSource(UdpSocket socket, int source)
      : socket_(std::move(socket)), source_(source), buffer_(OpenTrackIoAssembler::kLongest) {}

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    SL_ASSIGN(auto reading, receive(timeout));
    // What has waited for a thread that was late is old: only the newest was sent just now.
    for (int i = 0; i < kMaxBurst && waited_; ++i) {
      SL_ASSIGN(const auto newer, receive(Duration(0)));
      if (newer) reading = newer;
    }
    return reading;
  }
  Counts counts() const override { return counts_; }

 private:
  // Empty: none came, or not all of it, or it was not of this head; `waited_`: something came.
  Result<std::optional<AxisReading>> receive(Duration timeout) {
    using Outcome = OpenTrackIoAssembler::Outcome;
    SL_ASSIGN(const auto length, socket_.receive(buffer_, timeout));
    waited_ = length.has_value();
    if (!length) return std::optional<AxisReading>();
    const Time now = MonotonicClock::now();
    const Outcome outcome = assembler_.add(std::span<const uint8_t>(buffer_).first(*length));
    if (outcome == Outcome::kPart) return std::optional<AxisReading>();
    auto sample =
        outcome == Outcome::kSample ? assembler_.read() : std::optional<OpenTrackIoSample>();
    if (!sample || (source_ >= 0 && sample->source != source_) || is_old(*sample)) {
      ++counts_.bad;
      return std::optional<AxisReading>();
    }
    ++counts_.good;
    sample->reading.stamp = now;
    return std::optional(sample->reading);
  }

  // A tracker that sends the same sample again and again has stopped; one that comes behind a later
  // one says nothing of now. A clock that was set back by more is another clock.
  bool is_old(const OpenTrackIoSample& sample) {
    if (!sample.device_ns) return false;
    const auto before = newest_ns_;
    newest_ns_ = sample.device_ns;
    if (!before) return false;
    const int64_t step = *sample.device_ns - *before;
    if (step > 0 || step < -kClockSet) return false;
    newest_ns_ = before;
    return true;
  }

  static constexpr int kMaxBurst = 256;
  static constexpr int64_t kClockSet = 1'000'000'000;  // [ns]
  UdpSocket socket_;
  const int source_;
  std::vector<uint8_t> buffer_;
  OpenTrackIoAssembler assembler_;
  std::optional<int64_t> newest_ns_;
  bool waited_ = false;
  Counts counts_;
};

}  // namespace

Result<std::unique_ptr<AxisSource>> open_opentrackio(const AxisSourceOptions& options,
                                                     const std::string& name) {
  SL_ASSIGN(UdpSocket socket,
            UdpSocket::listen(options.host, options.interface, options.port, name));
  return std::unique_ptr<AxisSource>(
      std::make_unique<OpenTrackIoSource>(std::move(socket), options.device));
}

}  // namespace capture
}  // namespace sightline
