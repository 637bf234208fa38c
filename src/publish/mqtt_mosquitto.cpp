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

constexpr Duration kFirstWait = 1s;  // between attempts to connect
constexpr int kGoodbyeTurns = 20;    // of 10 ms, for what is left to send
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
  MosquittoClient(const MqttOptions& options, MqttSession session)
      : options_(options), session_(std::move(session)) {}

  ~MosquittoClient() override {
    if (!connected_) return;
    if (!session_.will_topic.empty()) (void)publish(session_.will_topic, session_.will, true, 0);
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
    // A message that waits to be sent with the next one is an old one.
    mosquitto_int_option(client_.get(), MOSQ_OPT_TCP_NODELAY, 1);
    mosquitto_connect_callback_set(client_.get(), [](mosquitto*, void* self, int code) {
      static_cast<MosquittoClient*>(self)->on_answer(code);
    });
    mosquitto_message_callback_set(client_.get(),
                                   [](mosquitto*, void* self, const mosquitto_message* message) {
                                     static_cast<MosquittoClient*>(self)->on_message(*message);
                                   });
    if (!session_.will_topic.empty()) SL_RETURN_IF_ERROR(leave_will());
    if (!options_.user.empty()) SL_RETURN_IF_ERROR(log_in());
    if (options_.ca_file.empty()) return {};
    const auto file = [](const std::filesystem::path& path) {
      return path.empty() ? nullptr : path.c_str();
    };
    return check("use these certificates",
                 mosquitto_tls_set(client_.get(), options_.ca_file.c_str(), nullptr,
                                   file(options_.certificate), file(options_.key), nullptr));
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

  bool publish(const std::string& topic, const std::string& payload, bool retain,
               int qos) override {
    if (!connected_) return false;
    if (!mosquitto_want_write(client_.get())) waiting_ = 0;
    if (waiting_ + payload.size() > kMostWaiting) return false;
    const int code =
        mosquitto_publish(client_.get(), nullptr, topic.c_str(), static_cast<int>(payload.size()),
                          payload.data(), qos, retain);
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

  // A session without a topic for it has no will, as of somebody who only listens.
  Status leave_will() {
    return check("say the last will", mosquitto_will_set(client_.get(), session_.will_topic.c_str(),
                                                         static_cast<int>(session_.will.size()),
                                                         session_.will.data(), 1, true));
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
    const int code = mosquitto_connect(client_.get(), options_.host.c_str(), options_.port,
                                       session_.keep_alive_s);
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
    for (const MqttSession::Subscription& to : session_.subscriptions) {
      mosquitto_subscribe(client_.get(), nullptr, to.topic.c_str(), to.qos);
    }
    if (session_.on_connect) session_.on_connect();
  }

  void on_message(const mosquitto_message& message) const {
    if (!session_.on_message || message.topic == nullptr || message.payloadlen < 0) return;
    session_.on_message(
        message.topic,
        {static_cast<const char*>(message.payload), static_cast<size_t>(message.payloadlen)},
        message.retain);
  }

  void lose(int code) {
    connected_ = false;
    // The library says less of it than the broker's answer did.
    const bool answered = code == MOSQ_ERR_CONN_LOST || code == MOSQ_ERR_CONN_REFUSED;
    if (!answered || !problem_.starts_with(kRefused)) {
      problem_ = code == MOSQ_ERR_ERRNO ? std::strerror(errno) : mosquitto_strerror(code);
    }
    wait_ = std::clamp<Duration>(2 * wait_, kFirstWait, session_.longest_wait);
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
  const MqttSession session_;
  std::unique_ptr<mosquitto, Free> client_;
  bool connected_ = false;
  std::string problem_;
  size_t waiting_ = 0;  // [bytes] that the socket has not taken yet, at most
  Duration wait_{};
  Time next_try_{};
};

}  // namespace

bool mqtt_available() { return true; }

Result<std::unique_ptr<MqttClient>> MqttClient::create(const MqttOptions& options,
                                                       MqttSession session) {
  auto client = std::make_unique<MosquittoClient>(options, std::move(session));
  SL_RETURN_IF_ERROR(client->start());
  return std::unique_ptr<MqttClient>(std::move(client));
}

Result<std::unique_ptr<MqttClient>> MqttClient::create(const MqttOptions& options) {
  const auto made = std::make_shared<MqttClient*>(nullptr);
  MqttSession session;
  session.will_topic = options.topic + "/status";
  session.will = "offline";
  session.on_connect = [made, topic = session.will_topic] {
    if (*made != nullptr) (void)(*made)->publish(topic, "online", true);
  };
  SL_ASSIGN(auto client, create(options, std::move(session)));
  *made = client.get();
  return client;
}

}  // namespace sightline
