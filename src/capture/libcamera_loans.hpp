// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "libcamera_camera.hpp"

namespace sightline {

/// Lends a camera's buffers to frames and queues their requests again, from any thread, for as long
/// as the camera is open; the memory lives until the last reader lets go.
class LibcameraLoans : public std::enable_shared_from_this<LibcameraLoans> {
 public:
  explicit LibcameraLoans(std::shared_ptr<LibcameraCamera> camera);

  /// The buffer came back from the camera.
  void taken(size_t slot);
  /// Buffers that the camera can fill now.
  size_t queued() const;
  /// Gives the buffer back when the last copy of the pointer dies.
  std::shared_ptr<const void> lend(size_t slot);
  void give_back(size_t slot);
  /// Why the camera took a buffer no more, if it did.
  Status refusal() const;
  /// Closes the camera. Lent buffers stay readable.
  void close();

 private:
  const std::shared_ptr<LibcameraCamera> camera_;
  mutable std::mutex mutex_;  // the camera's life and what follows
  bool open_ = true;
  std::vector<bool> queued_;
  Status refusal_;
};

}  // namespace sightline
