// SPDX-License-Identifier: Apache-2.0
#include "stream/request_guard.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>

namespace sightline::stream {
namespace {

using Verdict = RequestGuard::Verdict;
constexpr Time kStart = time_from_ns(5'000'000'000);

/// One byte after the other, as the library reads them.
Verdict take(RequestGuard& guard, const std::string& text, Time now = kStart) {
  for (const char c : text) {
    const uint8_t byte = static_cast<uint8_t>(c);
    if (const Verdict verdict = guard.take({&byte, 1}, now); verdict != Verdict::kPass) {
      return verdict;
    }
  }
  return Verdict::kPass;
}
Verdict judge(const std::string& text) {
  RequestGuard guard;
  return take(guard, text);
}

TEST(RequestGuard, PassesWhatViewersSend) {
  RequestGuard guard;
  EXPECT_EQ(take(guard, "OPTIONS rtsp://127.0.0.1:8554/left RTSP/1.0\r\nCSeq: 1\r\n\r\n"),
            Verdict::kPass);
  EXPECT_EQ(guard.requests(), 1u);
  EXPECT_EQ(take(guard, "GET_PARAMETER * RTSP/2.0\r\nCSeq: 2\r\ncontent-LENGTH :\t5\r\n\r\n"),
            Verdict::kPass);
  EXPECT_EQ(take(guard, std::string("\r\na\0\1", 5)), Verdict::kPass);
  const std::string frame("$\1\0\4abcd", 8), empty("$\0\0\0", 4);
  EXPECT_EQ(take(guard, fmt::format("{0}{1}\r\n\r\n{0}", frame, empty)), Verdict::kPass);
  EXPECT_EQ(guard.unfinished_since(), Time{});
  EXPECT_EQ(take(guard, "TEARDOWN * RTSP/1.0\r\n\r\n"), Verdict::kPass);
}

TEST(RequestGuard, CountsRequestsAndBodiesToTheByte) {
  RequestGuard guard;
  const std::string head = "SET_PARAMETER * RTSP/1.0\r\nContent-Length: 3\r\n\r\n";
  ASSERT_EQ(take(guard, head + "ab"), Verdict::kPass);
  EXPECT_EQ(guard.requests(), 0u);
  ASSERT_EQ(take(guard, "c"), Verdict::kPass);
  EXPECT_EQ(guard.requests(), 1u);
  ASSERT_EQ(take(guard, head + "$$$" + head + "\r\n\r"), Verdict::kPass);
  EXPECT_EQ(guard.requests(), 3u);
  ASSERT_EQ(take(guard, std::string("$\0\1\0", 4) + std::string(256, 'x')), Verdict::kPass);
  EXPECT_EQ(guard.requests(), 3u);
  EXPECT_EQ(guard.unfinished_since(), Time{});
}

TEST(RequestGuard, BoundsAHead) {
  const std::string line = "OPTIONS * RTSP/1.0\r\n";
  EXPECT_EQ(judge(line + "X: " + std::string(RequestGuard::kMaxHead, 'a')), Verdict::kTooLarge);
  std::string many = line;
  for (int i = 0; i < 10'000; ++i) many += "A: b\r\n";
  EXPECT_EQ(judge(many), Verdict::kTooLarge);
  EXPECT_EQ(judge(std::string(RequestGuard::kMaxHead + 1, 'a')), Verdict::kTooLarge);
  EXPECT_EQ(judge(line + "X: " + std::string(8000, 'a') + "\r\n\r\n"), Verdict::kPass);
}

TEST(RequestGuard, BoundsABody) {
  const auto with_length = [](const std::string& length) {
    return judge("OPTIONS * RTSP/1.0\r\nContent-Length: " + length + "\r\n\r\n");
  };
  EXPECT_EQ(with_length("16384"), Verdict::kPass);
  EXPECT_EQ(with_length("16385"), Verdict::kTooLarge);
  EXPECT_EQ(with_length("2000000000"), Verdict::kTooLarge);
  EXPECT_EQ(with_length("99999999999999999999999999"), Verdict::kTooLarge);
  for (const std::string bad : {"-1", "+1", "1 2", "0x10", "", "5, 6", "5;"}) {
    EXPECT_EQ(with_length(bad), Verdict::kMalformed) << bad;
  }
  EXPECT_EQ(with_length("1\r\nContent-length: 1"), Verdict::kMalformed);
}

TEST(RequestGuard, TellsHttpAtItsFirstLine) {
  EXPECT_EQ(judge("GET /left HTTP/1.1\r\n"), Verdict::kHttp);
  EXPECT_EQ(judge("POST / HTTP/1.0\r\n"), Verdict::kHttp);
}

TEST(RequestGuard, RefusesWhatParsersReadDifferently) {
  const std::string line = "OPTIONS * RTSP/1.0\r\n";
  for (const std::string& bad :
       {std::string("hello\r\n"), std::string("RTSP/1.0 200 OK\r\n"), std::string("OPTIONS *\n"),
        line + "CSeq: 1\n", line + "CSeq: 1\rX", line + "CSeq: 1\r\r", line + " folded\r\n",
        line + "\tfolded\r\n", line + "no colon\r\n", line + std::string("\0: 1", 4),
        line + "X: \x1b[2J", std::string("\x16\x03\x01", 3)}) {
    EXPECT_EQ(judge(bad), Verdict::kMalformed) << bad;
  }
}

TEST(RequestGuard, TellsSinceWhenSomethingIsUnfinished) {
  RequestGuard guard;
  const auto at = [](int seconds) { return kStart + std::chrono::seconds(seconds); };
  EXPECT_EQ(guard.unfinished_since(), Time{});
  take(guard, "\r\n", at(1));
  EXPECT_EQ(guard.unfinished_since(), Time{});
  take(guard, "OPTIONS * RT", at(2));
  take(guard, "SP/1.0\r\nContent-Length: 2\r\n\r\n", at(3));
  EXPECT_EQ(guard.unfinished_since(), at(2));
  take(guard, "ab", at(4));
  EXPECT_EQ(guard.unfinished_since(), Time{});
  take(guard, "$", at(5));
  EXPECT_EQ(guard.unfinished_since(), at(5));
}

}  // namespace
}  // namespace sightline::stream
