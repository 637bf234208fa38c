// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <iterator>

#include "sightline/base/time.hpp"

namespace sightline {

/// One line of frames.csv: the only source of a recorded frame's times.
struct RecordedRow {
  uint64_t sequence = 0;
  Time capture{};
  Time arrival{};
  uint32_t dropped_before = 0;
  size_t line = 0;  ///< in frames.csv, from 1

  bool operator==(const RecordedRow&) const = default;
};

/// The rows of one camera, packed: each holds what differs from the row before it, which of a
/// camera at a steady rate takes 11 to 15 bytes, and never more than 50. Rows are handed out by
/// value. Reading is safe for any number of threads.
class RecordedRows {
 public:
  class Iterator;

  bool empty() const { return size_ == 0; }
  size_t size() const { return size_; }
  /// Unpacks up to kBlock rows.
  RecordedRow operator[](size_t index) const;
  RecordedRow front() const { return (*this)[0]; }
  const RecordedRow& back() const { return last_; }
  Iterator begin() const;
  Iterator end() const;

  void push_back(const RecordedRow& row);
  /// Keeps the first `count` rows.
  void truncate(size_t count);

 private:
  static constexpr size_t kBlock = 32;  ///< rows between two that are packed whole
  using Fields = std::array<uint64_t, 5>;

  static Fields fields_of(const RecordedRow& row);
  static RecordedRow row_of(const Fields& fields);
  void append(uint64_t difference);
  uint64_t read(size_t* at) const;
  Fields next_after(const Fields& before, size_t* at) const;

  std::deque<uint8_t> bytes_;
  std::deque<uint64_t> blocks_;  ///< places in bytes_
  size_t size_ = 0;
  RecordedRow last_;
};

/// Goes over the rows in order, each unpacked once.
class RecordedRows::Iterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = RecordedRow;
  using difference_type = std::ptrdiff_t;
  using pointer = const RecordedRow*;
  using reference = const RecordedRow&;

  Iterator(const RecordedRows* rows, size_t index) : rows_(rows), index_(index) { unpack(); }
  reference operator*() const { return row_; }
  pointer operator->() const { return &row_; }
  Iterator& operator++() {
    ++index_;
    unpack();
    return *this;
  }
  bool operator==(const Iterator& other) const { return index_ == other.index_; }

 private:
  void unpack();

  const RecordedRows* rows_;
  size_t index_;
  size_t at_ = 0;
  Fields fields_{};
  RecordedRow row_;
};

inline RecordedRows::Iterator RecordedRows::begin() const { return Iterator(this, 0); }
inline RecordedRows::Iterator RecordedRows::end() const { return Iterator(this, size_); }

}  // namespace sightline
