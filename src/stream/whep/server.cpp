// SPDX-License-Identifier: Apache-2.0
#include <gst/gst.h>
#include <malloc.h>
#include <sys/random.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>

#include "sightline/base/log.hpp"
#include "sightline/stream/whep.hpp"
#include "stream/whep/peer.hpp"

namespace sightline {

using namespace stream;
using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 100ms;  // looks at its viewers so often while there are any
constexpr Duration kTick = 500ms;
// What the first viewer would wait for is made ready then: it takes half a second of a core, which
// those who look for the objects need when a daemon begins. A viewer that is there sooner waits.
constexpr Duration kWarmUpAfter = 3s;

class Pending : public WhepPending {
 public:
  std::optional<Result<WhepAnswer>> answer() const override {
    std::lock_guard lock(mutex_);
    return answer_;
  }
  void set(Result<WhepAnswer> answer) {
    std::lock_guard lock(mutex_);
    answer_ = std::move(answer);
  }

 private:
  mutable std::mutex mutex_;
  std::optional<Result<WhepAnswer>> answer_;
};

struct Job {
  std::string camera, sdp, address;
  std::shared_ptr<Pending> pending;
  std::function<void()> on_answer;
};

/// 128 bits that nobody guesses, in hexadecimal.
std::string secret_id() {
  unsigned char bytes[16];
  SL_CHECK(::getrandom(bytes, sizeof bytes, 0) == sizeof bytes, "the kernel has random bytes");
  std::string text;
  for (const unsigned char byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

// What a browser offers, for the session that warms up.
constexpr const char* kWarmOffer =
    "v=0\r\no=- 1 2 IN IP4 127.0.0.1\r\ns=-\r\nt=0 0\r\na=group:BUNDLE 0\r\n"
    "m=video 9 UDP/TLS/RTP/SAVPF 102\r\nc=IN IP4 0.0.0.0\r\na=rtcp:9 IN IP4 0.0.0.0\r\n"
    "a=ice-ufrag:abcd\r\na=ice-pwd:abcdefghijklmnopqrstuvwx\r\n"
    "a=fingerprint:sha-256 00:01:02:03:04:05:06:07:08:09:0A:0B:0C:0D:0E:0F:10:11:12:13:14:15:16:17:"
    "18:19:1A:1B:1C:1D:1E:1F\r\na=setup:actpass\r\na=mid:0\r\na=recvonly\r\na=rtcp-mux\r\n"
    "a=rtpmap:102 H264/90000\r\na=rtcp-fb:102 nack\r\na=rtcp-fb:102 nack pli\r\n"
    "a=fmtp:102 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f\r\n";

class Server : public WhepServer {
 public:
  explicit Server(const WhepOptions& options) : options_(options) {}

  std::shared_ptr<WhepStream> stream(const std::string& camera) override;
  void keep_only(const std::vector<std::string>& cameras) override;
  std::shared_ptr<WhepPending> offer(const std::string& camera, std::string sdp,
                                     std::string address, std::function<void()> on_answer) override;
  bool end(const std::string& id) override;
  void set_max_viewers(int most) override;
  int sessions() const override;
  void run(std::stop_token stop, const std::function<void()>& on_tick) override;

 private:
  void warm_up();
  void answer(const Job& job);
  Result<WhepAnswer> welcome(const Job& job);
  void look_after(Time now);
  std::vector<std::unique_ptr<Peer>> take_leaving(Time now);
  void close();

  mutable std::mutex mutex_;
  WhepOptions options_;
  std::condition_variable_any changed_;
  std::map<std::string, std::shared_ptr<FanOut>> streams_;
  std::deque<Job> jobs_;
  std::map<std::string, std::unique_ptr<Peer>> peers_;
  std::vector<std::string> to_end_;
  int being_answered_ = 0;
  bool closed_ = false;
};

std::shared_ptr<WhepStream> Server::stream(const std::string& camera) {
  std::lock_guard lock(mutex_);
  auto& stream = streams_[camera];
  if (!stream) stream = std::make_shared<FanOut>();
  return stream;
}

void Server::keep_only(const std::vector<std::string>& cameras) {
  std::lock_guard lock(mutex_);
  std::erase_if(streams_, [&](const auto& entry) {
    return std::ranges::find(cameras, entry.first) == cameras.end();
  });
  changed_.notify_all();
}

std::shared_ptr<WhepPending> Server::offer(const std::string& camera, std::string sdp,
                                           std::string address, std::function<void()> on_answer) {
  auto pending = std::make_shared<Pending>();
  std::lock_guard lock(mutex_);
  const size_t now = peers_.size() + jobs_.size() + static_cast<size_t>(being_answered_);
  if (closed_) {
    pending->set(make_error(ErrorCode::kUnavailable, "whep", "the daemon is being stopped"));
  } else if (now >= static_cast<size_t>(options_.max_viewers)) {
    pending->set(make_error(ErrorCode::kUnavailable, "whep",
                            "{} viewers are connected, and more are not served", now));
  } else {
    jobs_.push_back({camera, std::move(sdp), std::move(address), pending, std::move(on_answer)});
    changed_.notify_all();
  }
  return pending;
}

bool Server::end(const std::string& id) {
  std::lock_guard lock(mutex_);
  if (!peers_.contains(id) || std::ranges::find(to_end_, id) != to_end_.end()) return false;
  to_end_.push_back(id);
  changed_.notify_all();
  return true;
}

int Server::sessions() const {
  std::lock_guard lock(mutex_);
  return static_cast<int>(peers_.size()) + being_answered_;
}

void Server::set_max_viewers(int most) {
  std::lock_guard lock(mutex_);
  options_.max_viewers = most;
}

void Server::warm_up() {
  const Time start = MonotonicClock::now();
  const auto offer = read_offer(kWarmOffer);
  const auto peer = offer ? Peer::create("warm", std::make_shared<FanOut>(), *offer, "127.0.0.1")
                          : Result<std::unique_ptr<Peer>>(offer.error());
  if (!peer) {
    log::warning("whep: WebRTC does not work here: {}", peer.error().message());
    return;
  }
  log::debug("whep: warm after {:.0f} ms", 1e3 * to_seconds(MonotonicClock::now() - start));
}

void Server::answer(const Job& job) {
  auto answer = welcome(job);
  if (!answer) log::info("whep: {}: refused: {}", job.camera, answer.error().message());
  job.pending->set(std::move(answer));
  if (job.on_answer) job.on_answer();
}

Result<WhepAnswer> Server::welcome(const Job& job) {
  std::shared_ptr<FanOut> stream;
  {
    std::lock_guard lock(mutex_);
    const auto found = streams_.find(job.camera);
    if (found == streams_.end()) {
      return make_error(ErrorCode::kNotFound, job.camera, "no camera of that name streams");
    }
    stream = found->second;
  }
  SL_ASSIGN(const ViewerOffer offer, read_offer(job.sdp));
  const std::string id = secret_id();
  SL_ASSIGN(auto peer, Peer::create(id, std::move(stream), offer, job.address));
  WhepAnswer answer{id, peer->answer()};
  std::lock_guard lock(mutex_);
  peers_.emplace(id, std::move(peer));
  being_answered_ = 0;
  return answer;
}

/// Those whose time has come; ended outside the lock.
std::vector<std::unique_ptr<Peer>> Server::take_leaving(Time now) {
  std::vector<std::unique_ptr<Peer>> leaving;
  std::lock_guard lock(mutex_);
  const auto has_stream = [this](const Peer& peer) {
    return std::ranges::any_of(
        streams_, [&](const auto& entry) { return entry.second.get() == peer.stream(); });
  };
  for (auto it = peers_.begin(); it != peers_.end();) {
    const bool told = std::ranges::find(to_end_, it->first) != to_end_.end();
    Peer& peer = *it->second;
    if (told || closed_ || !has_stream(peer) ||
        peer.is_over(now, options_.connect_timeout, options_.silence_timeout)) {
      leaving.push_back(std::move(it->second));
      it = peers_.erase(it);
    } else {
      peer.step(now);
      ++it;
    }
  }
  to_end_.clear();
  return leaving;
}

void Server::look_after(Time now) {
  auto leaving = take_leaving(now);
  if (leaving.empty()) return;
  log::debug("whep: {} viewers leave", leaving.size());
  leaving.clear();
  // Each had about ten threads, and the C library keeps the memory of each for its successor.
  if (sessions() == 0) ::malloc_trim(0);
}

void Server::run(std::stop_token stop, const std::function<void()>& on_tick) {
  Time next_tick{}, warm_up_at = MonotonicClock::now() + kWarmUpAfter;
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    changed_.wait_for(lock, stop, peers_.empty() ? kTick : kTurn,
                      [this] { return !jobs_.empty() || !to_end_.empty(); });
    std::optional<Job> job;
    if (!jobs_.empty() && !stop.stop_requested()) {
      job = std::move(jobs_.front());
      jobs_.pop_front();
      being_answered_ = 1;
    }
    lock.unlock();
    if (job) answer(*job);
    const Time now = MonotonicClock::now();
    if (!job && now >= warm_up_at) warm_up();
    if (job || now >= warm_up_at) warm_up_at = Time::max();
    look_after(now);
    if (now >= next_tick && on_tick) {
      on_tick();
      next_tick = now + kTick;
    }
    lock.lock();
    being_answered_ = 0;
  }
  lock.unlock();
  close();
}

void Server::close() {
  std::deque<Job> left;
  {
    std::lock_guard lock(mutex_);
    closed_ = true;
    left.swap(jobs_);
  }
  for (const Job& job : left) {
    job.pending->set(make_error(ErrorCode::kUnavailable, "whep", "the daemon is being stopped"));
    if (job.on_answer) job.on_answer();
  }
  look_after(MonotonicClock::now());
}

}  // namespace

Result<std::shared_ptr<WhepServer>> WhepServer::create(const WhepOptions& options) {
  SL_RETURN_IF_ERROR(start_gstreamer());
  struct Need {
    const char *element, *package;
  };
  for (const auto& [element, package] :
       {Need{"webrtcbin", "gstreamer1.0-plugins-bad"}, Need{"nicesink", "gstreamer1.0-nice"},
        Need{"dtlssrtpenc", "gstreamer1.0-plugins-bad"},
        Need{"srtpenc", "gstreamer1.0-plugins-bad"}, Need{"rtpbin", "gstreamer1.0-plugins-good"},
        Need{"h264parse", "gstreamer1.0-plugins-bad"},
        Need{"rtph264pay", "gstreamer1.0-plugins-good"}}) {
    const GstObjectPtr<GstElementFactory> factory(gst_element_factory_find(element));
    if (factory) continue;
    return make_error(ErrorCode::kUnavailable, "whep",
                      "no WebRTC: the GStreamer element {} is missing; install the Debian package "
                      "{}",
                      element, package);
  }
  return std::shared_ptr<WhepServer>(std::make_shared<Server>(options));
}

}  // namespace sightline
