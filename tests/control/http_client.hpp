// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "sightline/base/unique_fd.hpp"
#include "sightline/control/http_server.hpp"

namespace sightline::test {

inline UniqueFd connect_to(uint16_t port) {
  UniqueFd fd(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    fd.reset();
  }
  return fd;
}

/// Everything the server sends until it closes or `enough` is in it; waits at most 20 s for a byte.
inline std::string read_until(int fd, const std::string& enough) {
  std::string text;
  std::array<char, 4096> chunk;
  pollfd waiting{fd, POLLIN, 0};
  while (poll(&waiting, 1, 20'000) > 0) {
    const ssize_t got = recv(fd, chunk.data(), chunk.size(), 0);
    if (got <= 0) break;
    text.append(chunk.data(), static_cast<size_t>(got));
    if (!enough.empty() && text.find(enough) != std::string::npos) break;
  }
  return text;
}

/// The whole answer to a request with these headers ("Name: value") and this body.
inline std::string ask_with(uint16_t port, const std::string& method, const std::string& path,
                            const std::vector<std::string>& headers = {},
                            const std::string& body = "", const std::string& host = "localhost") {
  const UniqueFd fd = connect_to(port);
  std::string request = method + " " + path + " HTTP/1.1\r\nHost: " + host + "\r\n";
  for (const std::string& header : headers) request += header + "\r\n";
  if (!body.empty()) request += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  request += "Connection: close\r\n\r\n" + body;
  send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
  return read_until(fd.get(), "");
}

/// A server and the thread that it serves in.
class RunningServer {
 public:
  explicit RunningServer(std::unique_ptr<HttpServer> server)
      : server_(std::move(server)),
        thread_([raw = server_.get()](std::stop_token stop) { raw->run(stop); }) {}
  uint16_t port() const { return server_->port(); }

 private:
  std::unique_ptr<HttpServer> server_;
  std::jthread thread_;  // ends before the server
};

}  // namespace sightline::test
