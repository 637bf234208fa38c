// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/time.hpp"
#include "stream/gst_ptr.hpp"

namespace sightline::stream {

/// Finds out which encoders work here, by one small image each. An answer is kept. An encoder that
/// does not answer in time is not used for now: its answer may come later (a busy host, a device
/// that wakes up), and is looked for whenever somebody asks, without waiting. Now and then another
/// pipeline is tried, as the first may hang in a driver for ever; of these there are few, since
/// what hangs cannot be ended. Any thread.
class EncoderProbes {
 public:
  struct Options {
    Duration timeout = std::chrono::seconds(3);      ///< that the first asker waits
    Duration first_wait = std::chrono::seconds(30);  ///< until another pipeline is tried
    int wait_factor = 4;                             ///< from one wait to the next
    size_t pipelines = 6;                            ///< of an element, at most
  };
  EncoderProbes() = default;
  explicit EncoderProbes(const Options& options) : options_(options) {}

  /// True if the element exists and has encoded an image. Waits at most once for each element.
  bool works(const std::string& element);

 private:
  struct Entry {
    std::optional<bool> works;                   // nothing: no answer so far
    std::vector<GstObjectPtr<GstElement>> late;  // pipelines that have not answered
    Time asked{}, next{};                        // when it was asked first, and is again
    Duration wait{};
  };
  std::optional<bool> ask_first(const std::string& element, Entry& entry);
  std::optional<bool> ask_again(const std::string& element, Entry& entry);

  const Options options_{};
  std::mutex mutex_;
  std::map<std::string, Entry> entries_;
};

}  // namespace sightline::stream
