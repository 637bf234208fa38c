// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/overlay_keys.hpp"

#include <cmath>

#include "config/section_reader.hpp"

namespace sightline {
namespace {

// Visits the keys of a style as SectionReader does, and notes what they hold.
class KeyLister {
 public:
  void theme(std::string_view, const OverlayStyle&) {}
  void styles(std::string_view key, OverlayStyle& style) {
    std::vector<std::string> names;
    for (const std::string_view name : style_names()) {
      if (!config::has_own_key(name) && *style_flag(style, name)) names.emplace_back(name);
    }
    add(key, std::move(names));
  }
  void flag(std::string_view key, bool value) { add(key, value); }
  void color(std::string_view key, const Rgb& value) {
    add(key, fmt::format("#{:02x}{:02x}{:02x}", value.r, value.g, value.b));
  }
  template <typename Value, size_t kCount>
  void choice(std::string_view key, Value value, const config::Choices<Value, kCount>& choices) {
    for (const auto& [name, meaning] : choices) {
      if (meaning == value) add(key, std::string(name));
    }
  }
  void number(std::string_view key, double value, double, double, std::string_view) {
    add(key, std::round(value * 1e6) / 1e6);
  }
  void integer(std::string_view key, int64_t value, int64_t, int64_t, std::string_view) {
    add(key, value);
  }

  std::vector<std::pair<std::string, OverlayValue>> take() { return std::move(list_); }

 private:
  void add(std::string_view key, OverlayValue value) {
    list_.emplace_back(std::string(key), std::move(value));
  }
  std::vector<std::pair<std::string, OverlayValue>> list_;
};

}  // namespace

bool is_overlay_key(std::string_view style) { return config::has_own_key(style); }

Status apply_overlay_keys(std::string_view toml, OverlayStyle& style) {
  SL_ASSIGN(auto document, config::TomlDocument::parse(toml, "overlay"));
  const InstallationFiles no_files;
  const std::filesystem::path nowhere;
  config::TomlTable table = document.root();
  config::SectionReader reader(table, nowhere, no_files);
  OverlayStyle changed = style;
  config::visit(reader, changed);
  table.finish();
  if (!document.problems().empty()) return document.problems().error();
  style = changed;
  return {};
}

std::vector<std::pair<std::string, OverlayValue>> overlay_keys(const OverlayStyle& style) {
  KeyLister lister;
  OverlayStyle copy = style;
  config::visit(lister, copy);
  return lister.take();
}

}  // namespace sightline
