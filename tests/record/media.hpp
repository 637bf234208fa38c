// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "sightline/image/image.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/writer.hpp"

namespace sightline::test {

/// A folder that goes away with its owner.
class TempFolder {
 public:
  TempFolder();
  ~TempFolder();
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline constexpr int kWidth = 64, kHeight = 48;

/// A moving pattern: every number gives another image.
std::shared_ptr<Image> pattern(int number, int width = kWidth, int height = kHeight);

/// Hash of all visible bytes of an image.
uint64_t hash_of(const I420View& view, uint64_t seed = 0);

/// Bytes that own themselves.
FramePayload payload_of(std::vector<uint8_t> bytes, bool keyframe = true);

struct Packet {
  std::vector<uint8_t> bytes;
  int64_t pts = 0;  ///< [ms]
  bool keyframe = false;
};
/// A compressed test video, one packet per image, in decoding order.
struct Stream {
  std::vector<Packet> packets;
  std::vector<uint8_t> extradata;
};
/// Encodes `count` patterns, 100 ms apart. `encoder`: "mjpeg", "libx264", "mpeg4", "ffv1". Empty
/// if this libavcodec does not have it.
Stream encode_patterns(const std::string& encoder, int count, int gop, int b_frames = 0);

/// Writes a stream as Matroska, as it is.
void write_stream(const std::filesystem::path& path, const std::string& codec,
                  const Stream& stream);

/// A frame of camera `camera` at `ms`, sequence `number`, showing pattern(number).
FramePtr frame_at(uint32_t camera, int number, int64_t ms);

/// Two cameras, "left" and "right", raw I420, `count` frames each from 1 s on, 100 ms apart; right
/// is 30 ms late.
void write_small_recording(const std::filesystem::path& folder, int count = 20);

std::string read_text(const std::filesystem::path& path);
void write_text(const std::filesystem::path& path, const std::string& text);
/// Replaces the first occurrence of `from`.
void edit_text(const std::filesystem::path& path, const std::string& from, const std::string& to);

/// A folder of recordings beside the project; empty if it is not there.
std::filesystem::path shared_recording(const std::string& name);
std::filesystem::path bench_recording();

}  // namespace sightline::test
