// SPDX-License-Identifier: Apache-2.0
#include <mosquitto.h>
#include <poll.h>

#include <algorithm>
#include <cstring>

#include "sightline/base/files.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/publish/mqtt.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kFirstWait = 1s, kMaxWait = 30s;  // between attempts to connect
constexpr int kKeepAlive_s = 15;                     // a broker that is silent for longer is gone
constexpr int kGoodbyeTurns = 20;                    // of 10 ms, for what is left to send
constexpr const char* kRefused = "the broker refuses: ";
constexpr size_t kMostPassword = 4096;

void init_library() {
  static const bool done = [] { return mosquitto_lib_init() == MOSQ_ERR_SUCCESS; }();
  (void)done;
}

struct Free {
  void operator()(mosquitto* client) const { mosquitto_destroy(client); }
};

class MosquittoClient final : public MqttClient {
 public:
  explicit MosquittoClient(const MqttOptions& options)
      : options_(options), status_topic_(options.topic + "/status") {}

  ~MosquittoClient() override {
    if (!connected_) return;
    (void)publish(status_topic_, "offline", true);
    mosquitto_disconnect(client_.get());
    for (int i = 0; i < kGoodbyeTurns && mosquitto_want_write(client_.get()); ++i) {
      turn(10ms, -1);
    }
  }

  Status start() {
    init_library();
    const char* id = options_.client_id.empty() ? nullptr : options_.client_id.c_str();
    client_.reset(mosquitto_new(id, true, this));
    if (!client_) {
      return make_error(ErrorCode::kInternal, options_.host, "no MQTT client could be made");
    }
    mosquitto_connect_callback_set(client_.get(), [](mosquitto*, void* self, int code) {
      static_cast<MosquittoClient*>(self)->on_answer(code);
    });
    SL_RETURN_IF_ERROR(
        check("say the last will",
              mosquitto_will_set(client_.get(), status_topic_.c_str(), 7, "offline", 1, true)));
    if (!options_.user.empty()) SL_RETURN_IF_ERROR(log_in());
    if (options_.ca_file.empty()) return {};
    return check("use this ca_file", mosquitto_tls_set(client_.get(), options_.ca_file.c_str(),
                                                       nullptr, nullptr, nullptr, nullptr));
  }

  void step(Duration timeout, int wake_fd) override {
    if (mosquitto_socket(client_.get()) < 0) {
      const Time now = MonotonicClock::now();
      if (now < next_try_) {
        pollfd wake{wake_fd, POLLIN, 0};
        wait(&wake, 1, std::min<Duration>(timeout, next_try_ - now));
        return;
      }
      connect();
    }
    turn(timeout, wake_fd);
  }

  bool connected() const override { return connected_; }
  std::string problem() const override { return problem_; }

  bool publish(const std::string& topic, const std::string& payload, bool retain) override {
    if (!connected_) return false;
    if (!mosquitto_want_write(client_.get())) waiting_ = 0;
    if (waiting_ + payload.size() > kMostWaiting) return false;
    const int code = mosquitto_publish(client_.get(), nullptr, topic.c_str(),
                                       static_cast<int>(payload.size()), payload.data(), 0, retain);
    if (mosquitto_want_write(client_.get())) waiting_ += payload.size();
    if (code == MOSQ_ERR_SUCCESS) return true;
    lose(code);
    return false;
  }

 private:
  Status check(const char* tried, int code) const {
    if (code == MOSQ_ERR_SUCCESS) return {};
    return make_error(ErrorCode::kInvalidInput, options_.host, "cannot {}: {}", tried,
                      code == MOSQ_ERR_ERRNO ? std::strerror(errno) : mosquitto_strerror(code));
  }

  Status log_in() {
    std::string password;
    if (!options_.password_file.empty()) {
      SL_ASSIGN(password, read_file(options_.password_file, kMostPassword));
      password = password.substr(0, password.find_first_of("\r\n"));
    }
    return check("log in so",
                 mosquitto_username_pw_set(client_.get(), options_.user.c_str(), password.c_str()));
  }

  void connect() {
    const Waiting wait("the MQTT broker");
    const int code =
        mosquitto_connect(client_.get(), options_.host.c_str(), options_.port, kKeepAlive_s);
    if (code != MOSQ_ERR_SUCCESS) lose(code);
  }

  void on_answer(int code) {
    connected_ = code == 0;
    if (code != 0) {
      problem_ = std::string(kRefused) + mosquitto_connack_string(code);
      return;
    }
    problem_.clear();
    wait_ = {};
    waiting_ = 0;
    (void)publish(status_topic_, "online", true);
  }

  void lose(int code) {
    connected_ = false;
    // The library says less of it than the broker's answer did.
    const bool answered = code == MOSQ_ERR_CONN_LOST || code == MOSQ_ERR_CONN_REFUSED;
    if (!answered || !problem_.starts_with(kRefused)) {
      problem_ = code == MOSQ_ERR_ERRNO ? std::strerror(errno) : mosquitto_strerror(code);
    }
    wait_ = std::clamp<Duration>(2 * wait_, kFirstWait, kMaxWait);
    next_try_ = MonotonicClock::now() + wait_;
  }

  static void wait(pollfd* fds, nfds_t count, Duration timeout) {
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
    (void)::poll(fds, count, static_cast<int>(std::max<int64_t>(ms, 0)));
  }

  void turn(Duration timeout, int wake_fd) {
    const int socket = mosquitto_socket(client_.get());
    if (socket < 0) return;
    const bool write = mosquitto_want_write(client_.get());
    const auto events = static_cast<short>(write ? POLLIN | POLLOUT : POLLIN);
    pollfd fds[2] = {{socket, events, 0}, {wake_fd, POLLIN, 0}};
    wait(fds, 2, timeout);
    int code = MOSQ_ERR_SUCCESS;
    if (fds[0].revents & (POLLIN | POLLERR | POLLHUP)) code = mosquitto_loop_read(client_.get(), 1);
    if (code == MOSQ_ERR_SUCCESS && (fds[0].revents & POLLOUT)) {
      code = mosquitto_loop_write(client_.get(), 1);
    }
    if (code == MOSQ_ERR_SUCCESS) code = mosquitto_loop_misc(client_.get());
    if (code != MOSQ_ERR_SUCCESS) lose(code);
  }

  const MqttOptions options_;
  const std::string status_topic_;
  std::unique_ptr<mosquitto, Free> client_;
  bool connected_ = false;
  std::string problem_;
  size_t waiting_ = 0;  // [bytes] that the socket has not taken yet, at most
  Duration wait_{};
  Time next_try_{};
};

}  // namespace

bool mqtt_available() { return true; }

Result<std::unique_ptr<MqttClient>> MqttClient::create(const MqttOptions& options) {
  auto client = std::make_unique<MosquittoClient>(options);
  SL_RETURN_IF_ERROR(client->start());
  return std::unique_ptr<MqttClient>(std::move(client));
}

}  // namespace sightline
