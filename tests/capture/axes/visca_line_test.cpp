// SPDX-License-Identifier: Apache-2.0
#include "capture/axes/visca_line.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/random.hpp"

namespace sightline::capture {
namespace {

using Bytes = std::vector<uint8_t>;

std::vector<Bytes> framed(const Bytes& stream) {
  ViscaFramer framer;
  std::vector<Bytes> out;
  for (const uint8_t byte : stream) {
    if (const auto message = framer.push(byte)) {
      out.emplace_back(message->span().begin(), message->span().end());
    }
  }
  return out;
}

TEST(ViscaLine, MessagesEndWithTheirLastByte) {
  const Bytes done = {0x90, 0x51, 0xFF}, position = {0xB0, 0x50, 0, 1, 2, 3, 0, 0, 0, 1, 0xFF};
  Bytes stream = done;
  stream.insert(stream.end(), position.begin(), position.end());
  EXPECT_EQ(framed(stream), (std::vector<Bytes>{done, position}));
}

TEST(ViscaLine, HalfAMessageSpoilsNoOther) {
  const Bytes position = {0x90, 0x50, 0, 1, 2, 3, 0, 0, 0, 1, 0xFF};
  for (size_t cut = 1; cut < position.size(); ++cut) {
    Bytes stream(position.begin(), position.begin() + static_cast<long>(cut));
    stream.insert(stream.end(), position.begin(), position.end());
    EXPECT_EQ(framed(stream), std::vector<Bytes>{position}) << cut;
    Bytes late(position.begin() + static_cast<long>(cut), position.end());
    late.insert(late.end(), position.begin(), position.end());
    EXPECT_EQ(framed(late), std::vector<Bytes>{position}) << cut;
  }
}

TEST(ViscaLine, NoiseIsNoMessageForLong) {
  test::Random random(8);
  for (int trial = 0; trial < 200; ++trial) {
    Bytes stream;
    for (int i = 0; i < 100; ++i) stream.push_back(static_cast<uint8_t>(random.uniform(0, 255.9)));
    const Bytes position = {0x90, 0x50, 0, 1, 2, 3, 0, 0, 0, 1, 0xFF};
    stream.insert(stream.end(), position.begin(), position.end());
    const auto messages = framed(stream);
    ASSERT_FALSE(messages.empty());
    EXPECT_EQ(messages.back(), position);
    for (const Bytes& message : messages) EXPECT_LE(message.size(), 16u);
  }
}

TEST(ViscaLine, MessagesAreKnownByTheirSecondByte) {
  const auto kind = [](const Bytes& bytes) { return kind_of(bytes); };
  EXPECT_EQ(kind({0x90, 0x41, 0xFF}), ViscaKind::kAcknowledged);
  EXPECT_EQ(kind({0x90, 0x52, 0xFF}), ViscaKind::kDone);
  EXPECT_EQ(kind({0x90, 0x50, 0, 0, 0, 0, 0xFF}), ViscaKind::kAnswer);
  EXPECT_EQ(kind({0x90, 0x60, 0x02, 0xFF}), ViscaKind::kRefused);
  EXPECT_EQ(kind({0x90, 0x61, 0x41, 0xFF}), ViscaKind::kRefused);
  EXPECT_EQ(kind({0x90, 0x61, 0x04, 0xFF}), ViscaKind::kCanceled);
  EXPECT_EQ(kind({0xA0, 0x38, 0xFF}), ViscaKind::kChainChanged);
  EXPECT_EQ(kind({0x88, 0x30, 0x03, 0xFF}), ViscaKind::kAddressesGiven);
  for (const Bytes& nonsense :
       {Bytes{}, Bytes{0x90}, Bytes{0x90, 0xFF}, Bytes{0x81, 0x41, 0xFF}, Bytes{0x91, 0x41, 0xFF},
        Bytes{0x90, 0x70, 0xFF}, Bytes{0x90, 0x60, 0xFF}, Bytes{0x90, 0x41, 0x00}}) {
    EXPECT_EQ(kind(nonsense), ViscaKind::kNonsense);
  }
  EXPECT_EQ(sender_of(Bytes{0x90}), 1);
  EXPECT_EQ(sender_of(Bytes{0xF0}), 7);
  EXPECT_EQ(sender_of(Bytes{0x88}), 0);
  EXPECT_EQ(sender_of(Bytes{0x91}), 0);
  EXPECT_EQ(sender_of({}), 0);
}

TEST(ViscaLine, WhatIsNoSerialLineIsNamed) {
  const auto none = ViscaLine::open("/dev/no-such-line", 9600, "head");
  ASSERT_FALSE(none.has_value());
  EXPECT_NE(none.error().message().find("/dev/no-such-line"), std::string::npos);
  const auto null = ViscaLine::open("/dev/null", 9600, "head");
  ASSERT_FALSE(null.has_value());
  EXPECT_EQ(null.error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace sightline::capture
