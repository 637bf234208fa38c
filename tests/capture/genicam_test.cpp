// SPDX-License-Identifier: Apache-2.0
// Formats, unpackers and colors of GenICam cameras, from generated buffers.
#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <set>
#include <vector>

#include "capture/aravis/genicam_formats.hpp"
#include "capture/aravis/genicam_image.hpp"
#include "capture/common/bytes_pool.hpp"
#include "support/allocations.hpp"

namespace sightline::capture {
namespace {

// --- formats ---

TEST(GenicamFormats, CodesAndNamesAreUnique) {
  std::set<uint32_t> codes;
  std::set<std::string_view> names;
  for (const GenicamFormat& format : genicam_formats()) {
    EXPECT_TRUE(codes.insert(format.code).second) << format.name;
    EXPECT_TRUE(names.insert(format.name).second) << format.name;
    EXPECT_EQ(find_genicam_format(format.code), &format);
    EXPECT_EQ(find_genicam_format(format.name), &format);
  }
  EXPECT_EQ(find_genicam_format(0u), nullptr);
  EXPECT_EQ(find_genicam_format("Coord3D_ABC32f"), nullptr);
}

// A code of the naming convention holds the bits of a pixel in its third byte.
TEST(GenicamFormats, RowsAreAsLongAsTheCodeSays) {
  for (const GenicamFormat& format : genicam_formats()) {
    const size_t bits = format.code >> 16 & 0xFF;
    EXPECT_EQ(genicam_row_bytes(format, 640), 640 * bits / 8) << format.name;
  }
  EXPECT_EQ(genicam_row_bytes(*find_genicam_format("Mono12p"), 641), 0u);
  EXPECT_EQ(genicam_row_bytes(*find_genicam_format("Mono10p"), 642), 0u);
  EXPECT_EQ(genicam_row_bytes(*find_genicam_format("Mono10Packed"), 642), 963u);
  EXPECT_EQ(genicam_row_bytes(*find_genicam_format("Mono8"), 641), 641u);
}

// --- unpackers against packers written from the standard's bit diagrams ---

void put_bit(std::vector<uint8_t>& bytes, size_t bit, unsigned value) {
  if (value != 0) bytes[bit / 8] = static_cast<uint8_t>(bytes[bit / 8] | 1u << bit % 8);
}

std::vector<uint8_t> pack(const GenicamFormat& format, const std::vector<uint16_t>& samples) {
  const int width = static_cast<int>(samples.size());
  std::vector<uint8_t> bytes(genicam_row_bytes(format, width));
  const auto bits = static_cast<size_t>(format.bits);
  for (size_t i = 0; i < samples.size(); ++i) {
    for (size_t b = 0; b < bits; ++b) {
      const unsigned value = samples[i] >> b & 1u;
      if (format.packing == Packing::kBitStream) {
        put_bit(bytes, i * bits + b, value);
      } else {  // high eight bits in bytes 0 and 2 of three, the rest in the nibbles of byte 1
        const size_t low = bits - 8, group = i / 2 * 24;
        const size_t high_byte = i % 2 == 0 ? 0 : 16, nibble = i % 2 == 0 ? 8 : 12;
        put_bit(bytes, group + (b < low ? nibble + b : high_byte + b - low), value);
      }
    }
  }
  return bytes;
}

std::vector<uint16_t> random_samples(size_t count, int bits, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<uint16_t> samples(count);
  for (uint16_t& s : samples) s = static_cast<uint16_t>(random() & ((1u << bits) - 1));
  return samples;
}

TEST(GenicamUnpack, InvertsThePacking) {
  for (const char* name : {"Mono10Packed", "Mono12Packed", "Mono10p", "Mono12p"}) {
    const GenicamFormat& format = *find_genicam_format(name);
    for (const size_t width : {4u, 8u, 640u, 644u}) {
      const auto samples = random_samples(width, format.bits, static_cast<unsigned>(width));
      const auto bytes = pack(format, samples);
      std::vector<uint16_t> out(width, 0xFFFF);
      unpack_row(format.packing, format.bits, bytes.data(), static_cast<int>(width), out.data());
      EXPECT_EQ(out, samples) << name << " " << width;
    }
  }
}

TEST(GenicamUnpack, ExamplesOfTheStandard) {
  uint16_t out[4] = {};
  const uint8_t gige12[] = {0xAB, 0x6C, 0x45};
  unpack_row(Packing::kGige, 12, gige12, 2, out);
  EXPECT_EQ(out[0], 0xABC);
  EXPECT_EQ(out[1], 0x456);
  const uint8_t stream12[] = {0xBC, 0x6A, 0x45};
  unpack_row(Packing::kBitStream, 12, stream12, 2, out);
  EXPECT_EQ(out[0], 0xABC);
  EXPECT_EQ(out[1], 0x456);
}

// --- frames ---

struct Counted {
  std::vector<uint8_t> bytes;
  std::shared_ptr<const void> owner = std::make_shared<int>(0);
};

TEST(GenicamImage, DirectFormatsAreNotCopied) {
  const int width = 6, height = 4, padding = 2;
  GenicamImage image(*find_genicam_format("Mono8"), width, height, padding);
  ASSERT_EQ(image.bytes_needed(), 30u);
  Counted buffer;
  buffer.bytes.resize(32);
  for (size_t i = 0; i < buffer.bytes.size(); ++i) buffer.bytes[i] = static_cast<uint8_t>(i);
  const FramePtr frame = image.frame({}, buffer.bytes, buffer.owner);
  EXPECT_EQ(frame->payload().bytes.data(), buffer.bytes.data());
  EXPECT_EQ(frame->info().format, PixelFormat::kGray);
  EXPECT_EQ(frame->gray().data, buffer.bytes.data());
  EXPECT_EQ(frame->gray().row(1)[0], 8);
  EXPECT_EQ(buffer.owner.use_count(), 2);
}

TEST(GenicamImage, CopiesLetTheBufferGo) {
  GenicamImage image(*find_genicam_format("RGB8"), 4, 4, 0);
  std::vector<uint8_t> bytes(48, 77);
  const FramePtr frame = image.copied_frame({}, bytes);
  EXPECT_NE(frame->payload().bytes.data(), bytes.data());
  std::fill(bytes.begin(), bytes.end(), uint8_t{0});
  EXPECT_EQ(frame->payload().bytes[47], 77);
}

TEST(GenicamImage, PackedMonoBecomesWords) {
  const GenicamFormat& format = *find_genicam_format("Mono12Packed");
  const int width = 8, height = 3;
  std::vector<uint8_t> bytes;
  std::vector<uint16_t> all;
  for (unsigned y = 0; y < height; ++y) {
    const auto samples = random_samples(width, 12, y);
    const auto row = pack(format, samples);
    bytes.insert(bytes.end(), row.begin(), row.end());
    all.insert(all.end(), samples.begin(), samples.end());
  }
  GenicamImage image(format, width, height, 0);
  const FramePtr frame = image.frame({}, bytes, nullptr);
  EXPECT_EQ(frame->info().format, PixelFormat::kY12);
  const auto payload = frame->payload().bytes;
  ASSERT_EQ(payload.size(), all.size() * 2);
  for (size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(payload[2 * i] | payload[2 * i + 1] << 8, all[i]);
  }
}

// A flat color, put through each pattern and packing, comes out as that color.
TEST(GenicamImage, EveryBayerFormatGivesTheColorBack) {
  const int red = 200, green = 120, blue = 40, width = 16, height = 8;
  // BT.601, limited range.
  const double luma = 16 + (65.481 * red + 128.553 * green + 24.966 * blue) / 255;
  const double cb = 128 + (-37.797 * red - 74.203 * green + 112.0 * blue) / 255;
  const double cr = 128 + (112.0 * red - 93.786 * green - 18.214 * blue) / 255;
  for (const GenicamFormat& format : genicam_formats()) {
    if (format.bayer == BayerPattern::kNone) continue;
    SCOPED_TRACE(format.name);
    // The two letters of the name are the first two samples of the first row.
    const std::string letters(format.name.substr(5, 2));
    const bool green_first = letters[0] == 'G';
    const char odd_row =
        green_first ? (letters[1] == 'R' ? 'B' : 'R') : (letters[0] == 'R' ? 'B' : 'R');
    std::vector<uint8_t> bytes;
    for (int y = 0; y < height; ++y) {
      std::vector<uint16_t> samples;
      for (int x = 0; x < width; ++x) {
        char color = letters[static_cast<size_t>(x % 2)];
        if (y % 2 == 1) color = (x % 2 == 0) == green_first ? odd_row : 'G';
        const int value = color == 'R' ? red : color == 'G' ? green : blue;
        samples.push_back(static_cast<uint16_t>(value << (format.bits - 8)));
      }
      if (format.packing != Packing::kNone) {
        const auto row = pack(format, samples);
        bytes.insert(bytes.end(), row.begin(), row.end());
      } else {
        for (const uint16_t s : samples) {
          bytes.push_back(static_cast<uint8_t>(s));
          if (format.bits > 8) bytes.push_back(static_cast<uint8_t>(s >> 8));
        }
      }
    }
    GenicamImage image(format, width, height, 0);
    const FramePtr frame = image.frame({}, bytes, nullptr);
    const I420View view = frame->i420();
    EXPECT_NEAR(view.y.row(4)[8], luma, 2);
    EXPECT_NEAR(view.u.row(2)[4], cb, 2);
    EXPECT_NEAR(view.v.row(2)[4], cr, 2);
  }
}

TEST(BytesPool, RecyclesAndOutlivesItself) {
  std::shared_ptr<uint8_t> kept;
  {
    BytesPool pool(100, 2);
    uint8_t* const first = pool.get().get();
    EXPECT_EQ(pool.get().get(), first);
    kept = pool.get();
  }
  kept.get()[99] = 1;
}

// --- memory ---

TEST(GenicamImage, AllocatesNothingForAFrameOnceWarm) {
  for (const char* const name : {"Mono8", "Mono12Packed", "Mono10p", "RGB8", "BayerRG8"}) {
    GenicamImage image(*find_genicam_format(name), 32, 16, 0);
    const std::vector<uint8_t> bytes(image.bytes_needed(), 100);
    const auto take = [&] {
      image.frame(FrameInfo(), bytes, nullptr)->i420();
      image.copied_frame(FrameInfo(), bytes)->i420();
    };
    for (int i = 0; i < 20; ++i) take();
    const size_t before = test::allocations();
    for (int i = 0; i < 100; ++i) take();
    EXPECT_EQ(test::allocations() - before, 0u) << name;
  }
}

}  // namespace
}  // namespace sightline::capture
