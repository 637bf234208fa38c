// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

namespace sightline::cli {

/// A bar on stderr for long work; silent unless stderr is a terminal.
class ProgressBar {
 public:
  ProgressBar(std::string label, size_t total);
  ~ProgressBar();
  void set(size_t done);

 private:
  const std::string label_;
  const size_t total_;
  const bool shown_;
  size_t last_percent_ = 101;
};

}  // namespace sightline::cli
