// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/control/http_content.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline {

/// What lies in the recordings' directory.
struct RecordingList {
  struct File {
    std::string name;  ///< relative to the folder
    uint64_t bytes = 0;
    int64_t changed_utc_ns = 0;
  };
  struct Recording {
    std::string name;
    RecordingKind kind{};
    uint64_t bytes = 0;
    int64_t changed_utc_ns = 0;  ///< its newest file
    std::vector<File> files;     ///< by name; of objects/ and scene/ only their size counts
  };
  std::filesystem::path directory;
  std::vector<Recording> recordings;  ///< newest first
  uint64_t bytes = 0;                 ///< of all
  std::string problem;                ///< why it cannot be read

  const File* find(const std::string& name, const std::string& file) const;
};

/// The thread ("library") that looks after the recordings' directory: lists it, keeps its quota,
/// writes marks and reads files for downloads, so that nobody else waits for the disk.
class RecordingLibrary {
 public:
  /// Folders that are being written: of these only what is complete may go. Must not wait.
  using Active = std::function<std::set<std::filesystem::path>()>;
  static std::shared_ptr<RecordingLibrary> start(Registry& registry, HeartbeatBoard& beats,
                                                 std::shared_ptr<HttpWaker> waker, Active active);
  ~RecordingLibrary() { (void)stop_unless_waiting(std::chrono::seconds(1)); }
  bool stop_unless_waiting(Duration patience);

  // Any thread; none of them waits.
  /// `quota_bytes` 0: none.
  void configure(std::filesystem::path directory, uint64_t quota_bytes);
  std::shared_ptr<const RecordingList> list() const { return list_.read(); }  ///< never null
  void mark(std::vector<std::filesystem::path> folders, RecordingMark mark);
  /// A listed file's bytes from `first` on, `size` of them; ends early where the disk fails.
  std::shared_ptr<HttpStream> read(const std::filesystem::path& file, uint64_t first,
                                   uint64_t size);

 private:
  class Download;
  RecordingLibrary(Registry& registry, std::shared_ptr<HttpWaker> waker, Active active);
  void add(std::function<void()> job);
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  void look();
  RecordingList scan(const std::filesystem::path& directory) const;
  void keep_quota(RecordingList& list, uint64_t quota,
                  const std::set<std::filesystem::path>& active);

  const std::shared_ptr<HttpWaker> waker_;
  const Active active_;
  Gauge &bytes_, &count_;
  Counter& deleted_;
  Snapshot<const RecordingList> list_;
  std::mutex mutex_;  // guards the three below
  std::condition_variable_any work_there_;
  std::deque<std::function<void()>> jobs_;
  std::filesystem::path directory_;
  uint64_t quota_bytes_ = 0;
  std::string said_;  // the thread's: what went wrong with deleting, as the log has it
  WatchedThread thread_;
};

}  // namespace sightline
