// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "record/out_file.hpp"

namespace sightline::record {

/// Writes MCAP (https://mcap.dev/spec, version 0) of JSON messages: chunks without compression, and
/// an index at the end. A file without its end opens too, up to the last flush().
class McapFile {
 public:
  static Result<std::unique_ptr<McapFile>> create(const std::filesystem::path& path);
  ~McapFile() { (void)close(); }
  McapFile(const McapFile&) = delete;
  McapFile& operator=(const McapFile&) = delete;

  /// `schema`: name and JSON schema.
  uint16_t add_schema(std::string_view name, std::string_view schema);
  uint16_t add_channel(uint16_t schema, std::string_view topic);
  void append(uint16_t channel, int64_t utc_ns, std::string_view json);
  /// Writes what was appended as a chunk.
  Status flush();
  /// Bytes that wait for the next flush().
  size_t pending() const { return records_.size(); }
  /// What was flushed. [bytes]
  uint64_t size() const { return size_; }
  Status sync() { return file_.sync(); }
  /// Writes the index. Only the first call does something.
  Status close();

 private:
  struct Chunk {
    uint64_t offset, length, index_length, size;
    int64_t first_ns, last_ns;
    std::map<uint16_t, uint64_t> indices;  // offsets of the message indices, by channel
  };
  struct Place {
    int64_t time_ns;
    uint64_t offset;  // in the chunk's records
  };

  explicit McapFile(OutFile file) : file_(std::move(file)) {}
  Status write(const std::string& bytes);
  std::string end_of_data() const;

  OutFile file_;
  uint64_t size_ = 0;                          // of the file
  std::string definitions_;                    // schemas and channels, all
  std::string records_;                        // of the chunk that is being made
  std::map<uint16_t, std::vector<Place>> at_;  // of its messages, by channel
  int64_t first_ns_ = 0, last_ns_ = 0;         // of its messages
  std::map<uint16_t, uint32_t> sequences_;     // messages so far, by channel
  uint16_t schemas_ = 0, channels_ = 0;
  std::vector<Chunk> chunks_;
  Status status_;
};

}  // namespace sightline::record
