// SPDX-License-Identifier: Apache-2.0
#include "config/section_reader.hpp"

#include <algorithm>
#include <charconv>
#include <set>

namespace sightline::config {
namespace {

std::optional<Rgb> parse_color(std::string_view text) {
  if (text.size() != 7 || text[0] != '#') return std::nullopt;
  uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data() + 1, text.data() + 7, value, 16);
  if (error != std::errc() || end != text.data() + 7) return std::nullopt;
  return Rgb{static_cast<uint8_t>(value >> 16), static_cast<uint8_t>(value >> 8 & 0xff),
             static_cast<uint8_t>(value & 0xff)};
}

bool is_element_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_';
  });
}

}  // namespace

bool has_own_key(std::string_view style) {
  return style == "last_seen" || style == "status" || style == "hidden_lines";
}

void SectionReader::file(std::string_view key, std::filesystem::path& field) {
  const auto value = table_.text(key);
  if (!value) return;
  field = resolve(file_, value->text);
  if (!files_.is_file(field)) {
    table_.problem(key, fmt::format("there is no file {}", field.string()), ErrorCode::kNotFound);
  }
}

void SectionReader::directory(std::string_view key, std::filesystem::path& field) {
  const auto value = table_.text(key);
  if (!value) return;
  field = resolve(file_, value->text);
  if (!files_.is_directory(field)) {
    table_.problem(key, fmt::format("there is no folder {}: make it first", field.string()),
                   ErrorCode::kNotFound);
  }
}

void SectionReader::controls(std::string_view key, std::map<std::string, V4l2ControlValue>& field) {
  auto table = table_.table(key);
  if (!table) return;
  for (const std::string& name : table->keys()) {
    if (auto value = table->integer_or_text(name)) field[name] = *std::move(value);
  }
  table->finish();
}

void SectionReader::controls(std::string_view key,
                             std::map<std::string, LibcameraControlValue>& field) {
  auto table = table_.table(key);
  if (!table) return;
  for (const std::string& name : table->keys()) {
    if (auto value = table->number_or_text(name)) field[name] = *std::move(value);
  }
  table->finish();
}

void SectionReader::color(std::string_view key, Rgb& field) {
  const auto value = table_.text(key);
  if (!value) return;
  if (const auto color = parse_color(value->text)) {
    field = *color;
  } else {
    table_.problem(key, fmt::format("expected a color as \"#rrggbb\", found \"{}\"", value->text));
  }
}

void SectionReader::theme(std::string_view key, OverlayStyle& style) {
  const auto name = table_.text(key);
  if (!name) return;
  if (const auto theme = theme_style(name->text)) {
    style = *theme;
    return;
  }
  std::vector<std::string> known(theme_names().begin(), theme_names().end());
  table_.problem(key,
                 fmt::format("\"{}\" is no theme{}", name->text, suggestion(name->text, known)));
}

void SectionReader::styles(std::string_view key, OverlayStyle& style) {
  const auto names = table_.texts(key);
  if (!names) return;
  std::vector<std::string> known;
  for (const std::string_view name : style_names()) {
    if (has_own_key(name)) continue;
    known.emplace_back(name);
    *style_flag(style, name) = false;
  }
  for (const PlacedText& name : *names) {
    if (std::find(known.begin(), known.end(), name.text) != known.end()) {
      *style_flag(style, name.text) = true;
    } else if (has_own_key(name.text)) {
      table_.problem(key, fmt::format("\"{0}\" is a key of its own: {0} = true", name.text));
    } else {
      table_.problem(key,
                     fmt::format("\"{}\" is no style{}", name.text, suggestion(name.text, known)));
    }
  }
}

void SectionReader::host_names(std::string_view key, std::vector<std::string>& field) {
  const auto names = table_.texts(key);
  if (!names) return;
  field.clear();
  for (const PlacedText& name : *names) {
    const bool good =
        !name.text.empty() && name.text.size() <= 253 && std::ranges::all_of(name.text, [](char c) {
          return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                 c == '-' || c == '.';
        });
    if (!good) {
      table_.problem(key,
                     fmt::format("\"{}\" is no host name, such as \"rig.example\"", name.text));
    }
    field.push_back(name.text);
  }
}

void SectionReader::encoders(std::string_view key, std::vector<std::string>& field) {
  const auto names = table_.texts(key);
  if (!names) return;
  field.clear();
  for (const PlacedText& name : *names) {
    if (name.text == "auto") {
      if (names->size() > 1)
        table_.problem(key, "\"auto\" stands alone: it tries all that are known");
      field.clear();
      return;
    }
    if (!is_element_name(name.text)) {
      table_.problem(key, fmt::format("\"{}\" is no name of a GStreamer element", name.text));
    }
    field.push_back(name.text);
  }
}

std::optional<Box3> read_box(TomlTable& table) {
  const bool both = table.require("min", "the corner with the smallest x, y, z [m]") &&
                    table.require("max", "the corner with the largest x, y, z [m]");
  const auto min = table.numbers("min", 3), max = table.numbers("max", 3);
  table.finish();
  if (!both || !min || !max) return std::nullopt;
  const Box3 box{{(*min)[0], (*min)[1], (*min)[2]}, {(*max)[0], (*max)[1], (*max)[2]}};
  if ((box.min.array() < box.max.array()).all()) return box;
  table.problem("max", "must be above min in x, y and z");
  return std::nullopt;
}

}  // namespace sightline::config
