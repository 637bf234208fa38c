// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace sightline {

/// One monotonically growing number; add() from any thread, wait-free.
class Counter {
 public:
  void add(uint64_t n = 1) { value_.fetch_add(n, std::memory_order_relaxed); }
  uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> value_{0};
};

/// One number that goes up and down.
class Gauge {
 public:
  void set(double value) { value_.store(value, std::memory_order_relaxed); }
  double value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<double> value_{0.0};
};

using Labels = std::map<std::string, std::string>;

/// All numbers of a process, named and labeled as Prometheus has them
/// (`sightline_frames_total{camera="left"}`). Registering allocates and locks; do it once, keep the
/// reference (it stays valid for the registry's life). The same name and labels give the same one.
class Registry {
 public:
  enum class Kind { kCounter, kGauge };
  struct Sample {
    std::string name;
    std::string help;
    Labels labels;
    Kind kind;
    double value;
  };

  Counter& counter(const std::string& name, const std::string& help, const Labels& labels = {});
  Gauge& gauge(const std::string& name, const std::string& help, const Labels& labels = {});

  /// Takes everything that wears this label out of samples(): its camera or object is gone.
  /// References stay valid; registering one again brings it back, a gauge with 0.
  void remove(const std::string& label, const std::string& value);

  /// All samples, ordered by name, then labels.
  std::vector<Sample> samples() const;

 private:
  template <typename T>
  struct Entry {
    std::string help;
    T value;
    bool removed = false;
  };
  template <typename T>
  using Table = std::map<std::pair<std::string, Labels>, Entry<T>>;

  mutable std::mutex mutex_;
  Table<Counter> counters_;
  Table<Gauge> gauges_;
};

}  // namespace sightline
