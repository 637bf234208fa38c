// SPDX-License-Identifier: Apache-2.0
#pragma once

// A small RTSP client on a plain socket (RTP interleaved in the connection), so that tests decide
// exactly when something is asked, read, or left unread.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline {

struct RtpPacket {
  uint32_t timestamp = 0;  ///< 90 kHz
  std::vector<uint8_t> payload;
};

class RawRtspClient {
 public:
  RawRtspClient(uint16_t port, std::string url) : url_(std::move(url)) {
    fd_ = UniqueFd(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ =
        connect(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  }

  bool connected() const { return connected_; }

  /// Status code of the response, 0 if there was none in time.
  int request(const std::string& method, const std::string& url, const std::string& headers = "") {
    std::string text =
        method + " " + url + " RTSP/1.0\r\nCSeq: " + std::to_string(++sequence_) + "\r\n" + headers;
    if (!session_.empty()) text += "Session: " + session_ + "\r\n";
    text += "\r\n";
    if (send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL) < 0) return 0;
    return read_response();
  }

  /// DESCRIBE, SETUP over TCP, PLAY; the status code of the first that was not 200, else 200.
  int play() {
    int status = request("DESCRIBE", url_, "Accept: application/sdp\r\n");
    if (status != 200) return status;
    status =
        request("SETUP", url_ + "/stream=0", "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n");
    if (status != 200) return status;
    return request("PLAY", url_, "Range: npt=0.000-\r\n");
  }
  int teardown() { return request("TEARDOWN", url_); }

  /// The next video packet; empty after `timeout` or when the server closed the connection.
  std::optional<RtpPacket> next_packet(Duration timeout = std::chrono::seconds(20)) {
    const Time deadline = MonotonicClock::now() + timeout;
    while (true) {
      const auto frame = read_interleaved(deadline);
      if (!frame) return std::nullopt;
      if (frame->first != 0 || frame->second.size() < 12) continue;
      const std::vector<uint8_t>& b = frame->second;
      const uint32_t timestamp = static_cast<uint32_t>(b[4]) << 24 |
                                 static_cast<uint32_t>(b[5]) << 16 |
                                 static_cast<uint32_t>(b[6]) << 8 | static_cast<uint32_t>(b[7]);
      return RtpPacket{timestamp, {b.begin() + 12, b.end()}};
    }
  }

  /// True once the server has closed the connection.
  bool closed_by_server(Duration timeout) {
    const Time deadline = MonotonicClock::now() + timeout;
    while (fill(deadline)) buffer_.clear();
    return at_end_;
  }

 private:
  bool fill(Time deadline) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - MonotonicClock::now());
    pollfd waiting{fd_.get(), POLLIN, 0};
    if (left.count() <= 0 || poll(&waiting, 1, static_cast<int>(left.count())) <= 0) return false;
    std::array<uint8_t, 65536> chunk;
    const ssize_t got = recv(fd_.get(), chunk.data(), chunk.size(), 0);
    if (got <= 0) {
      at_end_ = true;
      return false;
    }
    buffer_.insert(buffer_.end(), chunk.begin(), chunk.begin() + got);
    return true;
  }

  /// Channel and bytes of an interleaved frame (RFC 2326, 10.12).
  std::optional<std::pair<int, std::vector<uint8_t>>> read_interleaved(Time deadline) {
    while (true) {
      if (buffer_.size() >= 4 && buffer_[0] == '$') {
        const size_t length = static_cast<size_t>(buffer_[2]) << 8 | buffer_[3];
        if (buffer_.size() >= 4 + length) {
          const auto end = buffer_.begin() + 4 + static_cast<ptrdiff_t>(length);
          std::pair<int, std::vector<uint8_t>> frame(buffer_[1], {buffer_.begin() + 4, end});
          buffer_.erase(buffer_.begin(), end);
          return frame;
        }
      } else if (!buffer_.empty()) {
        return std::nullopt;
      }
      if (!fill(deadline)) return std::nullopt;
    }
  }

  int read_response() {
    const Time deadline = MonotonicClock::now() + std::chrono::seconds(30);
    while (true) {
      if (!buffer_.empty() && buffer_[0] == '$') {
        if (!read_interleaved(deadline)) return 0;
        continue;
      }
      const std::string text(buffer_.begin(), buffer_.end());
      const size_t end = text.find("\r\n\r\n");
      if (end != std::string::npos) {
        size_t length = 0;
        if (const size_t at = text.find("Content-Length: "); at < end) {
          length = std::stoul(text.substr(at + 16));
        }
        if (text.size() >= end + 4 + length) {
          if (const size_t at = text.find("Session: "); at < end) {
            session_ = text.substr(at + 9, text.find_first_of(";\r", at) - at - 9);
          }
          buffer_.erase(buffer_.begin(),
                        buffer_.begin() + static_cast<ptrdiff_t>(end + 4 + length));
          return std::stoi(text.substr(9, 3));
        }
      }
      if (!fill(deadline)) return 0;
    }
  }

  std::string url_;
  UniqueFd fd_;
  bool connected_ = false;
  bool at_end_ = false;
  int sequence_ = 0;
  std::string session_;
  std::vector<uint8_t> buffer_;
};

}  // namespace sightline
