// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>

#include "heartbeat.hpp"
#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/record/recording_sink.hpp"
#include "web/pose_feed.hpp"

namespace sightline {

/// How recordings of one kind are made, until another is said.
struct RecordingSinkSettings {
  std::filesystem::path directory;  ///< empty: none are made
  /// Makes the writer of a new folder; called on the recorder's thread.
  std::function<Result<std::unique_ptr<RecordingSink>>(const std::filesystem::path&)> open{};
  bool video = false;  ///< also the packets of streams
  Duration before{};   ///< kept ready at all times, so that a recording begins so long ago; 0: none
};

struct RecordingSinkStatus {
  bool wanted = false;           ///< somebody started it and nobody stopped it
  std::filesystem::path folder;  ///< what is written; empty: nothing
  std::string problem;           ///< why nothing is written although it is wanted
  int64_t since_utc_ns = 0;      ///< of `folder`
  uint64_t written = 0, dropped = 0;
};

/// The thread that writes recordings of one kind ("rec:KIND"), behind a bounded queue: who hands
/// something over never waits for the disk. What does not fit is dropped and counted. A disk that
/// is full, or not there, ends the recording and nothing else; another is tried for ever, 2 to 60 s
/// apart, until it is stopped.
class RecordingSinkWorker {
 public:
  static std::shared_ptr<RecordingSinkWorker> start(RecordingKind kind, Registry& registry,
                                                    HeartbeatBoard& beats);
  ~RecordingSinkWorker() { (void)stop_unless_waiting(std::chrono::seconds(1)); }

  // Any thread; none of them waits.
  void configure(RecordingSinkSettings settings);
  /// Until end_recording(), or for so long; a recording that is under way lasts at least that.
  /// `why` is for the log.
  void begin(std::optional<Duration> for_at_most, const std::string& why);
  void end(const std::string& why);
  /// Packets that are handed over go there, too, where it takes any. Before anybody else knows it.
  void pass_on_to(std::shared_ptr<RecordingSinkWorker> log) { log_ = std::move(log); }
  /// Somebody has use for push() of packets; of poses.
  bool wants_video() const { return (wants_ && takes_video_) || (log_ && log_->wants_video()); }
  bool wants() const { return wants_; }
  /// One more with every recording that began without anything from before.
  uint64_t begun() const { return begun_ + (log_ ? log_->begun() : 0); }
  void push(ViewPacket packet);
  void push(PoseFeed::Entry pose);
  RecordingSinkStatus status() const;
  /// The most entries that waited at once since the last call, and bytes that wait now.
  size_t queue_peak() { return queue_.take_peak(); }
  size_t queued_bytes() const { return queued_bytes_; }

  /// Finishes what is written. Leaves a thread that waits for the disk once `patience` has passed:
  /// false then.
  bool stop_unless_waiting(Duration patience);

 private:
  struct Entry {
    std::variant<ViewPacket, PoseFeed::Entry> what;
    Time time{};
    size_t bytes = 0;
  };
  struct Order {
    bool wanted = false;
    std::optional<Time> until{};
    bool operator==(const Order&) const = default;
  };

  RecordingSinkWorker(RecordingKind kind, Registry& registry);
  void push_entry(Entry entry);
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  void step(const std::stop_token& stop);
  /// Opens and closes as it was ordered; true while something is wanted.
  bool follow_orders(Time now);
  Status open();
  void close(const char* why);
  void fail(const Error& error);
  Status write(const Entry& entry);
  Status write_ring();
  void keep(Entry entry);
  void flush_if_due(Time now);
  void update_wants();

  const RecordingKind kind_;
  const std::string name_;
  BoundedQueue<Entry> queue_{4096};
  std::atomic<size_t> queued_bytes_{0};
  std::atomic<bool> wants_{false}, takes_video_;
  std::shared_ptr<RecordingSinkWorker> log_;  // null: there is none
  std::atomic<uint64_t> begun_{0}, written_{0};
  Counter &dropped_, &written_counter_, &failures_;
  Gauge &running_, &failing_;

  mutable std::mutex mutex_;  // guards the seven below
  RecordingSinkSettings settings_;
  uint64_t settings_version_ = 0;
  Order order_;
  std::filesystem::path folder_;
  std::string problem_;
  int64_t since_utc_ns_ = 0;
  std::string said_;  // why it stopped last, as the log has it

  // The thread's own.
  RecordingSinkSettings now_;
  uint64_t now_version_ = 0;
  std::unique_ptr<RecordingSink> writer_;
  std::deque<Entry> packet_ring_, pose_ring_;
  size_t ring_bytes_ = 0;  // of the packets
  Duration wait_{};        // before the next attempt
  Time next_try_{}, opened_{}, last_flush_{}, last_sync_{};
  WatchedThread thread_;
};

}  // namespace sightline
