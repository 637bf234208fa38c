// SPDX-License-Identifier: Apache-2.0
#include "sightline/control/http_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <stdexcept>

#include "control/http_client.hpp"

namespace sightline {
namespace {

using test::connect_to;
using test::RunningServer;
using testing::HasSubstr;

std::string read_all(int fd) { return test::read_until(fd, ""); }

std::string ask(uint16_t port, const std::string& method, const std::string& path,
                const std::string& host = "localhost") {
  const UniqueFd fd = connect_to(port);
  const std::string request =
      method + " " + path + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n";
  send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
  return read_all(fd.get());
}

HttpOptions any_port() {
  HttpOptions options;
  options.port = 0;
  return options;
}

class HttpServerTest : public testing::Test {
 protected:
  void start(HttpOptions options = any_port()) {
    HttpContent content;
    content.registry = &registry_;
    content.health = [this] { return Health{healthy_, healthy_ ? "fine" : "render stands still"}; };
    content.state_json = [] { return R"({"cameras":2})"; };
    auto created = HttpServer::create(options, content);
    ASSERT_TRUE(created) << created.error().message();
    server_.reset();
    server_ = std::make_unique<RunningServer>(*std::move(created));
  }

  Registry registry_;
  std::atomic<bool> healthy_{true};
  std::unique_ptr<RunningServer> server_;
};

TEST(MetricsText, IsPrometheusExposition) {
  Registry registry;
  registry.counter("sightline_frames_total", "Frames taken", {{"camera", "left"}}).add(5);
  registry.counter("sightline_frames_total", "Frames taken", {{"camera", "a\"b\\c"}}).add(7);
  registry.gauge("sightline_rate_hz", "Rate").set(29.5);
  EXPECT_EQ(metrics_text(registry),
            "# HELP sightline_frames_total Frames taken\n"
            "# TYPE sightline_frames_total counter\n"
            "sightline_frames_total{camera=\"a\\\"b\\\\c\"} 7\n"
            "sightline_frames_total{camera=\"left\"} 5\n"
            "# HELP sightline_rate_hz Rate\n"
            "# TYPE sightline_rate_hz gauge\n"
            "sightline_rate_hz 29.5\n");
}

TEST_F(HttpServerTest, ServesMetricsHealthAndState) {
  registry_.counter("sightline_frames_total", "Frames", {}).add(3);
  start();
  const std::string metrics = ask(server_->port(), "GET", "/metrics");
  EXPECT_THAT(metrics, HasSubstr("200 OK"));
  EXPECT_THAT(metrics, HasSubstr("version=0.0.4"));
  EXPECT_THAT(metrics, HasSubstr("\nsightline_frames_total 3\n"));
  const std::string state = ask(server_->port(), "GET", "/api/state");
  EXPECT_THAT(state, HasSubstr("application/json"));
  EXPECT_THAT(state, HasSubstr(R"({"cameras":2})"));
  EXPECT_THAT(ask(server_->port(), "GET", "/healthz"), HasSubstr("200 OK"));
  healthy_ = false;
  const std::string ill = ask(server_->port(), "GET", "/healthz");
  EXPECT_THAT(ill, HasSubstr("503"));
  EXPECT_THAT(ill, HasSubstr("render stands still"));
}

TEST_F(HttpServerTest, HeadHasNoBody) {
  start();
  const std::string reply = ask(server_->port(), "HEAD", "/healthz");
  EXPECT_THAT(reply, HasSubstr("200 OK"));
  EXPECT_TRUE(reply.ends_with("\r\n\r\n"));
}

TEST_F(HttpServerTest, OtherPathsAndMethodsAreRefused) {
  start();
  for (const std::string path : {"/index.html", "/metrics/", "/../etc/passwd"}) {
    EXPECT_THAT(ask(server_->port(), "GET", path), HasSubstr("404")) << path;
  }
  for (const std::string method : {"POST", "PUT", "DELETE", "OPTIONS", "BREW"}) {
    const std::string reply = ask(server_->port(), method, "/metrics");
    EXPECT_THAT(reply, HasSubstr("405")) << method;
    EXPECT_THAT(reply, HasSubstr("Allow: GET, HEAD")) << method;
  }
}

TEST_F(HttpServerTest, AnswersToItsOwnNamesOnly) {
  start();
  for (const std::string host : {"localhost", "localhost:9754", "127.0.0.1:80", "[::1]:80"}) {
    EXPECT_THAT(ask(server_->port(), "GET", "/healthz", host), HasSubstr("200 OK")) << host;
  }
  for (const std::string host : {"evil.example", "127.evil.example", "localhost.evil.example",
                                 "[::1].evil", "localhost\r\nHost: evil.example"}) {
    EXPECT_THAT(ask(server_->port(), "GET", "/healthz", host), HasSubstr("403")) << host;
  }
}

TEST_F(HttpServerTest, AFailingCallbackIsAServerError) {
  HttpContent content;
  content.state_json = []() -> std::string { throw std::runtime_error("broken"); };
  auto created = HttpServer::create(any_port(), content);
  ASSERT_TRUE(created);
  const RunningServer server(*std::move(created));
  EXPECT_THAT(ask(server.port(), "GET", "/api/state"), HasSubstr("500"));
  EXPECT_THAT(ask(server.port(), "GET", "/healthz"), HasSubstr("200"));
  EXPECT_THAT(ask(server.port(), "GET", "/metrics"), HasSubstr("200"));
}

TEST_F(HttpServerTest, NonsenseDoesNotHurtIt) {
  HttpOptions options = any_port();
  options.deadline = std::chrono::seconds(1);  // half a request is waited for so long
  start(options);
  for (const std::string& request :
       {std::string("\r\n\r\n\r\n"), std::string("GET"), std::string(100'000, 'A'),
        std::string("GET / HTTP/9.9\r\n\r\n"), std::string(200, '\0'),
        std::string("GET /metrics HTTP/1.1\r\nContent-Length: -5\r\n\r\n")}) {
    const UniqueFd fd = connect_to(server_->port());
    send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
    shutdown(fd.get(), SHUT_WR);
    read_all(fd.get());
  }
  EXPECT_THAT(ask(server_->port(), "GET", "/healthz"), HasSubstr("200 OK"));
}

TEST_F(HttpServerTest, IdleConnectionsDoNotKeepOthersOut) {
  HttpOptions options = any_port();
  options.max_connections = 8;
  options.deadline = std::chrono::hours(1);
  start(options);
  std::vector<UniqueFd> idle;
  for (int i = 0; i < 20; ++i) idle.push_back(connect_to(server_->port()));
  EXPECT_THAT(ask(server_->port(), "GET", "/healthz"), HasSubstr("200 OK"));
}

/// Sends one byte after another, each as soon as the server has had time to see the one before,
/// until it closes; true if it did within 20 s.
bool closes_on_trickle(int fd) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (std::chrono::steady_clock::now() < end) {
    send(fd, "a", 1, MSG_NOSIGNAL);
    pollfd waiting{fd, POLLIN, 0};
    if (poll(&waiting, 1, 20) <= 0) continue;
    char byte = 0;
    if (recv(fd, &byte, 1, 0) <= 0) return true;
  }
  return false;
}

TEST_F(HttpServerTest, ARequestThatTricklesInEnds) {
  HttpOptions options = any_port();
  options.deadline = std::chrono::milliseconds(500);
  start(options);
  const std::string begin = "GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: ";
  const std::string whole = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (const std::string& sent : {std::string(), begin, whole, whole + begin}) {
    const UniqueFd fd = connect_to(server_->port());
    send(fd.get(), sent.data(), sent.size(), MSG_NOSIGNAL);
    EXPECT_TRUE(closes_on_trickle(fd.get())) << sent;
  }
}

TEST_F(HttpServerTest, AnAnswerThatIsNotReadEnds) {
  HttpContent content;
  content.state_json = [] { return std::string(16 << 20, 'x'); };  // more than the kernel takes
  HttpOptions options = any_port();
  options.deadline = std::chrono::milliseconds(500);
  auto created = HttpServer::create(options, content);
  ASSERT_TRUE(created);
  const RunningServer server(*std::move(created));
  const UniqueFd fd = connect_to(server.port());
  const std::string request = "GET /api/state HTTP/1.1\r\nHost: localhost\r\n\r\n";
  send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
  pollfd ended{fd.get(), POLLRDHUP, 0};
  EXPECT_EQ(poll(&ended, 1, 20'000), 1);
}

TEST_F(HttpServerTest, AConnectionServesManyRequests) {
  HttpOptions options = any_port();
  start(options);
  const UniqueFd fd = connect_to(server_->port());
  const std::string request = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    std::string answer;
    std::array<char, 4096> chunk;
    while (!answer.ends_with("fine\n")) {
      pollfd waiting{fd.get(), POLLIN, 0};
      ASSERT_EQ(poll(&waiting, 1, 20'000), 1) << i;
      const ssize_t got = recv(fd.get(), chunk.data(), chunk.size(), 0);
      ASSERT_GT(got, 0) << i;
      answer.append(chunk.data(), static_cast<size_t>(got));
    }
    ASSERT_THAT(answer, HasSubstr("200 OK"));
  }
}

TEST_F(HttpServerTest, ABusyPortIsAnErrorThatSaysWhatToDo) {
  start();
  HttpOptions options;
  options.port = server_->port();
  const auto second = HttpServer::create(options, {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text, HasSubstr(std::to_string(server_->port())));
}

TEST(HttpServerAddress, RemoteAddressesNeedPermission) {
  HttpOptions options = any_port();
  for (const std::string address : {"0.0.0.0", "::", "192.168.1.1", "128.0.0.1"}) {
    options.address = address;
    const auto refused = HttpServer::create(options, {});
    ASSERT_FALSE(refused) << address;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput) << address;
  }
  options.address = "0.0.0.0";
  options.open = true;
  auto allowed = HttpServer::create(options, {});
  ASSERT_TRUE(allowed) << allowed.error().message();
  const RunningServer server(*std::move(allowed));
  EXPECT_THAT(ask(server.port(), "GET", "/healthz", "192.168.1.7:80"), HasSubstr("200 OK"));
  EXPECT_THAT(ask(server.port(), "GET", "/healthz", "rig.example"), HasSubstr("403"));
  options.names = {"rig.example"};
  auto named = HttpServer::create(options, {});
  ASSERT_TRUE(named);
  const RunningServer named_server(*std::move(named));
  EXPECT_THAT(ask(named_server.port(), "GET", "/healthz", "Rig.example:9"), HasSubstr("200 OK"));
  EXPECT_THAT(ask(named_server.port(), "GET", "/healthz", "evil.example"), HasSubstr("403"));
}

TEST(HttpServerAddress, MustBeNumeric) {
  HttpOptions options = any_port();
  options.address = "localhost";
  const auto refused = HttpServer::create(options, {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("127.0.0.1"));
}

TEST_F(HttpServerTest, StartsAndStopsOftenWithoutLeavingPortsBehind) {
  for (int i = 0; i < 20; ++i) {
    start();
    const uint16_t port = server_->port();
    EXPECT_THAT(ask(port, "GET", "/healthz"), HasSubstr("200 OK"));
    server_.reset();
    EXPECT_FALSE(connect_to(port).is_open());
  }
}

}  // namespace
}  // namespace sightline
