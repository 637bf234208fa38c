// SPDX-License-Identifier: Apache-2.0
#include "record/media/exr.hpp"

#include <openexr.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <cstring>

namespace sightline::record {
namespace {

using namespace std::string_view_literals;

constexpr int kLongestSide = 32768;
constexpr int64_t kMostPixels = int64_t{64} << 20;
constexpr uint64_t kLargestPiece = uint64_t{256} << 20;  // [bytes], unpacked, of all channels

/// What the library asks for and what it complains of.
struct Source {
  std::string_view bytes;
  std::string complaint;
};

Source* source_of(exr_const_context_t context) {
  void* user = nullptr;
  return exr_get_user_data(context, &user) == EXR_ERR_SUCCESS ? static_cast<Source*>(user)
                                                              : nullptr;
}

int64_t read_bytes(exr_const_context_t, void* user, void* to, uint64_t count, uint64_t offset,
                   exr_stream_error_func_ptr_t) {
  const std::string_view bytes = static_cast<const Source*>(user)->bytes;
  if (offset >= bytes.size()) return 0;
  const size_t got = std::min<uint64_t>(count, bytes.size() - offset);
  std::memcpy(to, bytes.data() + offset, got);
  return static_cast<int64_t>(got);
}

int64_t size_of_bytes(exr_const_context_t, void* user) {
  return static_cast<int64_t>(static_cast<const Source*>(user)->bytes.size());
}

void keep_complaint(exr_const_context_t context, exr_result_t, const char* text) {
  Source* const source = source_of(context);
  if (source == nullptr || !source->complaint.empty()) return;
  source->complaint = std::string_view(text).substr(0, 200);
  for (char& c : source->complaint) c = c >= ' ' && c <= '~' ? c : '?';
}

/// Attributes of a header may claim any length.
void* allocate(size_t bytes) { return bytes > 2 * kLargestPiece ? nullptr : std::malloc(bytes); }

exr_context_initializer_t initializer(Source* source) {
  exr_context_initializer_t out = EXR_DEFAULT_CONTEXT_INITIALIZER;
  out.error_handler_fn = keep_complaint;
  out.alloc_fn = allocate;
  out.free_fn = std::free;
  out.user_data = source;
  out.read_fn = read_bytes;
  out.size_fn = size_of_bytes;
  out.max_image_width = out.max_image_height = kLongestSide;
  out.max_tile_width = out.max_tile_height = kLongestSide;
  out.flags = EXR_CONTEXT_FLAG_SILENT_HEADER_PARSE | EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
  return out;
}

/// How well a channel's name says that it holds depth; 0 is best.
size_t rank_of(std::string_view name) {
  static constexpr std::array kNames = {"z"sv, "depth"sv, "v"sv, "y"sv, "g"sv, "r"sv};
  std::string last(name.substr(name.rfind('.') + 1));  // behind the layer's name
  for (char& c : last) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return static_cast<size_t>(std::find(kNames.begin(), kNames.end(), last) - kNames.begin());
}

class ExrReader {
 public:
  ExrReader(std::string_view bytes, const std::string& where) : source_{bytes, {}}, where_(where) {}
  ExrReader(const ExrReader&) = delete;
  ExrReader& operator=(const ExrReader&) = delete;
  ~ExrReader() {
    if (context_ != nullptr) exr_finish(&context_);
  }

  Result<DepthImage> read() {
    const exr_context_initializer_t with = initializer(&source_);
    SL_RETURN_IF_ERROR(done(exr_start_read(&context_, where_.c_str(), &with), "the header"));
    exr_storage_t storage = EXR_STORAGE_LAST_TYPE;
    SL_RETURN_IF_ERROR(done(exr_get_storage(context_, 0, &storage), "the kind of image"));
    if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED) {
      return fault(
          "is a deep image (several depths a pixel), which is not "
          "read; flatten it");
    }
    SL_RETURN_IF_ERROR(read_windows());
    SL_RETURN_IF_ERROR(choose_channel());
    int32_t pieces = 0;
    SL_RETURN_IF_ERROR(done(exr_get_chunk_count(context_, 0, &pieces), "the number of pieces"));
    if (pieces < 1 || static_cast<uint64_t>(pieces) > source_.bytes.size() / sizeof(uint64_t)) {
      return fault("says that it has {} pieces, for which it is too short", pieces);
    }
    SL_RETURN_IF_ERROR(storage == EXR_STORAGE_TILED ? read_tiles() : read_lines());
    return std::move(image_);
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kDamaged, where_, format, std::forward<Args>(args)...);
  }

  Status done(exr_result_t code, const char* what) const {
    if (code == EXR_ERR_SUCCESS) return {};
    return fault("cannot read {} of the exr image: {}", what,
                 source_.complaint.empty() ? exr_get_default_error_message(code)
                                           : source_.complaint.c_str());
  }

  Status read_windows() {
    exr_attr_box2i_t shown{};
    SL_RETURN_IF_ERROR(done(exr_get_data_window(context_, 0, &data_), "the data window"));
    SL_RETURN_IF_ERROR(done(exr_get_display_window(context_, 0, &shown), "the display window"));
    left_ = shown.min.x;
    top_ = shown.min.y;
    for (const exr_attr_box2i_t& window : {data_, shown}) {
      const int64_t width = int64_t{window.max.x} - window.min.x + 1;
      const int64_t height = int64_t{window.max.y} - window.min.y + 1;
      if (width < 1 || height < 1 || width > kLongestSide || height > kLongestSide ||
          width * height > kMostPixels) {
        return fault("is {} x {} pixels", width, height);
      }
      image_.width = static_cast<int>(width);
      image_.height = static_cast<int>(height);
    }
    return {};
  }

  Status choose_channel() {
    const exr_attr_chlist_t* channels = nullptr;
    SL_RETURN_IF_ERROR(done(exr_get_channels(context_, 0, &channels), "the channels"));
    const exr_attr_chlist_entry_t* best = nullptr;
    std::string names;
    for (int i = 0; i < channels->num_channels; ++i) {
      const exr_attr_chlist_entry_t& channel = channels->entries[i];
      if (names.size() < 200) names += (names.empty() ? "" : ", ") + std::string(channel.name.str);
      if (best == nullptr || rank_of(channel.name.str) < rank_of(best->name.str)) best = &channel;
    }
    const bool known = best != nullptr && rank_of(best->name.str) < rank_of("");
    if (!known && channels->num_channels != 1) {
      return fault("has channels {}; depth is in Z, V, Y, G or R, or in the only one", names);
    }
    if (best->x_sampling != 1 || best->y_sampling != 1) {
      return fault("has fewer pixels in channel {} than in the image", best->name.str);
    }
    channel_ = best->name.str;
    return {};
  }

  Status read_lines() {
    int32_t lines = 0;
    SL_RETURN_IF_ERROR(done(exr_get_scanlines_per_chunk(context_, 0, &lines), "the lines"));
    if (lines < 1) return fault("has pieces of {} lines", lines);
    for (int64_t y = data_.min.y; y <= data_.max.y; y += lines) {
      exr_chunk_info_t piece{};
      SL_RETURN_IF_ERROR(done(
          exr_read_scanline_chunk_info(context_, 0, static_cast<int>(y), &piece), "the lines"));
      SL_RETURN_IF_ERROR(read_piece(piece, data_.min.x, y));
    }
    return {};
  }

  Status read_tiles() {
    int32_t width = 0, height = 0;
    SL_RETURN_IF_ERROR(done(exr_get_tile_sizes(context_, 0, 0, 0, &width, &height), "the tiles"));
    if (width < 1 || height < 1) return fault("has tiles of {} x {} pixels", width, height);
    for (int64_t y = data_.min.y; y <= data_.max.y; y += height) {
      for (int64_t x = data_.min.x; x <= data_.max.x; x += width) {
        exr_chunk_info_t piece{};
        const auto column = static_cast<int>((x - data_.min.x) / width);
        const auto row = static_cast<int>((y - data_.min.y) / height);
        SL_RETURN_IF_ERROR(
            done(exr_read_tile_chunk_info(context_, 0, column, row, 0, 0, &piece), "a tile"));
        SL_RETURN_IF_ERROR(read_piece(piece, x, y));
      }
    }
    return {};
  }

  /// Decodes a piece whose first pixel is (x, y) and puts it where it belongs.
  Status read_piece(const exr_chunk_info_t& piece, int64_t x, int64_t y) {
    if (piece.width < 1 || piece.height < 1 || piece.packed_size > source_.bytes.size() ||
        piece.unpacked_size > kLargestPiece) {
      return fault("has a piece of {} x {} pixels that unpacks to {} bytes", piece.width,
                   piece.height, piece.unpacked_size);
    }
    piece_.resize(static_cast<size_t>(piece.width) * static_cast<size_t>(piece.height));
    exr_decode_pipeline_t decoder{};
    exr_result_t code = exr_decoding_initialize(context_, 0, &piece, &decoder);
    if (code == EXR_ERR_SUCCESS) code = point_decoder(piece, &decoder);
    if (code == EXR_ERR_SUCCESS) code = exr_decoding_run(context_, 0, &decoder);
    exr_decoding_destroy(context_, &decoder);
    SL_RETURN_IF_ERROR(done(code, "the pixels"));
    // Only now: a header alone makes no large image.
    image_.depth.resize(static_cast<size_t>(image_.width) * static_cast<size_t>(image_.height));
    for (int64_t row = 0; row < piece.height; ++row) {
      for (int64_t column = 0; column < piece.width; ++column)
        put(x + column, y + row, piece_[static_cast<size_t>(row * piece.width + column)]);
    }
    return {};
  }

  exr_result_t point_decoder(const exr_chunk_info_t& piece, exr_decode_pipeline_t* decoder) {
    for (int i = 0; i < decoder->channel_count; ++i) {
      exr_coding_channel_info_t& channel = decoder->channels[i];
      if (channel_ != channel.channel_name) continue;
      if (channel.width != piece.width || channel.height != piece.height) {
        return EXR_ERR_CORRUPT_CHUNK;
      }
      channel.user_bytes_per_element = sizeof(float);
      channel.user_data_type = EXR_PIXEL_FLOAT;
      channel.user_pixel_stride = sizeof(float);
      channel.user_line_stride = piece.width * static_cast<int>(sizeof(float));
      channel.decode_to_ptr = reinterpret_cast<uint8_t*>(piece_.data());
    }
    return exr_decoding_choose_default_routines(context_, 0, decoder);
  }

  void put(int64_t x, int64_t y, float depth) {
    const int64_t column = x - left_, row = y - top_;
    if (column < 0 || row < 0 || column >= image_.width || row >= image_.height) return;
    image_.depth[static_cast<size_t>(row * image_.width + column)] = depth;
  }

  Source source_;
  const std::string& where_;
  exr_context_t context_ = nullptr;
  exr_attr_box2i_t data_{};
  int64_t left_ = 0, top_ = 0;  ///< first pixel of the display window
  std::string channel_;
  std::vector<float> piece_;
  DepthImage image_;
};

}  // namespace

bool is_exr(std::string_view bytes) { return bytes.starts_with("v/1\x01"sv); }

Result<DepthImage> read_exr_depth(std::string_view bytes, const std::string& where) {
  return ExrReader(bytes, where).read();
}

}  // namespace sightline::record
