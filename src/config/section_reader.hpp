// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "config/names.hpp"
#include "config/sections.hpp"
#include "config/toml_reader.hpp"
#include "sightline/geometry/box3.hpp"

namespace sightline::config {

/// Of the styles, switches with a key of their own, because they are not marks but occasions to
/// draw.
bool has_own_key(std::string_view style);

/// Fills the fields of a section (sections.hpp) from a table. Absent keys leave them as they are.
class SectionReader {
 public:
  /// Paths start at the folder of `file`.
  SectionReader(TomlTable& table, const std::filesystem::path& file, const InstallationFiles& files)
      : table_(table), file_(file), files_(files) {}

  void flag(std::string_view key, bool& field) { field = table_.flag(key).value_or(field); }

  template <typename Field>
  void integer(std::string_view key, Field& field, int64_t low, int64_t high,
               std::string_view unit) {
    if (const auto value = table_.integer(key, low, high, unit)) field = static_cast<Field>(*value);
  }

  template <typename Field>
  void number(std::string_view key, Field& field, double low, double high, std::string_view unit) {
    if (const auto value = table_.number(key, low, high, unit)) field = static_cast<Field>(*value);
  }

  template <size_t kCount>
  void number_of(std::string_view key, double& field, const std::array<double, kCount>& allowed) {
    const auto value = table_.number(key, 0, 1, "a number");
    if (!value) return;
    for (const double candidate : allowed) {
      if (*value == candidate) {
        field = candidate;
        return;
      }
    }
    std::string list;
    for (const double candidate : allowed) list += fmt::format(" {}", candidate);
    table_.problem(key, fmt::format("expected one of{}, found {}", list, *value));
  }

  /// A time in seconds.
  void seconds(std::string_view key, Duration& field, double low, double high) {
    if (const auto value = table_.number(key, low, high, "a time in seconds")) {
      field = from_seconds(*value);
    }
  }

  void text(std::string_view key, std::string& field) {
    if (const auto value = table_.text(key)) field = value->text;
  }

  void file(std::string_view key, std::filesystem::path& field);
  void directory(std::string_view key, std::filesystem::path& field);

  template <typename Value, size_t kCount>
  void choice(std::string_view key, Value& field, const Choices<Value, kCount>& choices) {
    const auto value = table_.text(key);
    if (!value) return;
    std::vector<std::string> names;
    for (const auto& [name, meaning] : choices) {
      if (name == value->text) {
        field = meaning;
        return;
      }
      names.emplace_back(name);
    }
    table_.problem(
        key, fmt::format("\"{}\" is not known{}", value->text, suggestion(value->text, names)));
  }

  /// A list of choices, each at most once.
  template <typename Value, size_t kCount>
  void choices(std::string_view key, std::vector<Value>& field,
               const Choices<Value, kCount>& known) {
    const auto list = table_.texts(key);
    if (!list) return;
    field.clear();
    for (const PlacedText& one : *list) {
      std::vector<std::string> names;
      const Value* found = nullptr;
      for (const auto& [name, meaning] : known) {
        names.emplace_back(name);
        if (name == one.text) found = &meaning;
      }
      if (found == nullptr) {
        table_.problem(key,
                       fmt::format("\"{}\" is not known{}", one.text, suggestion(one.text, names)));
      } else if (std::ranges::find(field, *found) != field.end()) {
        table_.problem(key, fmt::format("\"{}\" comes twice", one.text));
      } else {
        field.push_back(*found);
      }
    }
  }

  /// A table of numbers and texts.
  void controls(std::string_view key, std::map<std::string, V4l2ControlValue>& field);
  /// Three numbers.
  void point(std::string_view key, std::optional<Eigen::Vector3d>& field) {
    if (const auto n = table_.numbers(key, 3)) field = Eigen::Vector3d((*n)[0], (*n)[1], (*n)[2]);
  }
  void direction(std::string_view key, Eigen::Vector3d& field) {
    if (const auto n = table_.numbers(key, 3)) field = Eigen::Vector3d((*n)[0], (*n)[1], (*n)[2]);
  }
  void controls(std::string_view key, std::map<std::string, LibcameraControlValue>& field);
  void color(std::string_view key, Rgb& field);
  void theme(std::string_view key, OverlayStyle& style);
  void styles(std::string_view key, OverlayStyle& style);
  void host_names(std::string_view key, std::vector<std::string>& field);
  void encoders(std::string_view key, std::vector<std::string>& field);

 private:
  TomlTable& table_;
  const std::filesystem::path& file_;
  const InstallationFiles& files_;
};

/// Corners `min` and `max`, three numbers each [m]; nullopt after a problem was noted.
std::optional<Box3> read_box(TomlTable& table);

}  // namespace sightline::config
