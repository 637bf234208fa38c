// SPDX-License-Identifier: Apache-2.0
#pragma once

// Poses of a running sightlined as they are estimated (docs/poses.md). One header; needs POSIX
// sockets and nlohmann-json, C++17.
//
//     sightline_client::PoseStream stream("127.0.0.1", 8080);
//     while (const auto pose = stream.next()) use(*pose);

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace sightline_client {

struct Pose {
  std::string object;
  std::string state;   ///< "tracking", "degraded", "coasting"; "searching" and "lost" have no pose
  int64_t t_ns = 0;    ///< capture, CLOCK_MONOTONIC of the daemon's machine
  int64_t utc_ns = 0;  ///< the same in UTC
  double age_s = 0;    ///< since capture, when it was sent
  std::string calibration;  ///< hash of the one in force
  bool has_pose = false;
  std::array<double, 3> translation_m{};      ///< world_from_object
  std::array<double, 4> rotation_wxyz{};      ///< unit quaternion
  std::array<double, 36> covariance{};        ///< row-major, (rotation, translation), object's side
  std::vector<std::string> cameras, reasons;  ///< who measured; why it is degraded
};

/// One connection. Blocks; one thread. Throws std::runtime_error where it cannot connect or is
/// refused.
class PoseStream {
 public:
  PoseStream(const std::string& host, uint16_t port, const std::string& token = {}) {
    connect(host, std::to_string(port));
    std::string request =
        "GET /api/v1/events HTTP/1.0\r\nHost: " + host + ":" + std::to_string(port) + "\r\n";
    if (!token.empty()) request += "Authorization: Bearer " + token + "\r\n";
    request += "\r\n";
    if (::send(socket_, request.data(), request.size(), MSG_NOSIGNAL) !=
        static_cast<ssize_t>(request.size())) {
      fail("cannot ask");
    }
    const auto status = line();
    if (!status || status->find(" 200") == std::string::npos) {
      fail(status ? "refused: " + *status : "no answer");
    }
    while (true) {
      const auto header = line();
      if (!header) fail("no answer");
      if (header->empty()) break;
    }
  }
  ~PoseStream() { ::close(socket_); }
  PoseStream(const PoseStream&) = delete;
  PoseStream& operator=(const PoseStream&) = delete;

  /// The next estimate; empty once the daemon has ended the connection.
  std::optional<Pose> next() {
    while (const auto text = line()) {
      if (text->rfind("event: ", 0) == 0) event_ = text->substr(7);
      if (event_ == "pose" && text->rfind("data: ", 0) == 0) return parse(text->substr(6));
    }
    return std::nullopt;
  }

 private:
  static Pose parse(const std::string& text) {
    const auto json = nlohmann::json::parse(text);
    Pose pose;
    pose.object = json.at("object");
    pose.state = json.at("state");
    pose.t_ns = json.at("t_ns");
    pose.utc_ns = json.at("utc_ns");
    pose.age_s = json.at("age_s");
    pose.calibration = json.at("calibration");
    pose.has_pose = json.contains("translation_m");
    if (!pose.has_pose) return pose;
    json.at("translation_m").get_to(pose.translation_m);
    json.at("rotation_wxyz").get_to(pose.rotation_wxyz);
    json.at("covariance").get_to(pose.covariance);
    json.at("cameras").get_to(pose.cameras);
    if (json.contains("reasons")) json.at("reasons").get_to(pose.reasons);
    return pose;
  }

  void connect(const std::string& host, const std::string& port) {
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (::getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) {
      throw std::runtime_error("sightline: there is no host " + host);
    }
    for (const addrinfo* one = found; one != nullptr && socket_ < 0; one = one->ai_next) {
      socket_ = ::socket(one->ai_family, one->ai_socktype | SOCK_CLOEXEC, one->ai_protocol);
      if (socket_ < 0 || ::connect(socket_, one->ai_addr, one->ai_addrlen) == 0) continue;
      ::close(socket_);
      socket_ = -1;
    }
    ::freeaddrinfo(found);
    if (socket_ < 0)
      throw std::runtime_error("sightline: " + host + ":" + port + " does not answer");
  }

  [[noreturn]] void fail(const std::string& why) {
    ::close(socket_);
    throw std::runtime_error("sightline: " + why);
  }

  std::optional<std::string> line() {
    size_t end = 0;
    while ((end = buffer_.find('\n')) == std::string::npos) {
      char piece[4096];
      const ssize_t got = ::recv(socket_, piece, sizeof piece, 0);
      if (got <= 0) return std::nullopt;
      buffer_.append(piece, static_cast<size_t>(got));
    }
    std::string text = buffer_.substr(0, end);
    buffer_.erase(0, end + 1);
    if (!text.empty() && text.back() == '\r') text.pop_back();
    return text;
  }

  int socket_ = -1;
  std::string buffer_, event_;
};

}  // namespace sightline_client
