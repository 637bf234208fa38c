// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/counters.hpp"

#include <algorithm>
#include <tuple>

namespace sightline {

Counter& Registry::counter(const std::string& name, const std::string& help, const Labels& labels) {
  std::lock_guard lock(mutex_);
  auto& entry = counters_[{name, labels}];
  entry.help = help;
  return entry.value;
}

Gauge& Registry::gauge(const std::string& name, const std::string& help, const Labels& labels) {
  std::lock_guard lock(mutex_);
  auto& entry = gauges_[{name, labels}];
  entry.help = help;
  return entry.value;
}

std::vector<Registry::Sample> Registry::samples() const {
  std::lock_guard lock(mutex_);
  std::vector<Sample> out;
  out.reserve(counters_.size() + gauges_.size());
  for (const auto& [key, entry] : counters_) {
    out.push_back({key.first, entry.help, key.second, Kind::kCounter,
                   static_cast<double>(entry.value.value())});
  }
  for (const auto& [key, entry] : gauges_) {
    out.push_back({key.first, entry.help, key.second, Kind::kGauge, entry.value.value()});
  }
  std::stable_sort(out.begin(), out.end(), [](const Sample& a, const Sample& b) {
    return std::tie(a.name, a.labels) < std::tie(b.name, b.labels);
  });
  return out;
}

}  // namespace sightline
