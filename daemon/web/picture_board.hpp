// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "heartbeat.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/control/http_content.hpp"
#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/stream/jpeg_encoder.hpp"

namespace sightline {

enum class PictureKind : uint8_t { kAnnotated, kClean };

/// One picture as clients get it.
struct Jpeg {
  std::string bytes;
  uint64_t serial = 0;    ///< grows by one with every picture that was offered
  uint64_t sequence = 0;  ///< of the camera's frame
  Time capture{};
};
using JpegPtr = std::shared_ptr<const Jpeg>;

class PictureBoard;

/// The pictures of one camera for browsers: the drawing thread offers images, clients ask for the
/// next one, and only what is asked for is encoded, once for all who ask. Any thread; never waits.
class PictureSlot {
 public:
  PictureSlot(std::string camera, PictureBoard& board, Registry& registry);

  /// Somebody watches: without that nothing needs to be drawn for it.
  bool wanted(PictureKind kind) const { return side(kind).watchers > 0; }
  bool wanted() const { return wanted(PictureKind::kAnnotated) || wanted(PictureKind::kClean); }
  int watchers() const { return sides_[0].watchers + sides_[1].watchers; }
  void offer(PictureKind kind, std::shared_ptr<const Image> image, const FrameInfo& frame);
  /// No camera of that name any more: streams of it end.
  void close() { closed_ = true; }
  bool closed() const { return closed_; }
  const std::string& camera() const { return camera_; }

 private:
  friend class PictureBoard;
  friend class PictureWatch;
  struct Side {
    std::atomic<int> watchers{0};
    // Guarded by mutex_:
    std::shared_ptr<const Image> image;  ///< the newest, while it is not encoded
    FrameInfo frame;
    uint64_t offered = 0;
    bool asked = false;
    JpegPtr jpeg;
  };
  Side& side(PictureKind kind) { return sides_[static_cast<size_t>(kind)]; }
  const Side& side(PictureKind kind) const { return sides_[static_cast<size_t>(kind)]; }
  /// Encodes what is asked for and there; false if nothing was.
  bool encode_one(PictureKind kind, JpegEncoder& encoder);

  const std::string camera_;
  PictureBoard& board_;
  Counter &encoded_, &unasked_;
  Gauge& watchers_gauge_;
  std::atomic<bool> closed_{false};
  mutable std::mutex mutex_;
  Side sides_[2];
};

/// One client's look at a slot; the slot is wanted while it exists. One thread.
class PictureWatch {
 public:
  PictureWatch(std::shared_ptr<PictureSlot> slot, PictureKind kind);
  ~PictureWatch();
  PictureWatch(const PictureWatch&) = delete;
  PictureWatch& operator=(const PictureWatch&) = delete;

  /// A picture newer than that of the last call and than this watch; null: none yet, it is asked
  /// for.
  JpegPtr next();
  const PictureSlot& slot() const { return *slot_; }

 private:
  const std::shared_ptr<PictureSlot> slot_;
  const PictureKind kind_;
  uint64_t seen_ = 0;
};

/// The slots of all cameras by name, and the thread ("jpeg") that encodes for them.
class PictureBoard {
 public:
  static Result<std::shared_ptr<PictureBoard>> start(Registry& registry, HeartbeatBoard& beats,
                                                     std::shared_ptr<HttpWaker> waker);
  ~PictureBoard();

  /// The same one for the same name, until it is closed.
  std::shared_ptr<PictureSlot> slot(const std::string& camera);
  /// Null where there is none.
  std::shared_ptr<PictureSlot> find(const std::string& camera) const;
  /// Closes all others.
  void keep_only(const std::vector<std::string>& cameras);

 private:
  friend class PictureSlot;
  friend class PictureWatch;
  PictureBoard(Registry& registry, std::shared_ptr<HttpWaker> waker,
               std::unique_ptr<JpegEncoder> encoder);
  /// Somebody asks, or an image came that is asked for.
  void notify();
  void run(std::stop_token stop, Heartbeat& heartbeat);
  void encode_all();

  Registry& registry_;
  const std::shared_ptr<HttpWaker> waker_;
  std::unique_ptr<JpegEncoder> encoder_;  // of the thread
  mutable std::mutex mutex_;              // guards slots_
  std::map<std::string, std::shared_ptr<PictureSlot>> slots_;
  std::mutex work_mutex_;  // guards work_
  std::condition_variable_any work_there_;
  bool work_ = false;
  std::jthread thread_;
};

}  // namespace sightline
