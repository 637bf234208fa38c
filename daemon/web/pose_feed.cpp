// SPDX-License-Identifier: Apache-2.0
#include "web/pose_feed.hpp"

#include <algorithm>

#include "web/pose_json.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr size_t kMostAtOnce = 32;  // poses in one piece
constexpr Duration kStatePeriod = 1s;
constexpr Duration kSignOfLife = 10s;  // so that a client that has gone is noticed

class EventStream : public HttpStream {
 public:
  EventStream(std::shared_ptr<PoseFeed> feed, std::function<std::string()> state_json)
      : reader_(std::move(feed)), state_json_(std::move(state_json)) {}

  bool ready() override {
    const Time now = MonotonicClock::now();
    return first_ || reader_.ready() || now >= next_sign_ || (state_json_ && now >= next_state_);
  }

  Chunk next() override {
    const Time now = MonotonicClock::now();
    std::string text;
    if (std::exchange(first_, false)) text = "retry: 1000\n\n";
    if (state_json_ && now >= next_state_) {
      next_state_ = now + kStatePeriod;
      text += "event: state\ndata: " + state_json_() + "\n\n";
    }
    add_poses(text);
    if (text.empty() && now >= next_sign_) text = ":\n\n";
    if (text.empty()) return nullptr;
    next_sign_ = now + kSignOfLife;
    return std::make_shared<const std::string>(std::move(text));
  }

 private:
  void add_poses(std::string& text) {
    entries_.clear();
    const uint64_t missed = reader_.read(entries_, kMostAtOnce);
    if (missed > 0) text += fmt::format("event: missed\ndata: {{\"poses\":{}}}\n\n", missed);
    for (const PoseFeed::Entry& entry : entries_) {
      text += "event: pose\ndata: " + pose_event_json(entry.estimate, *entry.names) + "\n\n";
    }
  }

  PoseFeed::Reader reader_;
  const std::function<std::string()> state_json_;
  std::vector<PoseFeed::Entry> entries_;
  Time next_state_{}, next_sign_{};
  bool first_ = true;
};

}  // namespace

PoseFeed::PoseFeed(Registry& registry, std::shared_ptr<HttpWaker> waker)
    : waker_(std::move(waker)),
      missed_(registry.counter("sightline_events_missed_total",
                               "Poses that readers of the event stream were too slow for")),
      clients_gauge_(
          registry.gauge("sightline_event_clients", "Clients that read the event stream")) {}

void PoseFeed::push(const PoseEstimate& estimate) {
  if (clients_ == 0) return;
  auto names = names_.read();
  if (!names) return;
  {
    std::lock_guard lock(mutex_);
    ring_[pushed_ % kKept] = {estimate, std::move(names)};
    ++pushed_;
    for (const auto& waker : more_wakers_) waker->wake();
  }
  if (waker_) waker_->wake();
}

void PoseFeed::add_waker(std::shared_ptr<HttpWaker> waker) {
  const std::lock_guard lock(mutex_);
  more_wakers_.push_back(std::move(waker));
}

void PoseFeed::remove_waker(const std::shared_ptr<HttpWaker>& waker) {
  const std::lock_guard lock(mutex_);
  std::erase(more_wakers_, waker);
}

PoseFeed::Reader::Reader(std::shared_ptr<PoseFeed> feed) : feed_(std::move(feed)) {
  feed_->clients_gauge_.set(++feed_->clients_);
  next_ = feed_->pushed_;
}

PoseFeed::Reader::~Reader() { feed_->clients_gauge_.set(--feed_->clients_); }

uint64_t PoseFeed::Reader::read(std::vector<Entry>& out, size_t most) {
  std::lock_guard lock(feed_->mutex_);
  const uint64_t pushed = feed_->pushed_;
  const uint64_t oldest = pushed > kKept ? pushed - kKept : 0;
  const uint64_t missed = next_ < oldest ? oldest - next_ : 0;
  next_ += missed;
  feed_->missed_.add(missed);
  for (size_t i = 0; i < most && next_ < pushed; ++i, ++next_) {
    out.push_back(feed_->ring_[next_ % kKept]);
  }
  return missed;
}

std::shared_ptr<HttpStream> make_event_stream(std::shared_ptr<PoseFeed> feed,
                                              std::function<std::string()> state_json) {
  return std::make_shared<EventStream>(std::move(feed), std::move(state_json));
}

}  // namespace sightline
