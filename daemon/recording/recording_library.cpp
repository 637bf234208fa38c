// SPDX-License-Identifier: Apache-2.0
#include "recording/recording_library.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <tuple>

#include "recording/recordings_folder.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

namespace {

constexpr Duration kLookEvery = 2s;
constexpr Duration kTurn = 250ms;
constexpr Duration kStallLimit = 10s;  // besides what it waits for the disk
constexpr int64_t kFresh_ns = 5'000'000'000;
constexpr size_t kPiece = 256 << 10;  // [bytes] of a download that are read at once

// Of a regular file; nullopt for anything else.
std::optional<RecordingList::File> look_at(const fs::path& path, std::string name) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return std::nullopt;
  return RecordingList::File{std::move(name), static_cast<uint64_t>(info.st_size),
                             int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec};
}

RecordingList::Recording look_into(const fs::path& folder, RecordingKind kind) {
  RecordingList::Recording found{folder.filename().string(), kind, 0, 0, {}};
  std::error_code fault;
  for (fs::recursive_directory_iterator at(folder, fault), end; !fault && at != end;
       at.increment(fault)) {
    auto file = look_at(at->path(), at->path().filename().string());
    if (!file) continue;
    found.bytes += file->bytes;
    found.changed_utc_ns = std::max(found.changed_utc_ns, file->changed_utc_ns);
    if (at.depth() == 0) found.files.push_back(*std::move(file));
  }
  std::ranges::sort(found.files, {}, &RecordingList::File::name);
  return found;
}

// What may go by itself: a whole recording, of a viewing one a segment, of a log of poses that is
// being written a file that is full.
struct Unit {
  int64_t changed = 0;
  fs::path path;
  size_t recording = 0;
  uint64_t bytes = 0;
};

// "left-0007.mp4" -> "left-"
std::string camera_of(const std::string& segment) {
  return segment.substr(0, segment.find_last_of('-') + 1);
}

// All but the newest: poses.mcap, poses-0002.mcap, ...
void add_full_logs(const RecordingList& list, size_t index, std::vector<Unit>& units) {
  const auto& recording = list.recordings[index];
  const auto is_log = [](const RecordingList::File& file) { return file.name.ends_with(".mcap"); };
  const auto number = [](const RecordingList::File& file) {
    return file.name == "poses.mcap" ? std::string() : file.name;
  };
  const RecordingList::File* newest = nullptr;
  for (const auto& file : recording.files) {
    if (is_log(file) && (newest == nullptr || number(file) > number(*newest))) newest = &file;
  }
  for (const auto& file : recording.files) {
    if (!is_log(file) || &file == newest) continue;
    units.push_back(
        {file.changed_utc_ns, list.directory / recording.name / file.name, index, file.bytes});
  }
}

std::vector<Unit> units_of(const RecordingList& list, const std::set<fs::path>& active) {
  std::vector<Unit> units;
  for (size_t i = 0; i < list.recordings.size(); ++i) {
    const auto& recording = list.recordings[i];
    const fs::path folder = list.directory / recording.name;
    const bool running = active.contains(folder);
    if (recording.kind != RecordingKind::kViewing) {
      // One that has only just begun may not be known to be running.
      const bool fresh = utc_now_ns() - recording.changed_utc_ns < kFresh_ns;
      if (!running && !fresh) {
        units.push_back({recording.changed_utc_ns, folder, i, recording.bytes});
      } else if (recording.kind == RecordingKind::kPoses) {
        add_full_logs(list, i, units);
      }
      continue;
    }
    for (size_t k = 0; k < recording.files.size(); ++k) {
      const auto& file = recording.files[k];
      const bool segment = file.name.ends_with(".mp4");
      // The files are ordered by name: the newest of a camera is being written.
      const bool newest = k + 1 == recording.files.size() ||
                          camera_of(recording.files[k + 1].name) != camera_of(file.name);
      if ((running || utc_now_ns() - file.changed_utc_ns < kFresh_ns) && (!segment || newest)) {
        continue;
      }
      units.push_back({file.changed_utc_ns, folder / file.name, i, file.bytes});
    }
  }
  std::ranges::sort(units, {}, [](const Unit& unit) { return std::tie(unit.changed, unit.path); });
  return units;
}

}  // namespace

const RecordingList::File* RecordingList::find(const std::string& name,
                                               const std::string& file) const {
  const auto recording = std::ranges::find(recordings, name, &Recording::name);
  if (recording == recordings.end()) return nullptr;
  const auto found = std::ranges::find(recording->files, file, &File::name);
  return found == recording->files.end() ? nullptr : &*found;
}

/// A file on its way: the next piece is read by the library's thread while one is being sent.
class RecordingLibrary::Download : public HttpStream {
 public:
  Download(RecordingLibrary& library, std::shared_ptr<HttpWaker> waker, fs::path path,
           uint64_t first, uint64_t size)
      : library_(library),
        shared_(std::make_shared<Shared>(std::move(path), first, size, std::move(waker))) {
    ask();
  }
  ~Download() override { shared_->gone = true; }

  bool ready() override {
    const std::lock_guard lock(shared_->mutex);
    return shared_->piece || shared_->left == 0;
  }
  Chunk next() override {
    Chunk piece;
    {
      const std::lock_guard lock(shared_->mutex);
      piece = std::exchange(shared_->piece, nullptr);
    }
    if (piece) ask();
    return piece;
  }
  bool ended() const override {
    const std::lock_guard lock(shared_->mutex);
    return !shared_->piece && shared_->left == 0;
  }

 private:
  // Outlives this where the disk is slow.
  struct Shared {
    Shared(fs::path file_path, uint64_t first, uint64_t size, std::shared_ptr<HttpWaker> wake)
        : path(std::move(file_path)), at(first), left(size), waker(std::move(wake)) {}

    void read() {
      if (gone) return;
      const Waiting wait("the disk");
      if (!file.is_open()) {
        file.reset(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
      }
      std::string bytes(std::min<uint64_t>(left, kPiece), '\0');
      const ssize_t got =
          file.is_open() ? ::pread(file.get(), bytes.data(), bytes.size(), static_cast<off_t>(at))
                         : -1;
      const std::lock_guard lock(mutex);
      if (got <= 0) {
        if (got < 0) log::warning("http: cannot read {}: {}", path.string(), std::strerror(errno));
        left = 0;
      } else {
        bytes.resize(static_cast<size_t>(got));
        at += static_cast<uint64_t>(got);
        left -= static_cast<uint64_t>(got);
        piece = std::make_shared<const std::string>(std::move(bytes));
      }
      if (waker) waker->wake();
    }

    const fs::path path;
    UniqueFd file;    // the library's thread's
    uint64_t at = 0;  // the same
    std::atomic<bool> gone{false};
    std::mutex mutex;  // guards the two below
    uint64_t left;
    Chunk piece;
    const std::shared_ptr<HttpWaker> waker;
  };

  void ask() {
    {
      const std::lock_guard lock(shared_->mutex);
      if (shared_->left == 0) return;
    }
    library_.add([shared = shared_] { shared->read(); });
  }

  RecordingLibrary& library_;
  const std::shared_ptr<Shared> shared_;
};

std::shared_ptr<RecordingLibrary> RecordingLibrary::start(Registry& registry, HeartbeatBoard& beats,
                                                          std::shared_ptr<HttpWaker> waker,
                                                          Active active) {
  std::shared_ptr<RecordingLibrary> library(
      new RecordingLibrary(registry, std::move(waker), std::move(active)));
  library->thread_ = WatchedThread(
      beats, "library", kStallLimit,
      [raw = library.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return library;
}

RecordingLibrary::RecordingLibrary(Registry& registry, std::shared_ptr<HttpWaker> waker,
                                   Active active)
    : waker_(std::move(waker)),
      active_(std::move(active)),
      bytes_(registry.gauge("sightline_recordings_bytes", "Size of all recordings")),
      count_(registry.gauge("sightline_recordings", "Recordings in the directory")),
      deleted_(registry.counter("sightline_recordings_deleted_bytes_total",
                                "Bytes of recordings that went to keep the quota")) {
  list_.publish(std::make_shared<const RecordingList>());
}

bool RecordingLibrary::stop_unless_waiting(Duration patience) {
  thread_.request_stop();
  return !thread_.joinable() || thread_.join_unless_waiting(patience);
}

void RecordingLibrary::add(std::function<void()> job) {
  const std::lock_guard lock(mutex_);
  jobs_.push_back(std::move(job));
  work_there_.notify_one();
}

void RecordingLibrary::configure(fs::path directory, uint64_t quota_bytes) {
  {
    const std::lock_guard lock(mutex_);
    directory_ = std::move(directory);
    quota_bytes_ = quota_bytes;
  }
  add([this] { look(); });
}

void RecordingLibrary::mark(std::vector<fs::path> folders, RecordingMark mark) {
  add([folders = std::move(folders), mark = std::move(mark)] {
    for (const fs::path& folder : folders) {
      const Status done = append_mark(folder, mark);
      if (!done) log::error("{}", done.error().message());
    }
  });
}

std::shared_ptr<HttpStream> RecordingLibrary::read(const fs::path& file, uint64_t first,
                                                   uint64_t size) {
  return std::make_shared<Download>(*this, waker_, file, first, size);
}

void RecordingLibrary::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  Time next_look{};
  while (!stop.stop_requested()) {
    heartbeat.beat();
    std::function<void()> job;
    {
      std::unique_lock lock(mutex_);
      work_there_.wait_for(lock, stop, kTurn, [this] { return !jobs_.empty(); });
      if (!jobs_.empty()) {
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
    }
    if (job) job();
    if (MonotonicClock::now() < next_look) continue;
    look();
    next_look = MonotonicClock::now() + kLookEvery;
  }
}

void RecordingLibrary::look() {
  fs::path directory;
  uint64_t quota = 0;
  {
    const std::lock_guard lock(mutex_);
    directory = directory_;
    quota = quota_bytes_;
  }
  RecordingList list = scan(directory);
  if (quota > 0) keep_quota(list, quota, active_());
  bytes_.set(static_cast<double>(list.bytes));
  count_.set(static_cast<double>(list.recordings.size()));
  list_.publish(std::make_shared<const RecordingList>(std::move(list)));
}

RecordingList RecordingLibrary::scan(const fs::path& directory) const {
  RecordingList list;
  list.directory = directory;
  if (directory.empty()) return list;
  const Waiting wait("the disk");
  std::error_code fault;
  for (fs::directory_iterator at(directory, fault), end; !fault && at != end; at.increment(fault)) {
    const auto kind = recording_kind_of(at->path().filename().string());
    std::error_code ignored;
    if (!kind || at->is_symlink(ignored) || !at->is_directory(ignored)) continue;
    list.recordings.push_back(look_into(at->path(), *kind));
    list.bytes += list.recordings.back().bytes;
  }
  if (fault) list.problem = recording_folder_error(directory, fault).message();
  std::ranges::sort(list.recordings, std::ranges::greater{}, &RecordingList::Recording::name);
  return list;
}

// Oldest first; recordings that are being written keep what they write at.
void RecordingLibrary::keep_quota(RecordingList& list, uint64_t quota,
                                  const std::set<fs::path>& active) {
  if (list.bytes <= quota) return;
  const Waiting wait("the disk");
  for (const Unit& unit : units_of(list, active)) {
    if (list.bytes <= quota) break;
    std::error_code fault;
    fs::remove_all(unit.path, fault);
    if (fault) {
      const std::string text = fmt::format("cannot delete {} to keep the quota: {}",
                                           unit.path.string(), fault.message());
      if (text != said_) log::error("recordings: {}", text);
      said_ = text;
      continue;
    }
    log::info("recordings: {} deleted to keep the quota", unit.path.string());
    deleted_.add(unit.bytes);
    list.bytes -= std::min(list.bytes, unit.bytes);
    // An emptied folder goes too; one with something in it stays.
    const fs::path folder = list.directory / list.recordings[unit.recording].name;
    if (!active.contains(folder)) fs::remove(folder, fault);
  }
  const fs::path directory = list.directory;
  list = scan(directory);
}

}  // namespace sightline
