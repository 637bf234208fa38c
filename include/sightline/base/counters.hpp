// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
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

/// How long something took, as counts of steps; observe() from any thread, wait-free.
class LatencyHistogram {
 public:
  /// Upper bounds of the steps [s]; one more step takes what is longer.
  static constexpr std::array kBounds{0.001, 0.002, 0.003, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.025,
                                      0.033, 0.05,  0.075, 0.1,   0.15,   0.25, 0.5,   1.0,  2.5};
  void observe(double seconds) {
    size_t step = 0;
    while (step < kBounds.size() && seconds > kBounds[step]) ++step;
    counts_[step].fetch_add(1, std::memory_order_relaxed);
    sum_.fetch_add(seconds, std::memory_order_relaxed);
  }
  /// Of each step, not of all below it.
  uint64_t count(size_t step) const { return counts_[step].load(std::memory_order_relaxed); }
  double sum() const { return sum_.load(std::memory_order_relaxed); }

 private:
  std::array<std::atomic<uint64_t>, kBounds.size() + 1> counts_{};
  std::atomic<double> sum_{0};
};

using Labels = std::map<std::string, std::string>;

/// All numbers of a process, named and labeled as Prometheus has them
/// (`sightline_frames_total{camera="left"}`). Registering allocates and locks; do it once, keep the
/// reference (it stays valid for the registry's life). The same name and labels give the same one.
class Registry {
 public:
  enum class Kind { kCounter, kGauge, kHistogram };
  struct Sample {
    std::string name;
    std::string help;
    Labels labels;
    Kind kind;
    double value;                        ///< of a histogram: the sum
    std::vector<uint64_t> cumulative{};  ///< of a histogram: counts up to each bound, then of all
  };

  Counter& counter(const std::string& name, const std::string& help, const Labels& labels = {});
  Gauge& gauge(const std::string& name, const std::string& help, const Labels& labels = {});
  LatencyHistogram& histogram(const std::string& name, const std::string& help,
                              const Labels& labels = {});

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
  Table<LatencyHistogram> histograms_;
};

}  // namespace sightline
