// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "control/http_client.hpp"
#include "control/router.hpp"

namespace sightline {
namespace {

using test::ask_with;
using test::connect_to;
using test::read_until;
using test::RunningServer;
using testing::HasSubstr;
using testing::Not;

const std::string kJson = "Content-Type: application/json";

std::string route_key(const control::Route& route) {
  return std::string(route.method) + " " + std::string(route.pattern);
}

TEST(OpenApi, DescribesEveryPathThatIsServedWithItsRole) {
  const auto found =
      std::ranges::find(control::assets(), "/api/v1/openapi.json", &control::Asset::path);
  ASSERT_NE(found, control::assets().end());
  const auto described = nlohmann::json::parse(found->bytes);
  std::set<std::string> documented, served;
  for (const auto& [path, methods] : described["paths"].items()) {
    for (const auto& [method, what] : methods.items()) {
      std::string name = method + " " + path;
      std::ranges::transform(name.begin(), name.begin() + static_cast<int>(method.size()),
                             name.begin(), [](unsigned char c) { return std::toupper(c); });
      documented.insert(name + " " + what["x-role"].get<std::string>());
    }
  }
  const std::set<std::string> page = {"GET /", "GET /app.js", "GET /style.css", "GET /icon.svg"};
  for (const control::Route& route : control::routes()) {
    const char* const role = route.role == Role::kOperator ? "operator"
                             : route.role == Role::kViewer ? "viewer"
                                                           : "none";
    if (!page.contains(route_key(route))) served.insert(route_key(route) + " " + role);
  }
  EXPECT_EQ(documented, served);
}

/// Chunks as a test sets them.
class FedStream : public HttpStream {
 public:
  bool ready() override { return pieces_left > 0; }
  Chunk next() override {
    if (pieces_left == 0) return nullptr;
    --pieces_left;
    ++made;
    return std::make_shared<const std::string>(piece);
  }
  bool ended() const override { return over; }
  std::string piece = "piece\n";
  std::atomic<int> pieces_left{0}, made{0};
  std::atomic<bool> over{false};
};

class Api : public testing::Test {
 protected:
  void start(HttpOptions options = {}) {
    auto waker = HttpWaker::create();
    ASSERT_TRUE(waker);
    waker_ = *waker;
    HttpContent content;
    content.waker = waker_;
    content.ready = [] { return Health{false, "no camera"}; };
    content.camera_json = [](const std::string& name) -> std::optional<std::string> {
      if (name != "left") return std::nullopt;
      return "{\"name\":\"left\"}";
    };
    content.hint = [this](const std::string& object, const HintRequest& hint) -> Status {
      if (object != "box") return make_error(ErrorCode::kNotFound, object, "no such object");
      hint_ = hint;
      return {};
    };
    content.reload = [this]() -> Status {
      ++reloads_;
      return {};
    };
    content.start_capture = [this](const CaptureOrder& order) {
      capture_ = order;
      return HttpReply{202, "application/json", "{}\n"};
    };
    content.events = [this](bool) { return stream_; };
    content.snapshot = [this](const PictureRequest& request) -> Result<HttpReply> {
      pictures_ = request;
      HttpReply reply;
      reply.later = [this, asked = 0]() mutable -> std::optional<HttpReply> {
        if (++asked < 3) return std::nullopt;
        return HttpReply{200, "image/jpeg", "picture"};
      };
      return reply;
    };
    options.port = 0;
    auto created = HttpServer::create(options, content);
    ASSERT_TRUE(created) << created.error().message();
    server_ = std::make_unique<RunningServer>(*std::move(created));
  }
  std::string ask(const std::string& method, const std::string& path,
                  const std::vector<std::string>& headers = {}, const std::string& body = "") {
    return ask_with(server_->port(), method, path, headers, body);
  }
  std::string hint(const std::string& body) {
    return ask("POST", "/api/v1/objects/box/hint", {kJson}, body);
  }

  std::shared_ptr<HttpWaker> waker_;
  std::optional<HintRequest> hint_;
  std::optional<PictureRequest> pictures_;
  std::optional<CaptureOrder> capture_;
  std::atomic<int> reloads_{0};
  std::shared_ptr<FedStream> stream_ = std::make_shared<FedStream>();
  std::unique_ptr<RunningServer> server_;  // last: its thread uses the rest
};

TEST_F(Api, NamesInPathsAreLookedUp) {
  start();
  EXPECT_THAT(ask("GET", "/api/v1/cameras/left"), HasSubstr("200 OK"));
  EXPECT_THAT(ask("GET", "/api/v1/cameras/%6Ceft"), HasSubstr("200 OK"));
  for (const std::string path : {"/api/v1/cameras/right", "/api/v1/cameras/", "/api/v2/state",
                                 "/api/v1/cameras/left/x", "/api/v1/cameras/..%2Fleft"}) {
    EXPECT_THAT(ask("GET", path), HasSubstr("404")) << path;
  }
  EXPECT_THAT(ask("GET", "/readyz"), HasSubstr("503"));
}

TEST_F(Api, AHintInAPictureAndAHintOfAPoseArrive) {
  start();
  EXPECT_THAT(hint(R"({"camera":"left","x":12.5,"y":7,"radius_px":30})"), HasSubstr("202"));
  ASSERT_TRUE(hint_);
  const auto place = std::get<HintRequest::Place>(hint_->where);
  EXPECT_EQ(place.camera, "left");
  EXPECT_EQ(place.pixel, Eigen::Vector2d(12.5, 7));
  EXPECT_EQ(place.radius_px, 30);
  EXPECT_THAT(hint(R"({"translation_m":[1,2,3],"rotation_wxyz":[0,1,0,0]})"), HasSubstr("202"));
  EXPECT_EQ(std::get<Rigid3>(hint_->where).translation, Eigen::Vector3d(1, 2, 3));
}

TEST_F(Api, AHintThatIsNotExactlyOneIsRefusedByName) {
  start();
  const std::pair<const char*, const char*> bad[] = {
      {"", "not JSON"},
      {"[]", "JSON object"},
      {"{", "not JSON"},
      {"{}", "say where"},
      {R"({"camera":"left","x":1})", "\\\"y\\\" is missing"},
      {R"({"camera":"left","x":1,"y":"2"})", "\\\"y\\\" has to be a number"},
      {R"({"camera":"left","x":1,"y":2,"z":3})", "\\\"z\\\" is not known"},
      {R"({"camera":"left","x":1,"x":2,"y":2})", "a key twice: x"},
      {R"({"camera":"left","x":1e999,"y":2})", ""},
      {R"({"camera":"left","x":1,"y":2,"radius_px":-1})", "radius_px"},
      {R"({"camera":7,"x":1,"y":2})", "camera"},
      {R"({"translation_m":[1,2],"rotation_wxyz":[1,0,0,0]})", "translation_m"},
      {R"({"translation_m":[1,2,3],"rotation_wxyz":[1,1,0,0]})", "unit quaternion"},
      {R"({"camera":[[[[[[1]]]]]],"x":1,"y":2})", "nested"},
      {"{\"camera\":\"\xff\",\"x\":1,\"y\":2}", ""},
  };
  for (const auto& [body, text] : bad) {
    const std::string reply = hint(body);
    EXPECT_THAT(reply, HasSubstr("400")) << body;
    EXPECT_THAT(reply, HasSubstr(text)) << body;
  }
  EXPECT_FALSE(hint_);
  EXPECT_THAT(ask("POST", "/api/v1/objects/ball/hint", {kJson}, R"({"camera":"a","x":1,"y":1})"),
              HasSubstr("404"));
}

TEST_F(Api, AnOrderToCaptureArrivesAndNothingElseDoes) {
  start();
  const auto order = [this](const std::string& body) {
    return ask("POST", "/api/v1/calibration/capture/start", {kJson}, body);
  };
  const std::pair<const char*, const char*> bad[] = {
      {R"({"target":7})", "\\\"target\\\" has to be a text"},
      {R"({"target":""})", "has to be a text"},
      {R"({"target":"a","target_toml":"b"})", "one too many"},
      {R"({"moving":"yes"})", "\\\"moving\\\" has to be true or false"},
      {R"({"readouts":true})", "needs \\\"moving\\\""},
      {R"({"cameras":[]})", "list of names"},
      {R"({"cameras":[1]})", "list of names"},
      {R"({"folder":"/tmp"})", "\\\"folder\\\" is not known"},
      {R"([])", "JSON object"},
  };
  for (const auto& [body, text] : bad) {
    const std::string reply = order(body);
    EXPECT_THAT(reply, HasSubstr("400")) << body;
    EXPECT_THAT(reply, HasSubstr(text)) << body;
  }
  EXPECT_FALSE(capture_);
  EXPECT_THAT(order(""), HasSubstr("202"));
  EXPECT_TRUE(capture_->target.empty() && capture_->cameras.empty() && !capture_->keep_lenses);
  EXPECT_THAT(order(R"({"target":"a.toml","cameras":["left"],"keep_lenses":true,"resume":true})"),
              HasSubstr("202"));
  EXPECT_EQ(capture_->target, "a.toml");
  EXPECT_EQ(capture_->cameras, std::vector<std::string>{"left"});
  EXPECT_TRUE(capture_->keep_lenses && capture_->resume && !capture_->moving);
  EXPECT_THAT(order(R"({"moving":true,"readouts":true})"), HasSubstr("202"));
  EXPECT_TRUE(capture_->moving && capture_->readouts);
}

TEST_F(Api, BodiesHaveALimitAndAType) {
  start();
  const std::string hint_path = "/api/v1/objects/box/hint";
  const std::string large(HttpServer::kMostBody + 1, ' ');
  EXPECT_THAT(ask("POST", hint_path, {kJson}, large), HasSubstr("413"));
  // Without a length it is found out on the way.
  std::string chunked;
  for (int i = 0; i < 5; ++i) chunked += "4000\r\n" + std::string(0x4000, ' ') + "\r\n";
  const UniqueFd fd = connect_to(server_->port());
  const std::string head = "POST " + hint_path + " HTTP/1.1\r\nHost: localhost\r\n" + kJson +
                           "\r\nTransfer-Encoding: chunked\r\n\r\n";
  send(fd.get(), (head + chunked).data(), head.size() + chunked.size(), MSG_NOSIGNAL);
  EXPECT_THAT(read_until(fd.get(), ""), Not(HasSubstr("202")));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {}, "{}"), HasSubstr("415"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {"Content-Type: text/plain"}, "{}"), HasSubstr("415"));
  EXPECT_EQ(reloads_, 0);
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson + "; charset=utf-8"}, "{}"), HasSubstr("202"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson}, "{\"a\":1}"), HasSubstr("400"));
  EXPECT_EQ(reloads_, 1);
  EXPECT_THAT(ask("GET", "/api/v1/reload"), HasSubstr("405"));
}

TEST_F(Api, PagesOfOtherSitesMayNotAsk) {
  start();
  const std::string own = "Origin: http://localhost", other = "Origin: http://evil.example";
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson, own}, "{}"), HasSubstr("202"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson, other}, "{}"), HasSubstr("403"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson, "Origin: null"}, "{}"), HasSubstr("403"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson, "Sec-Fetch-Site: cross-site"}, "{}"),
              HasSubstr("403"));
  EXPECT_EQ(reloads_, 1);
  EXPECT_THAT(ask("GET", "/healthz", {"Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: no-cors"}),
              HasSubstr("403"));
  EXPECT_THAT(ask("GET", "/healthz", {"Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: navigate"}),
              HasSubstr("200 OK"));
  EXPECT_THAT(ask("GET", "/healthz", {other}), HasSubstr("403"));
}

TEST_F(Api, AnAnswerMayTakeAMoment) {
  start();
  const std::string reply = ask("GET", "/cameras/left/snapshot.jpg?annotated=0");
  EXPECT_THAT(reply, HasSubstr("200 OK"));
  EXPECT_THAT(reply, HasSubstr("picture"));
  ASSERT_TRUE(pictures_);
  EXPECT_EQ(pictures_->cameras, std::vector<std::string>{"left"});
  EXPECT_FALSE(pictures_->annotated);
  for (const std::string query : {"annotated=2", "annotated=1&annotated=1", "scale=2",
                                  "camera=right", "rate_hz=0", "rate_hz=nan"}) {
    EXPECT_THAT(ask("GET", "/cameras/left/snapshot.jpg?" + query), HasSubstr("400")) << query;
  }
}

TEST_F(Api, AStreamRestsUntilItIsWokenAndEnds) {
  start();
  const UniqueFd fd = connect_to(server_->port());
  const std::string request = "GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n";
  send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
  EXPECT_THAT(read_until(fd.get(), "\r\n\r\n"), HasSubstr("text/event-stream"));
  for (int i = 0; i < 3; ++i) {
    stream_->pieces_left = 1;
    waker_->wake();
    EXPECT_EQ(read_until(fd.get(), "piece\n"), "piece\n");
  }
  stream_->over = true;
  stream_->pieces_left = 1;
  waker_->wake();
  EXPECT_EQ(read_until(fd.get(), ""), "piece\n");
}

TEST_F(Api, AReaderThatStopsIsCutOffAndHarmsNobody) {
  HttpOptions options;
  options.deadline = std::chrono::milliseconds(500);
  stream_->piece = std::string(1 << 20, 'x');
  stream_->pieces_left = 1'000'000;
  start(options);
  const UniqueFd fd = connect_to(server_->port());
  const std::string request = "GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n";
  send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
  EXPECT_THAT(ask("GET", "/api/v1/cameras/left"), HasSubstr("200 OK"));
  pollfd ended{fd.get(), POLLRDHUP, 0};
  EXPECT_EQ(poll(&ended, 1, 20'000), 1);
  EXPECT_LT(stream_->made, 100);  // no more was made than the kernel took
}

TEST_F(Api, StreamsHaveALimit) {
  HttpOptions options;
  options.max_streams = 2;
  start(options);
  const std::string request = "GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n";
  std::vector<UniqueFd> held;
  for (int i = 0; i < 2; ++i) {
    held.push_back(connect_to(server_->port()));
    send(held.back().get(), request.data(), request.size(), MSG_NOSIGNAL);
    EXPECT_THAT(read_until(held.back().get(), "\r\n\r\n"), HasSubstr("200 OK"));
  }
  EXPECT_THAT(ask("GET", "/api/v1/events"), HasSubstr("503"));
  EXPECT_THAT(ask("GET", "/healthz"), HasSubstr("200 OK"));
  held.clear();
  stream_->pieces_left = 1000;  // whoever has gone is noticed when something is sent
  std::string reply;
  for (int i = 0; i < 200 && reply.find("200 OK") == std::string::npos; ++i) {
    const UniqueFd fd = connect_to(server_->port());
    send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
    reply = read_until(fd.get(), "\r\n\r\n");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_THAT(reply, HasSubstr("200 OK"));
}

class TokenFile {
 public:
  explicit TokenFile(const std::string& text, int mode = 0600) {
    path = std::filesystem::temp_directory_path() /
           ("sightline_tokens_" + std::to_string(getpid()) + "_" + std::to_string(++count_));
    std::ofstream(path) << text;
    std::filesystem::permissions(path, static_cast<std::filesystem::perms>(mode));
  }
  ~TokenFile() { std::filesystem::remove(path); }
  std::filesystem::path path;

 private:
  static inline int count_ = 0;
};

constexpr const char* kTokens =
    "# who may come\n"
    "anna operator  0123456789abcdef-anna\n"
    "wall viewer    0123456789abcdef-wall\n";

TEST_F(Api, RolesAreHeldApart) {
  const TokenFile file(kTokens);
  HttpOptions options;
  options.tokens = file.path;
  start(options);
  const std::string anna = "Authorization: Bearer 0123456789abcdef-anna";
  const std::string wall = "Authorization: Bearer 0123456789abcdef-wall";
  const std::string basic = "Authorization: Basic eDowMTIzNDU2Nzg5YWJjZGVmLXdhbGw=";  // x:...-wall
  EXPECT_THAT(ask("GET", "/healthz"), HasSubstr("200 OK"));
  const std::string refused = ask("GET", "/api/v1/cameras/left");
  EXPECT_THAT(refused, HasSubstr("401"));
  EXPECT_THAT(refused, HasSubstr("WWW-Authenticate: Basic"));
  EXPECT_THAT(ask("GET", "/metrics"), HasSubstr("401"));
  for (const std::string& who : {anna, wall, basic}) {
    EXPECT_THAT(ask("GET", "/api/v1/cameras/left", {who}), HasSubstr("200 OK")) << who;
  }
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson, wall}, "{}"), HasSubstr("403"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson}, "{}"), HasSubstr("401"));
  EXPECT_EQ(reloads_, 0);
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson, anna}, "{}"), HasSubstr("202"));
  EXPECT_EQ(reloads_, 1);
}

TEST_F(Api, GuessesAreLimitedAndNotRewarded) {
  const TokenFile file(kTokens);
  HttpOptions options;
  options.tokens = file.path;
  start(options);
  for (int i = 0; i < 10; ++i) {
    EXPECT_THAT(ask("GET", "/metrics", {"Authorization: Bearer guess" + std::to_string(i)}),
                HasSubstr("401"));
  }
  const std::string late = ask("GET", "/metrics", {"Authorization: Bearer 0123456789abcdef-anna"});
  EXPECT_THAT(late, HasSubstr("429"));
  EXPECT_THAT(late, HasSubstr("Retry-After"));
  EXPECT_THAT(ask("GET", "/healthz"), HasSubstr("200 OK"));
}

TEST_F(Api, OpenWithTokensLetsEverybodyWatchAndNobodyOperate) {
  const TokenFile file(kTokens);
  HttpOptions options;
  options.address = "0.0.0.0";
  options.open = true;
  options.tokens = file.path;
  start(options);
  EXPECT_THAT(ask("GET", "/api/v1/cameras/left"), HasSubstr("200 OK"));
  EXPECT_THAT(ask("POST", "/api/v1/reload", {kJson}, "{}"), HasSubstr("401"));
}

TEST(Tokens, AreReadStrictlyAndNeverRepeated) {
  const std::string secret = "0123456789abcdef0123";
  const std::pair<std::string, const char*> bad[] = {
      {"", "holds no token"},
      {"anna operator", "file:1: expected NAME ROLE TOKEN"},
      {"anna operator " + secret + " more", "file:1: expected"},
      {"\nanna admin " + secret, "file:2: the role"},
      {"an/na viewer " + secret, "file:1: a name"},
      {"anna viewer short", "file:1: a token has 16"},
      {"anna viewer " + secret + "\nanna viewer " + secret + "x", "file:2: has the name"},
      {"anna viewer " + secret + "\nbob viewer " + secret, "file:2: has the token"},
  };
  for (const auto& [text, error] : bad) {
    const auto tokens = parse_tokens(text, "file");
    ASSERT_FALSE(tokens) << text;
    EXPECT_THAT(tokens.error().message(), HasSubstr(error)) << text;
    EXPECT_THAT(tokens.error().message(), Not(HasSubstr(secret))) << text;
  }
  const auto good = parse_tokens("anna operator " + secret + " # hers\r\n", "file");
  ASSERT_TRUE(good) << good.error().message();
  EXPECT_EQ(*good, (std::vector<AccessToken>{{"anna", Role::kOperator, secret}}));
}

TEST(Tokens, AFileThatEverybodyReadsIsRefused) {
  const TokenFile open(kTokens, 0644), closed(kTokens, 0640);
  EXPECT_TRUE(read_tokens(closed.path));
  const auto refused = read_tokens(open.path);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message(), HasSubstr("chmod o="));
  EXPECT_FALSE(read_tokens("/nowhere/at/all"));
  EXPECT_FALSE(read_tokens("credential:../x"));
}

}  // namespace
}  // namespace sightline
