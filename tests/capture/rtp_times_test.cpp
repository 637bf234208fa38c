// SPDX-License-Identifier: Apache-2.0
#include "capture/network/rtp_times.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace sightline::capture {
namespace {

constexpr uint32_t kSeconds2023 = 1'700'000'000u + 2'208'988'800u;

void put(std::vector<uint8_t>& to, uint32_t value) {
  for (const int shift : {24, 16, 8, 0}) to.push_back(static_cast<uint8_t>(value >> shift));
}

std::vector<uint8_t> report(uint32_t seconds, uint32_t fraction, uint32_t rtp) {
  std::vector<uint8_t> bytes{0x80, 200, 0, 6};
  put(bytes, 0x12345678);
  put(bytes, seconds);
  put(bytes, fraction);
  put(bytes, rtp);
  put(bytes, 0);
  put(bytes, 0);
  return bytes;
}

std::vector<uint8_t> packet(uint32_t rtp) {
  std::vector<uint8_t> bytes{0x80, 96, 0, 1};
  put(bytes, rtp);
  put(bytes, 0x12345678);
  return bytes;
}

TEST(RtpTimes, KnowsNothingBeforeTheFirstReport) {
  RtpTimes times;
  times.packet(packet(1000), 5);
  EXPECT_FALSE(times.utc_ns(5));
}

TEST(RtpTimes, CountsFromTheReportInBothDirections) {
  RtpTimes times;
  times.packet(packet(90'000), 1);
  times.sender_report(report(kSeconds2023, 0x80000000u, 180'000));
  times.packet(packet(225'000), 2);
  EXPECT_EQ(times.utc_ns(1), 1'699'999'999'500'000'000);
  EXPECT_EQ(times.utc_ns(2), 1'700'000'001'000'000'000);
  EXPECT_FALSE(times.utc_ns(3));
}

TEST(RtpTimes, WrapsWithTheTimeStamp) {
  RtpTimes times;
  times.sender_report(report(kSeconds2023, 0, 0xfffffff0u));
  times.packet(packet(90'000 - 16), 1);
  EXPECT_EQ(times.utc_ns(1), 1'700'000'001'000'000'000);
}

TEST(RtpTimes, TheNtpEraOf2036IsALaterOne) {
  RtpTimes times;
  times.sender_report(report(10, 0, 0));
  times.packet(packet(0), 1);
  EXPECT_EQ(times.utc_ns(1), ((int64_t{1} << 32) + 10 - 2'208'988'800) * 1'000'000'000);
}

TEST(RtpTimes, ForgetsImagesOfLongAgo) {
  RtpTimes times;
  times.sender_report(report(kSeconds2023, 0, 0));
  for (uint32_t i = 0; i < 200; ++i) times.packet(packet(i * 3000), i);
  EXPECT_FALSE(times.utc_ns(10));
  EXPECT_TRUE(times.utc_ns(199));
  EXPECT_TRUE(times.utc_ns(100));
}

TEST(RtpTimes, IgnoresWhatIsNoReportAndNoPacket) {
  RtpTimes times;
  std::vector<uint8_t> bytes = report(kSeconds2023, 0, 0);
  bytes[1] = 201;
  times.sender_report(bytes);
  times.sender_report(report(0, 0, 0));
  times.sender_report(std::vector<uint8_t>(19, 0x80));
  times.sender_report({});
  times.packet(packet(7), 1);
  EXPECT_FALSE(times.utc_ns(1));
  times.sender_report(report(kSeconds2023, 0, 0));
  times.packet(std::vector<uint8_t>(11, 0x80), 2);
  times.packet(std::vector<uint8_t>(12, 0), 3);
  EXPECT_FALSE(times.utc_ns(2));
  EXPECT_FALSE(times.utc_ns(3));
}

}  // namespace
}  // namespace sightline::capture
