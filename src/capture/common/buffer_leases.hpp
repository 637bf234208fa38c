// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "capture/common/buffer_device.hpp"

namespace sightline::capture {

/// Lends a camera's buffers to frames and queues them again, from any thread, for as long as the
/// camera streams. Frames hold this, and with it the memory, until their last reader lets go.
class BufferLeases : public std::enable_shared_from_this<BufferLeases> {
 public:
  /// `device` has been started: it holds every buffer. `queue_attempts`: how often a buffer that
  /// the device refuses is offered before that is an error.
  BufferLeases(std::shared_ptr<BufferDevice> device, int queue_attempts);

  /// The buffer came back from the camera. kIo: it had not been queued, or does not exist.
  Status take(size_t index, const std::string& where);
  /// Buffers that the camera can fill now.
  size_t queued() const;
  /// Gives the buffer back when the last copy of the pointer dies.
  std::shared_ptr<const void> lend(size_t index);
  void give_back(size_t index);
  /// Offers again what the device refused; its error once it has refused too often.
  Status requeue_refused();
  /// Stops the camera. Lent buffers stay readable.
  void stop();

 private:
  struct Slot {
    bool queued = true;
    int refusals = 0;  ///< running; 0: queued, or lent
  };
  void queue(size_t index);  // needs mutex_

  const std::shared_ptr<BufferDevice> device_;
  const int queue_attempts_;
  mutable std::mutex mutex_;  // the camera's life and what follows
  bool streaming_ = true;
  std::vector<Slot> slots_;
  Status refusal_;  // the last one
};

}  // namespace sightline::capture
