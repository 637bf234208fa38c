// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/counters.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace sightline {

Counter& Registry::counter(const std::string& name, const std::string& help, const Labels& labels) {
  std::lock_guard lock(mutex_);
  auto& entry = counters_[{name, labels}];
  entry.help = help;
  entry.removed = false;
  return entry.value;
}

Gauge& Registry::gauge(const std::string& name, const std::string& help, const Labels& labels) {
  std::lock_guard lock(mutex_);
  auto& entry = gauges_[{name, labels}];
  entry.help = help;
  if (std::exchange(entry.removed, false)) entry.value.set(0);
  return entry.value;
}

LatencyHistogram& Registry::histogram(const std::string& name, const std::string& help,
                                      const Labels& labels) {
  std::lock_guard lock(mutex_);
  auto& entry = histograms_[{name, labels}];
  entry.help = help;
  entry.removed = false;
  return entry.value;
}

void Registry::remove(const std::string& label, const std::string& value) {
  std::lock_guard lock(mutex_);
  const auto mark = [&](auto& table) {
    for (auto& [key, entry] : table) {
      const auto found = key.second.find(label);
      if (found != key.second.end() && found->second == value) entry.removed = true;
    }
  };
  mark(counters_);
  mark(gauges_);
  mark(histograms_);
}

std::vector<Registry::Sample> Registry::samples() const {
  std::lock_guard lock(mutex_);
  std::vector<Sample> out;
  out.reserve(counters_.size() + gauges_.size() + histograms_.size());
  for (const auto& [key, entry] : counters_) {
    if (entry.removed) continue;
    out.push_back({key.first, entry.help, key.second, Kind::kCounter,
                   static_cast<double>(entry.value.value())});
  }
  for (const auto& [key, entry] : gauges_) {
    if (entry.removed) continue;
    out.push_back({key.first, entry.help, key.second, Kind::kGauge, entry.value.value()});
  }
  for (const auto& [key, entry] : histograms_) {
    if (entry.removed) continue;
    Sample sample{key.first, entry.help, key.second, Kind::kHistogram, entry.value.sum()};
    uint64_t total = 0;
    for (size_t step = 0; step <= LatencyHistogram::kBounds.size(); ++step) {
      sample.cumulative.push_back(total += entry.value.count(step));
    }
    out.push_back(std::move(sample));
  }
  std::stable_sort(out.begin(), out.end(), [](const Sample& a, const Sample& b) {
    return std::tie(a.name, a.labels) < std::tie(b.name, b.labels);
  });
  return out;
}

}  // namespace sightline
