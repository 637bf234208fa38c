// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "sightline/record/merge.hpp"

namespace sightline {
namespace {

int64_t ns(const char* text) {
  const auto parsed = parse_rfc3339(text, "recording.toml");
  EXPECT_TRUE(parsed) << text;
  return parsed ? *parsed : -1;
}

TEST(Rfc3339, AnyZoneIsTheSameTime) {
  EXPECT_EQ(ns("1970-01-01T00:00:00Z"), 0);
  const int64_t noon = 1'777'896'000'000'000'000;  // date -d 2026-05-04T12:00:00Z +%s%N
  EXPECT_EQ(ns("2026-05-04T12:00:00Z"), noon);
  EXPECT_EQ(ns("2026-05-04T14:30:00+02:30"), noon);
  EXPECT_EQ(ns("2026-05-03 23:00:00.25-13:00"), noon + 250'000'000);
  EXPECT_EQ(ns("2026-05-04T12:00:00.123456789Z"), noon + 123'456'789);
  EXPECT_EQ(ns("2026-05-04T12:00:00.1234567899Z"), noon + 123'456'789);
}

TEST(Rfc3339, WhatHasNoZoneOrIsNoTimeIsRefused) {
  for (const char* text : {"", "2026-05-04", "2026-05-04T12:00:00", "2026-05-04T12:00:00z1",
                           "2026-02-30T12:00:00Z", "2026-05-04T24:00:00Z", "2026-05-04T12:60:00Z",
                           "2026-05-04T12:00:00+2", "1969-05-04T12:00:00Z", "now"}) {
    const auto parsed = parse_rfc3339(text, "recording.toml");
    ASSERT_FALSE(parsed) << text;
    EXPECT_EQ(parsed.error().where, "recording.toml");
  }
}

}  // namespace
}  // namespace sightline
