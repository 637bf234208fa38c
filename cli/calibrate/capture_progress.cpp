// SPDX-License-Identifier: Apache-2.0
#include "calibrate/capture_progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "calibration/capture_words.hpp"

namespace sightline::cli {
namespace {

constexpr size_t kUsualWidth = 100;

size_t terminal_width() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kUsualWidth;
  return size.ws_col;
}

std::string bar(double share) {
  constexpr size_t kWidth = 20;
  const auto filled = static_cast<size_t>(std::clamp(share, 0.0, 1.0) * kWidth);
  return std::string(filled, '#') + std::string(kWidth - filled, '.');
}

}  // namespace

CaptureProgressLine::CaptureProgressLine(std::vector<std::string> cameras)
    : cameras_(std::move(cameras)), terminal_(isatty(STDERR_FILENO) == 1) {}

CaptureProgressLine::~CaptureProgressLine() {
  if (terminal_) std::fprintf(stderr, "\n");
}

std::string CaptureProgressLine::line(const CaptureState& state) const {
  const std::string words = next_words(state, cameras_);
  if (!terminal_) {
    return fmt::format("{} set{}, {:.0f} %; {}", state.sets, state.sets == 1 ? "" : "s",
                       100 * state.share, words);
  }
  const std::string hint = state.passed ? "" : hint_words(state.step);
  return fmt::format("[{}] {:>3.0f} % {:>3} sets  {}{}", bar(state.share), 100 * state.share,
                     state.sets, words, hint.empty() ? "" : " (" + hint + ")");
}

void CaptureProgressLine::show(const CaptureState& state) {
  std::string text = line(state);
  const bool taken = state.sets > sets_;
  sets_ = state.sets;
  if (text == last_) return;
  last_ = text;
  if (!terminal_) {
    std::fprintf(stderr, "%s\n", text.c_str());
    return;
  }
  const size_t width = terminal_width();
  if (text.size() >= width) text.resize(width - 1);
  std::fprintf(stderr, "\r\033[K%s%s", text.c_str(), taken ? "\a" : "");
}

}  // namespace sightline::cli
