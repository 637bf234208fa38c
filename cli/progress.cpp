// SPDX-License-Identifier: Apache-2.0
#include "progress.hpp"

#include <unistd.h>

#include <cstdio>
#include <utility>

namespace sightline::cli {

ProgressBar::ProgressBar(std::string label, size_t total)
    : label_(std::move(label)), total_(total), shown_(total > 0 && isatty(STDERR_FILENO) == 1) {}

void ProgressBar::set(size_t done) {
  if (!shown_) return;
  const size_t percent = done * 100 / total_;
  if (percent == last_percent_) return;
  last_percent_ = percent;
  constexpr size_t kWidth = 40;
  const size_t filled = percent * kWidth / 100;
  std::fprintf(stderr, "\r%s [%s%s] %3zu %%", label_.c_str(), std::string(filled, '#').c_str(),
               std::string(kWidth - filled, '.').c_str(), percent);
}

ProgressBar::~ProgressBar() {
  if (shown_) std::fprintf(stderr, "\n");
}

}  // namespace sightline::cli
