// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline {

/// Is told when the thread that it listens on waits for something outside of the program.
class WaitListener {
 public:
  virtual ~WaitListener() = default;
  /// `what`: "the disk", "the camera"; text that lives as long as the program. On the thread
  /// itself.
  virtual void wait_begins(const char* what) = 0;
  virtual void wait_ends() = 0;
};

/// While it lives, the calling thread waits for a device or a disk: it is not stuck in code of
/// ours, so nobody should take its silence for a hang. Around calls that the kernel or a driver may
/// hold for any time (ioctl, fdatasync, reads of a disk), and around nothing else. Of nested ones
/// the outermost counts. Costs two clock readings where somebody listens, else nothing.
class Waiting {
 public:
  explicit Waiting(const char* what);
  ~Waiting();
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;
};

/// While it lives, `listener` is told of the waits of the calling thread. One at a time.
class WaitListening {
 public:
  explicit WaitListening(WaitListener& listener);
  ~WaitListening();
  WaitListening(const WaitListening&) = delete;
  WaitListening& operator=(const WaitListening&) = delete;
};

}  // namespace sightline
