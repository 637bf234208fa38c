// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/axes/opentrackio.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <string>
#include <vector>

namespace sightline {
namespace {

using Outcome = OpenTrackIoAssembler::Outcome;
constexpr double kDegree = std::numbers::pi / 180;

const std::string kSample =
    R"({"protocol":{"name":"OpenTrackIO","version":[1,0,1]},"sourceNumber":7,)"
    R"("timing":{"sampleTimestamp":{"seconds":12,"nanoseconds":345}},)"
    R"("lens":{"encoders":{"zoom":0.5},"rawEncoders":{"zoom":4711}},)"
    R"("transforms":[{"id":"Camera","rotation":{"pan":12.5,"tilt":-3.25,"roll":0}},)"
    R"({"id":"Hand","rotation":{"pan":1,"tilt":1,"roll":0}}]})";

// Of "abc" behind the header of a whole sample 0x0102: the sums worked out by hand, modulo 256.
std::vector<uint8_t> abc_packet() {
  return {'O', 'T', 'r', 'k', 0, 1, 1, 2, 0, 0, 0, 0, 0x80, 3, 0x08, 0x2D, 'a', 'b', 'c'};
}

TEST(OpenTrackIo, ASampleIsReadByItsKeys) {
  const auto sample = parse_opentrackio(kSample);
  ASSERT_TRUE(sample.has_value());
  EXPECT_NEAR(sample->reading.pan, 12.5 * kDegree, 1e-12);
  EXPECT_NEAR(sample->reading.tilt, -3.25 * kDegree, 1e-12);
  EXPECT_EQ(sample->reading.zoom, 4711);
  EXPECT_EQ(sample->source, 7);
  EXPECT_EQ(sample->device_ns, 12'000'000'345);
}

TEST(OpenTrackIo, WithoutACameraTheLastTransformCounts) {
  std::string text = kSample;
  text.replace(text.find("Camera"), 6, "Armful");
  EXPECT_NEAR(parse_opentrackio(text)->reading.pan, kDegree, 1e-12);
}

TEST(OpenTrackIo, WhatIsNoRotationIsRefused) {
  const auto with = [](const std::string& what, const std::string& by) {
    std::string text = kSample;
    text.replace(text.find(what), what.size(), by);
    return parse_opentrackio(text);
  };
  EXPECT_TRUE(with("12.5", "360").has_value());
  for (const auto& [what, by] :
       std::vector<std::pair<std::string, std::string>>{{"12.5", "361"},
                                                        {"12.5", "\"12\""},
                                                        {"12.5", "null"},
                                                        {"12.5", "1e999"},
                                                        {"\"pan\"", "\"pun\""},
                                                        {"OpenTrackIO", "Other"},
                                                        {"transforms", "transform"},
                                                        {"}]}", "}]"}}) {
    EXPECT_FALSE(with(what, by).has_value()) << what << " " << by;
  }
  EXPECT_FALSE(parse_opentrackio("").has_value());
  EXPECT_FALSE(parse_opentrackio("[]").has_value());
  EXPECT_FALSE(parse_opentrackio(std::string(100000, '[')).has_value());
}

// {"transforms": [{"id": "Camera", "rotation": {"pan": 12.5 (half), "tilt": -3.25 (double)}}],
//  "sourceNumber": 7}, byte by byte after RFC 8949.
std::string cbor_sample() {
  std::string out;
  const auto bytes = [&out](std::initializer_list<int> values) {
    for (const int value : values) out.push_back(static_cast<char>(value));
  };
  const auto text = [&](const std::string& word) {
    bytes({0x60 + static_cast<int>(word.size())});
    out += word;
  };
  bytes({0xA2});
  text("transforms");
  bytes({0x81, 0xA2});
  text("id");
  text("Camera");
  text("rotation");
  bytes({0xA2});
  text("pan");
  bytes({0xF9, 0x4A, 0x40});
  text("tilt");
  bytes({0xFB, 0xC0, 0x0A, 0, 0, 0, 0, 0, 0});
  text("sourceNumber");
  bytes({0x07});
  return out;
}

TEST(OpenTrackIo, CborSaysTheSame) {
  const auto sample = parse_opentrackio_cbor(cbor_sample());
  ASSERT_TRUE(sample.has_value());
  EXPECT_NEAR(sample->reading.pan, 12.5 * kDegree, 1e-12);
  EXPECT_NEAR(sample->reading.tilt, -3.25 * kDegree, 1e-12);
  EXPECT_EQ(sample->source, 7);
}

TEST(OpenTrackIo, CborMayLeaveItsLengthsOpen) {
  std::string open = cbor_sample();
  open[0] = '\xBF';
  open.push_back('\xFF');
  const auto sample = parse_opentrackio_cbor(open);
  ASSERT_TRUE(sample.has_value());
  EXPECT_NEAR(sample->reading.pan, 12.5 * kDegree, 1e-12);
  EXPECT_FALSE(parse_opentrackio_cbor(open + '\xFF').has_value());
}

TEST(OpenTrackIo, WhatIsNoCborIsRefused) {
  const std::string good = cbor_sample();
  for (size_t length = 0; length < good.size(); ++length) {
    EXPECT_FALSE(parse_opentrackio_cbor(good.substr(0, length)).has_value()) << length;
  }
  EXPECT_FALSE(parse_opentrackio_cbor(good + '\0').has_value());
  EXPECT_FALSE(parse_opentrackio_cbor(kSample).has_value());
  std::string infinite = good;
  infinite.replace(infinite.find("\xF9"), 3, std::string("\xF9\x7C\x00", 3));
  EXPECT_FALSE(parse_opentrackio_cbor(infinite).has_value());
  EXPECT_FALSE(parse_opentrackio_cbor(std::string(1, '\xC1') + good).has_value());  // tagged
  // What a reader that calls itself, or believes lengths, would die of.
  for (const char* piece : {"\x81", "\x9F", "\xA1\x61k", "\xC1", "\x5F", "\x7F", "\x7F\x60"}) {
    std::string deep;
    while (deep.size() < OpenTrackIoAssembler::kLongest - 4) deep += piece;
    EXPECT_FALSE(parse_opentrackio_cbor(deep).has_value());
    EXPECT_FALSE(parse_opentrackio_cbor(deep + deep).has_value());
  }
  for (const char kind : {'\x5B', '\x7B', '\x9B', '\xBB'}) {
    for (const std::string& length : {std::string(8, '\xFF'), '\x7F' + std::string(7, '\xFF'),
                                      std::string("\0\0\0\x10\0\0\0\0", 8)}) {
      EXPECT_FALSE(parse_opentrackio_cbor(kind + length).has_value());
    }
  }
}

TEST(OpenTrackIo, APacketIsCheckedByteByByte) {
  OpenTrackIoAssembler assembler;
  ASSERT_EQ(assembler.add(abc_packet()), Outcome::kSample);
  EXPECT_EQ(assembler.sample(), "abc");
  for (size_t i = 0; i < abc_packet().size(); ++i) {
    std::vector<uint8_t> packet = abc_packet();
    packet[i] ^= 0x10;
    EXPECT_EQ(OpenTrackIoAssembler().add(packet), Outcome::kBad) << i;
  }
  EXPECT_EQ(assembler.add({}), Outcome::kBad);
  std::vector<uint8_t> cut = abc_packet();
  cut.pop_back();
  EXPECT_EQ(assembler.add(cut), Outcome::kBad);
}

std::vector<uint8_t> segment(int sequence, size_t offset, bool last, const std::string& payload) {
  std::vector<uint8_t> out = {'O', 'T', 'r', 'k', 0, 1};
  const auto put = [&out](size_t value, int bytes) {
    for (int i = bytes - 1; i >= 0; --i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
  };
  put(static_cast<size_t>(sequence), 2);
  put(offset, 4);
  put(payload.size() | (last ? 0x8000u : 0u), 2);
  uint32_t low = 0, high = 0;  // modulo 255, as Fletcher has it
  const auto sum = [&](uint8_t byte) {
    low = (low + byte) % 255;
    high = (high + low) % 255;
  };
  for (const uint8_t byte : out) sum(byte);
  for (const char byte : payload) sum(static_cast<uint8_t>(byte));
  put(high << 8 | low, 2);
  out.insert(out.end(), payload.begin(), payload.end());
  return out;
}

TEST(OpenTrackIo, SegmentsMakeASampleOnlyTogetherAndInOrder) {
  const auto first = segment(5, 0, false, "{\"a\":"), second = segment(5, 5, true, "1}");
  OpenTrackIoAssembler assembler;
  EXPECT_EQ(assembler.add(first), Outcome::kPart);
  ASSERT_EQ(assembler.add(second), Outcome::kSample);
  EXPECT_EQ(assembler.sample(), "{\"a\":1}");
  EXPECT_EQ(assembler.add(second), Outcome::kBad);  // again
  EXPECT_EQ(assembler.add(first), Outcome::kPart);
  EXPECT_EQ(assembler.add(segment(6, 5, true, "1}")), Outcome::kBad);  // of another
  EXPECT_EQ(assembler.add(second), Outcome::kBad);                     // what was begun is spoilt
  EXPECT_EQ(assembler.add(first), Outcome::kPart);
  EXPECT_EQ(assembler.add(segment(5, 6, true, "1}")), Outcome::kBad);  // one is missing
}

TEST(OpenTrackIo, SegmentsWithoutAnEndAreLeft) {
  OpenTrackIoAssembler assembler;
  const std::string part(1000, 'x');
  size_t taken = 0;
  while (assembler.add(segment(1, taken, false, part)) == Outcome::kPart) taken += part.size();
  EXPECT_LE(taken, OpenTrackIoAssembler::kLongest);
  EXPECT_GT(taken, OpenTrackIoAssembler::kLongest - 2000);
}

}  // namespace
}  // namespace sightline
