// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/recorded_rows.hpp"

#include "sightline/base/check.hpp"

namespace sightline {

// Arrival is held by how long after capture it was, and differences wrap around, so that every
// 64-bit number comes back as it was.
RecordedRows::Fields RecordedRows::fields_of(const RecordedRow& row) {
  const auto capture = static_cast<uint64_t>(to_ns(row.capture));
  return {row.sequence, capture, static_cast<uint64_t>(to_ns(row.arrival)) - capture,
          row.dropped_before, row.line};
}

RecordedRow RecordedRows::row_of(const Fields& fields) {
  return {fields[0], time_from_ns(static_cast<int64_t>(fields[1])),
          time_from_ns(static_cast<int64_t>(fields[1] + fields[2])),
          static_cast<uint32_t>(fields[3]), static_cast<size_t>(fields[4])};
}

// Seven bits a byte, small numbers of either sign first (the varint and zigzag of Protocol
// Buffers).
void RecordedRows::append(uint64_t difference) {
  uint64_t rest = (difference << 1) ^ (difference >> 63 ? ~uint64_t{0} : 0);
  for (; rest >= 0x80; rest >>= 7) bytes_.push_back(static_cast<uint8_t>(rest | 0x80));
  bytes_.push_back(static_cast<uint8_t>(rest));
}

uint64_t RecordedRows::read(size_t* at) const {
  uint64_t value = 0;
  for (int shift = 0;; shift += 7) {
    const uint8_t byte = bytes_[(*at)++];
    value |= uint64_t{byte & 0x7fu} << shift;
    if (byte < 0x80) break;
  }
  return (value >> 1) ^ (value & 1 ? ~uint64_t{0} : 0);
}

RecordedRows::Fields RecordedRows::next_after(const Fields& before, size_t* at) const {
  Fields fields = before;
  for (uint64_t& field : fields) field += read(at);
  return fields;
}

void RecordedRows::push_back(const RecordedRow& row) {
  const bool whole = size_ % kBlock == 0;
  if (whole) blocks_.push_back(bytes_.size());
  const Fields before = whole ? Fields{} : fields_of(last_);
  const Fields fields = fields_of(row);
  for (size_t i = 0; i < fields.size(); ++i) append(fields[i] - before[i]);
  last_ = row;
  ++size_;
}

RecordedRow RecordedRows::operator[](size_t index) const {
  SL_CHECK(index < size_, "no such row");
  size_t at = blocks_[index / kBlock];
  Fields fields{};
  for (size_t i = 0; i <= index % kBlock; ++i) fields = next_after(fields, &at);
  return row_of(fields);
}

void RecordedRows::truncate(size_t count) {
  if (count >= size_) return;
  if (count == 0) {
    *this = {};
    return;
  }
  last_ = (*this)[count - 1];
  size_t end = blocks_[(count - 1) / kBlock];
  Fields fields{};
  for (size_t i = 0; i <= (count - 1) % kBlock; ++i) fields = next_after(fields, &end);
  bytes_.resize(end);
  blocks_.resize((count - 1) / kBlock + 1);
  size_ = count;
}

void RecordedRows::Iterator::unpack() {
  if (index_ >= rows_->size_) return;
  if (index_ % kBlock == 0) fields_ = {};
  fields_ = rows_->next_after(fields_, &at_);
  row_ = row_of(fields_);
}

}  // namespace sightline
