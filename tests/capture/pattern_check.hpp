// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "capture/aravis/genicam_formats.hpp"
#include "pattern.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::capture {

/// Tells which image of gige_simulator's pattern a frame is: whole bytes as they traveled,
/// packed samples as the words that they are, mosaics as the decoder makes them from the true
/// words.
class PatternCheck {
 public:
  PatternCheck(const std::string& format, int width, int height);

  /// Number of the image, modulo gige::kPatternPeriod; -2: none of them, byte for byte.
  int64_t find(const Frame& frame);

 private:
  bool equals(const Frame& frame, uint64_t number);
  std::vector<uint8_t> words(uint64_t number) const;

  const gige::WireFormat* wire_;
  const GenicamFormat* ours_;
  int width_, height_;
  uint64_t next_ = 0;
  std::vector<uint8_t> expected_;
};

}  // namespace sightline::capture
