// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibration/capture_session.hpp"

namespace sightline::cli {

/// What a capture is at, on stderr: one line that is written over on a terminal (with a bell for
/// each set, as who holds the target may not look), a line for each news elsewhere.
class CaptureProgressLine {
 public:
  explicit CaptureProgressLine(std::vector<std::string> cameras);
  ~CaptureProgressLine();
  void show(const CaptureState& state);

 private:
  std::string line(const CaptureState& state) const;

  const std::vector<std::string> cameras_;
  const bool terminal_;
  size_t sets_ = 0;
  std::string last_;
};

}  // namespace sightline::cli
