// SPDX-License-Identifier: Apache-2.0
#include "record/manifest.hpp"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <set>
#include <sstream>

#include "sightline/base/toml_nesting.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {

using namespace record;

namespace {

constexpr int kMaxSide = 16384;
constexpr size_t kMaxCameras = 64;

std::string place(const std::string& where, const toml::source_region& source) {
  return fmt::format("{}:{}:{}", where, source.begin.line, source.begin.column);
}

/// A file inside the recording's folder: relative and never upwards, for recordings of others.
bool is_inside(const std::string& file) {
  const std::filesystem::path path(file);
  return !file.empty() && path.is_relative() && file.find('\0') == std::string::npos &&
         std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
}

/// Typed access to one table, with errors that name the place.
class Table {
 public:
  Table(const toml::table& table, const std::string& where) : table_(table), where_(where) {}

  template <typename T>
  Result<T> required(const char* key, const char* expected) const {
    SL_ASSIGN(const auto value, optional<T>(key, expected));
    if (value) return *value;
    return make_error(ErrorCode::kInvalidInput, place(where_, table_.source()),
                      "key '{}' ({}) is missing", key, expected);
  }

  template <typename T>
  Result<std::optional<T>> optional(const char* key, const char* expected) const {
    const toml::node* node = table_.get(key);
    if (!node) return std::optional<T>();
    if (const auto value = node->value_exact<T>()) return std::optional<T>(*value);
    return wrong(*node, key, expected);
  }

  Result<int> side(const char* key) const {
    SL_ASSIGN(const int64_t value, required<int64_t>(key, "whole number of pixels"));
    if (value < 1 || value > kMaxSide) {
      return make_error(ErrorCode::kInvalidInput, place(where_, table_.get(key)->source()),
                        "{} is {}, expected 1 to {}", key, value, kMaxSide);
    }
    return static_cast<int>(value);
  }

  Error wrong(const toml::node& node, const char* key, const char* expected) const {
    return make_error(ErrorCode::kInvalidInput, place(where_, node.source()), "'{}' is not a {}",
                      key, expected);
  }

  Status inside(const toml::node& node, const std::string& file) const {
    if (is_inside(file)) return {};
    return make_error(ErrorCode::kInvalidInput, place(where_, node.source()),
                      "'{}' is not a path inside the recording", file);
  }

  void warn_of_others(const std::set<std::string_view>& known,
                      std::vector<std::string>& warnings) const {
    for (const auto& [key, value] : table_) {
      if (!known.contains(key.str())) {
        warnings.push_back(
            fmt::format("{}: unknown key '{}' is ignored", place(where_, key.source()), key.str()));
      }
    }
  }

  const toml::table& raw() const { return table_; }

 private:
  const toml::table& table_;
  const std::string& where_;
};

constexpr std::array kRawFormats = {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv,
                                    PixelFormat::kUyvy, PixelFormat::kGray, PixelFormat::kY10,
                                    PixelFormat::kY12,  PixelFormat::kY16,  PixelFormat::kRgb24,
                                    PixelFormat::kBgr24};

Result<std::optional<PixelFormat>> read_pixels(const Table& table) {
  SL_ASSIGN(const auto name, table.optional<std::string>("pixels", "name of a pixel format"));
  if (!name) return std::optional<PixelFormat>();
  for (const PixelFormat format : kRawFormats) {
    if (*name == to_string(format)) return std::optional(format);
  }
  return table.wrong(*table.raw().get("pixels"), "pixels", "name of a raw pixel format");
}

Result<RecordingManifest::Camera> read_camera(const toml::table& toml, const std::string& where,
                                              std::vector<std::string>& warnings) {
  const Table table(toml, where);
  RecordingManifest::Camera camera;
  camera.line = static_cast<int>(toml.source().begin.line);
  SL_ASSIGN(camera.name, table.required<std::string>("name", "text"));
  if (!is_plain_name(camera.name)) {
    return make_error(ErrorCode::kInvalidInput, place(where, toml.get("name")->source()),
                      "camera name '{}': only letters, digits, '_', '-', '.' (64 at most)",
                      camera.name);
  }
  SL_ASSIGN(camera.file, table.required<std::string>("file", "text"));
  SL_RETURN_IF_ERROR(table.inside(*toml.get("file"), camera.file));
  SL_ASSIGN(camera.codec, table.required<std::string>("codec", "text"));
  if (!is_recording_codec(camera.codec)) {
    return make_error(ErrorCode::kInvalidInput, place(where, toml.get("codec")->source()),
                      "unknown codec '{}', expected h264, mpeg4, mjpeg, ffv1 or rawvideo",
                      camera.codec);
  }
  SL_ASSIGN(camera.width, table.side("width"));
  SL_ASSIGN(camera.height, table.side("height"));
  SL_ASSIGN(camera.pixels, read_pixels(table));
  table.warn_of_others({"name", "file", "codec", "width", "height", "pixels"}, warnings);
  return camera;
}

Status read_cameras(const Table& root, const std::string& where, RecordingManifest& manifest) {
  const toml::node* node = root.raw().get("camera");
  const toml::array* array = node ? node->as_array() : nullptr;
  if (!array || array->empty() || array->size() > kMaxCameras) {
    return make_error(ErrorCode::kInvalidInput, node ? place(where, node->source()) : where,
                      "expected 1 to {} tables [[camera]]", kMaxCameras);
  }
  std::set<std::string> names, files;
  for (const auto& element : *array) {
    if (!element.is_table()) return root.wrong(element, "camera", "table");
    SL_ASSIGN(auto camera, read_camera(*element.as_table(), where, manifest.warnings));
    if (!names.insert(camera.name).second || !files.insert(camera.file).second) {
      return make_error(ErrorCode::kInvalidInput, place(where, element.source()),
                        "a second camera has the name '{}' or the file '{}'", camera.name,
                        camera.file);
    }
    manifest.cameras.push_back(std::move(camera));
  }
  return {};
}

/// The texts of a list; none without the key.
Result<std::vector<std::pair<std::string, const toml::node*>>> read_texts(const Table& root,
                                                                          const char* key,
                                                                          const char* expected) {
  std::vector<std::pair<std::string, const toml::node*>> texts;
  const toml::node* node = root.raw().get(key);
  if (!node) return texts;
  if (!node->is_array()) return root.wrong(*node, key, expected);
  for (const auto& element : *node->as_array()) {
    const auto text = element.value_exact<std::string>();
    if (!text) return root.wrong(element, key, expected);
    texts.emplace_back(*text, &element);
  }
  return texts;
}

Status read_files(const Table& root, const std::string& where, RecordingManifest& manifest) {
  SL_ASSIGN(const auto objects, read_texts(root, "objects", "list of file names"));
  for (const auto& [file, node] : objects) {
    SL_RETURN_IF_ERROR(root.inside(*node, file));
    manifest.objects.push_back(file);
  }
  SL_ASSIGN(const auto left_out, read_texts(root, "left_out", "list of texts"));
  for (const auto& [sentence, node] : left_out) {
    manifest.left_out.push_back(sentence);
    manifest.warnings.push_back(
        fmt::format("{}: when it was recorded, {}", place(where, node->source()), sentence));
  }
  SL_ASSIGN(manifest.scene, root.optional<std::string>("scene", "file name"));
  if (manifest.scene) SL_RETURN_IF_ERROR(root.inside(*root.raw().get("scene"), *manifest.scene));
  return {};
}

Result<RecordingManifest> read_manifest(const toml::table& toml, const std::string& where) {
  const Table root(toml, where);
  RecordingManifest manifest;
  SL_ASSIGN(const int64_t format, root.required<int64_t>("format", "whole number"));
  if (format != 1) {
    return make_error(ErrorCode::kInvalidInput, place(where, toml.get("format")->source()),
                      "format is {}, this program reads format 1", format);
  }
  SL_ASSIGN(manifest.name, root.required<std::string>("name", "text"));
  SL_ASSIGN(const auto start, root.optional<toml::date_time>("start_utc", "date and time"));
  if (start) {
    std::ostringstream text;
    text << *start;
    manifest.start_utc = text.str();
  }
  SL_ASSIGN(manifest.start_monotonic_ns,
            root.optional<int64_t>("start_monotonic_ns", "whole number"));
  SL_RETURN_IF_ERROR(read_cameras(root, where, manifest));
  SL_RETURN_IF_ERROR(read_files(root, where, manifest));
  root.warn_of_others({"format", "name", "start_utc", "start_monotonic_ns", "objects", "left_out",
                       "scene", "camera"},
                      manifest.warnings);
  return manifest;
}

/// A TOML basic string.
std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string toml_list(const std::vector<std::string>& texts) {
  std::string out = "[";
  for (size_t i = 0; i < texts.size(); ++i) out += (i ? ", " : "") + toml_string(texts[i]);
  return out + "]";
}

}  // namespace

bool record::is_recording_codec(std::string_view codec) {
  static constexpr std::array<std::string_view, 5> kCodecs = {"h264", "mpeg4", "mjpeg", "ffv1",
                                                              "rawvideo"};
  return std::find(kCodecs.begin(), kCodecs.end(), codec) != kCodecs.end();
}

bool record::is_plain_name(std::string_view name) {
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '_' || c == '-' || c == '.';
         });
}

Result<RecordingManifest> parse_recording_toml(std::string_view text, const std::string& where) {
  SL_RETURN_IF_ERROR(check_toml_nesting(text, where));
  try {
    return read_manifest(toml::parse(text), where);
  } catch (const toml::parse_error& error) {
    return make_error(ErrorCode::kInvalidInput, place(where, error.source()), "{}",
                      error.description());
  } catch (const std::exception& error) {
    return make_error(ErrorCode::kInvalidInput, where, "cannot parse: {}", error.what());
  }
}

std::string record::format_recording_toml(const RecordingManifest& manifest) {
  std::string text = fmt::format("format = 1\nname = {}\n", toml_string(manifest.name));
  if (!manifest.start_utc.empty()) text += fmt::format("start_utc = {}\n", manifest.start_utc);
  if (manifest.start_monotonic_ns) {
    text += fmt::format("start_monotonic_ns = {}  # the same moment in frames.csv\n",
                        *manifest.start_monotonic_ns);
  }
  text += fmt::format("objects = {}\n", toml_list(manifest.objects));
  if (!manifest.left_out.empty()) {
    text += fmt::format("left_out = {}\n", toml_list(manifest.left_out));
  }
  if (manifest.scene) text += fmt::format("scene = {}\n", toml_string(*manifest.scene));
  for (const auto& camera : manifest.cameras) {
    text += fmt::format("\n[[camera]]\nname = {}\nfile = {}\ncodec = {}\nwidth = {}\nheight = {}\n",
                        toml_string(camera.name), toml_string(camera.file),
                        toml_string(camera.codec), camera.width, camera.height);
    if (camera.pixels) {
      text += fmt::format("pixels = {}\n", toml_string(to_string(*camera.pixels)));
    }
  }
  return text;
}

}  // namespace sightline
