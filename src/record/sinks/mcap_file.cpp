// SPDX-License-Identifier: Apache-2.0
#include "record/sinks/mcap_file.hpp"

#include <algorithm>
#include <array>

namespace sightline::record {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);

enum class Op : uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kDataEnd = 15,
};

// Numbers are little-endian, texts have their length before them.
class Bytes {
 public:
  Bytes& u8(uint8_t value) { return number(value, 1); }
  Bytes& u16(uint16_t value) { return number(value, 2); }
  Bytes& u32(uint32_t value) { return number(value, 4); }
  Bytes& u64(uint64_t value) { return number(value, 8); }
  Bytes& time(int64_t ns) { return u64(static_cast<uint64_t>(std::max<int64_t>(ns, 0))); }
  Bytes& raw(std::string_view bytes) {
    text_ += bytes;
    return *this;
  }
  Bytes& text(std::string_view bytes) {
    return u32(static_cast<uint32_t>(bytes.size())).raw(bytes);
  }
  const std::string& str() const { return text_; }

 private:
  Bytes& number(uint64_t value, int size) {
    for (int i = 0; i < size; ++i) text_ += static_cast<char>(value >> 8 * i & 0xFF);
    return *this;
  }
  std::string text_;
};

std::string record(Op op, const Bytes& content) {
  Bytes all;
  all.u8(static_cast<uint8_t>(op)).u64(content.str().size()).raw(content.str());
  return all.str();
}

}  // namespace

Result<std::unique_ptr<McapFile>> McapFile::create(const std::filesystem::path& path) {
  SL_ASSIGN(auto out, OutFile::create(path, OutFile::Existing::kRefuse));
  std::unique_ptr<McapFile> file(new McapFile(std::move(out)));
  SL_RETURN_IF_ERROR(
      file->write(std::string(kMagic) + record(Op::kHeader, Bytes().text("").text("sightline"))));
  return file;
}

Status McapFile::write(const std::string& bytes) {
  if (status_) status_ = file_.write(bytes);
  size_ += bytes.size();
  return status_;
}

uint16_t McapFile::add_schema(std::string_view name, std::string_view schema) {
  const std::string made =
      record(Op::kSchema, Bytes().u16(++schemas_).text(name).text("jsonschema").text(schema));
  definitions_ += made;
  records_ += made;
  return schemas_;
}

uint16_t McapFile::add_channel(uint16_t schema, std::string_view topic) {
  const std::string made =
      record(Op::kChannel, Bytes().u16(++channels_).u16(schema).text(topic).text("json").u32(0));
  definitions_ += made;
  records_ += made;
  return channels_;
}

void McapFile::append(uint16_t channel, int64_t utc_ns, std::string_view json) {
  if (at_.empty()) first_ns_ = last_ns_ = utc_ns;
  first_ns_ = std::min(first_ns_, utc_ns);
  last_ns_ = std::max(last_ns_, utc_ns);
  at_[channel].push_back({utc_ns, records_.size()});
  records_ +=
      record(Op::kMessage,
             Bytes().u16(channel).u32(sequences_[channel]++).time(utc_ns).time(utc_ns).raw(json));
}

Status McapFile::flush() {
  if (at_.empty()) return status_;
  const std::string chunk = record(Op::kChunk, Bytes()
                                                   .time(first_ns_)
                                                   .time(last_ns_)
                                                   .u64(records_.size())
                                                   .u32(0)
                                                   .text("")
                                                   .u64(records_.size())
                                                   .raw(records_));
  Chunk entry{size_, chunk.size(), 0, records_.size(), first_ns_, last_ns_, {}};
  std::string all = chunk;
  for (const auto& [channel, places] : at_) {
    entry.indices[channel] = size_ + all.size();
    Bytes index;
    index.u16(channel).u32(static_cast<uint32_t>(places.size() * 16));
    for (const Place& place : places) index.time(place.time_ns).u64(place.offset);
    all += record(Op::kMessageIndex, index);
  }
  entry.index_length = all.size() - chunk.size();
  chunks_.push_back(std::move(entry));
  records_.clear();
  at_.clear();
  return write(all);
}

std::string McapFile::end_of_data() const {
  std::string summary = definitions_;
  uint64_t messages = 0;
  int64_t first_ns = 0, last_ns = 0;
  for (const Chunk& chunk : chunks_) {
    Bytes indices;
    for (const auto& [channel, offset] : chunk.indices) indices.u16(channel).u64(offset);
    summary += record(Op::kChunkIndex, Bytes()
                                           .time(chunk.first_ns)
                                           .time(chunk.last_ns)
                                           .u64(chunk.offset)
                                           .u64(chunk.length)
                                           .text(indices.str())
                                           .u64(chunk.index_length)
                                           .text("")
                                           .u64(chunk.size)
                                           .u64(chunk.size));
    first_ns = &chunk == chunks_.data() ? chunk.first_ns : std::min(first_ns, chunk.first_ns);
    last_ns = std::max(last_ns, chunk.last_ns);
  }
  Bytes counts;
  for (const auto& [channel, count] : sequences_) {
    counts.u16(channel).u64(count);
    messages += count;
  }
  summary += record(Op::kStatistics, Bytes()
                                         .u64(messages)
                                         .u16(schemas_)
                                         .u32(channels_)
                                         .u32(0)
                                         .u32(0)
                                         .u32(static_cast<uint32_t>(chunks_.size()))
                                         .time(first_ns)
                                         .time(last_ns)
                                         .text(counts.str()));
  const std::string data_end = record(Op::kDataEnd, Bytes().u32(0));
  return data_end + summary +
         record(Op::kFooter, Bytes().u64(size_ + data_end.size()).u64(0).u32(0)) +
         std::string(kMagic);
}

Status McapFile::close() {
  if (!file_.is_open()) return status_;
  if (const Status flushed = flush(); flushed) (void)write(end_of_data());
  if (status_) status_ = file_.sync();
  const Status closed = file_.close();
  return status_ ? closed : status_;
}

}  // namespace sightline::record
