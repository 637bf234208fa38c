// SPDX-License-Identifier: Apache-2.0
#include "stream/request_guard.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <string_view>
#include <utility>

namespace sightline::stream {
namespace {

std::string_view trim(std::string_view text) {
  const auto from = text.find_first_not_of(" \t");
  if (from == std::string_view::npos) return {};
  return text.substr(from, text.find_last_not_of(" \t") - from + 1);
}

bool is_content_length(std::string_view name) {
  constexpr std::string_view kName = "content-length";
  return std::equal(name.begin(), name.end(), kName.begin(), kName.end(), [](char a, char b) {
    return std::tolower(static_cast<unsigned char>(a)) == b;
  });
}

}  // namespace

RequestGuard::Verdict RequestGuard::take(std::span<const uint8_t> bytes, Time now) {
  if (opaque_) {
    const size_t all = since_answer_.fetch_add(bytes.size(), std::memory_order_relaxed);
    return all + bytes.size() > kMaxOpaque ? Verdict::kTooLarge : Verdict::kPass;
  }
  for (const uint8_t byte : bytes) {
    if (const Verdict verdict = take_byte(byte, now); verdict != Verdict::kPass) return verdict;
  }
  return Verdict::kPass;
}

RequestGuard::Verdict RequestGuard::take_byte(uint8_t byte, Time now) {
  switch (state_) {
    case State::kBetween:
      return begin(byte, now);
    case State::kFrameHeader:
      return take_frame_header(byte);
    case State::kHead:
      return take_head(byte);
    case State::kBody:
      take_body();
      return Verdict::kPass;
  }
  return Verdict::kMalformed;
}

RequestGuard::Verdict RequestGuard::begin(uint8_t byte, Time now) {
  if (byte == '\r' || byte == '\n') return Verdict::kPass;  // keeps a router's table fresh
  unfinished_since_.store(now, std::memory_order_relaxed);
  left_ = 0;
  is_request_ = byte != '$';
  if (!is_request_) {
    state_ = State::kFrameHeader;
    header_at_ = 0;
    return Verdict::kPass;
  }
  state_ = State::kHead;
  head_bytes_ = 0;
  first_line_ = true;
  carriage_return_ = has_length_ = false;
  line_.clear();
  return take_head(byte);
}

// Channel and length in two bytes (RFC 2326, 10.12).
RequestGuard::Verdict RequestGuard::take_frame_header(uint8_t byte) {
  if (header_at_ > 0) left_ = left_ << 8 | byte;
  if (++header_at_ < 3) return Verdict::kPass;
  state_ = State::kBody;
  if (left_ == 0) end_message();
  return Verdict::kPass;
}

// Line ends other than CR LF, folded lines and control characters are allowed nowhere or read
// differently by every parser; no viewer sends them.
RequestGuard::Verdict RequestGuard::take_head(uint8_t byte) {
  if (++head_bytes_ > kMaxHead) return Verdict::kTooLarge;
  if (carriage_return_ != (byte == '\n')) return Verdict::kMalformed;
  carriage_return_ = byte == '\r';
  if (byte == '\n') return end_line();
  if (byte == '\r') return Verdict::kPass;
  if (byte < ' ' && byte != '\t') return Verdict::kMalformed;
  line_ += static_cast<char>(byte);
  return Verdict::kPass;
}

RequestGuard::Verdict RequestGuard::end_line() {
  const std::string line = std::exchange(line_, {});
  if (first_line_) {
    first_line_ = false;
    const std::string_view version = std::string_view(line).substr(line.rfind(' ') + 1);
    if (version.starts_with("HTTP/")) return Verdict::kHttp;
    return version.starts_with("RTSP/") ? Verdict::kPass : Verdict::kMalformed;
  }
  if (!line.empty()) return take_header(line);
  state_ = State::kBody;
  if (left_ == 0) end_message();
  return Verdict::kPass;
}

RequestGuard::Verdict RequestGuard::take_header(const std::string& line) {
  if (line.front() == ' ' || line.front() == '\t') return Verdict::kMalformed;
  const size_t colon = line.find(':');
  if (colon == std::string::npos) return Verdict::kMalformed;
  if (!is_content_length(trim(std::string_view(line).substr(0, colon)))) return Verdict::kPass;
  const std::string_view value = trim(std::string_view(line).substr(colon + 1));
  const bool is_number =
      !value.empty() &&
      std::all_of(value.begin(), value.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
  if (!is_number || has_length_) return Verdict::kMalformed;
  has_length_ = true;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), left_);
  return error != std::errc() || left_ > kMaxBody ? Verdict::kTooLarge : Verdict::kPass;
}

void RequestGuard::take_body() {
  if (--left_ == 0) end_message();
}

void RequestGuard::end_message() {
  state_ = State::kBetween;
  unfinished_since_.store(Time{}, std::memory_order_relaxed);
  if (is_request_) requests_.fetch_add(1, std::memory_order_relaxed);
}

std::string_view describe(RequestGuard::Verdict verdict) {
  switch (verdict) {
    case RequestGuard::Verdict::kTooLarge:
      return "a request beyond 16 KiB";
    case RequestGuard::Verdict::kHttp:
      return "HTTP, which is not served here; a player that sends RTSP inside HTTP has to use TCP";
    case RequestGuard::Verdict::kMalformed:
      return "what came is not RTSP";
    case RequestGuard::Verdict::kPass:
      break;
  }
  return "";
}

}  // namespace sightline::stream
