// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/cell_draft.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <sstream>

#include "config/names.hpp"
#include "sightline/base/toml_nesting.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// What differs from host to host, or is made anew.
constexpr std::array<std::string_view, 11> kReplaced = {
    "role",          "name",    "host",        "broker", "port",     "user",
    "password_file", "ca_file", "certificate", "key",    "neighbors"};

Error refuse(const fs::path& path, const toml::node& node, std::string_view text) {
  const auto& begin = node.source().begin;
  return make_error(ErrorCode::kInvalidInput,
                    fmt::format("{}:{}:{}", path.string(), begin.line, begin.column), "{}", text);
}

// Byte at which a line, counted from 1, begins; the end of the text for those that follow it.
size_t line_begin(std::string_view text, size_t line) {
  size_t at = 0;
  for (; line > 1 && at < text.size(); --line) {
    at = std::min(text.find('\n', at), text.size() - 1) + 1;
  }
  return at;
}

std::string_view trimmed(std::string_view line) {
  const size_t begin = line.find_first_not_of(" \t\r");
  return begin == std::string_view::npos ? std::string_view() : line.substr(begin);
}

// The line of the first table that stands behind `line`.
void next_table(const toml::node& node, size_t line, size_t& found) {
  if (const auto* table = node.as_table()) {
    const size_t begin = table->source().begin.line;
    if (!table->is_inline() && begin > line) found = std::min(found, begin);
    for (const auto& [key, value] : *table) next_table(value, line, found);
  } else if (const auto* array = node.as_array()) {
    for (const toml::node& element : *array) next_table(element, line, found);
  }
}

std::string text_of(const toml::table& table, const char* key) {
  return table[key].value<std::string>().value_or("");
}

class Reader {
 public:
  Reader(std::string_view text, const fs::path& path, CellDraft& draft)
      : text_(text), path_(path), draft_(draft) {}

  Status read(const toml::table& root) {
    if (const auto* cameras = root["camera"].as_array()) {
      for (const toml::node& node : *cameras) SL_RETURN_IF_ERROR(read_camera(node));
    }
    if (const toml::node* cell = root.get("cell")) {
      if (!cell->is_table()) return refuse(path_, *cell, "cell: expected a section [cell]");
      SL_RETURN_IF_ERROR(read_cell(root, *cell->as_table()));
    }
    for (const auto& [key, value] : root) {
      if (key != "cell") collect(value);
    }
    return {};
  }

 private:
  Status read_camera(const toml::node& node) {
    const auto* table = node.as_table();
    if (table == nullptr || table->is_inline()) {
      return refuse(path_, node, "camera: expected a section [[camera]]");
    }
    CellDraft::Camera camera{text_of(*table, "name"), text_of(*table, "host"),
                             static_cast<unsigned>(table->source().begin.line),
                             text_of(*table, "cell")};
    if (camera.name.empty()) return refuse(path_, node, "camera: lacks a name");
    draft_.cameras.push_back(std::move(camera));
    return {};
  }

  Status read_cell(const toml::table& root, const toml::table& cell) {
    const size_t line = cell.source().begin.line;
    draft_.cell_begin = line_begin(text_, line);
    if (cell.is_inline() || !trimmed(text_.substr(draft_.cell_begin)).starts_with("[cell]")) {
      return refuse(path_, cell, "cell: write it as a section that begins with the line [cell]");
    }
    size_t next = SIZE_MAX;
    next_table(root, line, next);
    draft_.cell_end = line_begin(text_, next);
    give_back_comments();
    draft_.name = text_of(cell, "name");
    draft_.host = text_of(cell, "host");
    draft_.broker = text_of(cell, "broker");
    if (const auto* neighbors = cell["neighbors"].as_array()) {
      for (const toml::node& node : *neighbors) {
        draft_.neighbors.push_back(node.value<std::string>().value_or(""));
      }
    }
    const std::string role = text_of(cell, "role");
    draft_.fuses = role.empty() ? !draft_.broker.empty() : role != "cameras";
    for (const auto& [key, value] : cell) {
      if (std::ranges::find(kReplaced, key.str()) != kReplaced.end()) continue;
      if (value.is_table()) return refuse(path_, value, "cell: has no sections");
      std::ostringstream out;
      value.visit([&out](const auto& node) { out << node; });
      draft_.kept += fmt::format("{} = {}\n", key.str(), out.str());
    }
    return {};
  }

  // Comments right before a section are about that.
  void give_back_comments() {
    while (draft_.cell_end > draft_.cell_begin) {
      const size_t end = draft_.cell_end - (text_[draft_.cell_end - 1] == '\n' ? 1 : 0);
      const size_t before = text_.rfind('\n', end == 0 ? 0 : end - 1);
      const size_t begin = before == std::string_view::npos ? 0 : before + 1;
      const std::string_view line = trimmed(text_.substr(begin, end - begin));
      if (begin <= draft_.cell_begin || (!line.empty() && line[0] != '#')) return;
      draft_.cell_end = begin;
    }
  }

  void collect(const toml::node& node) {
    if (const auto* table = node.as_table()) {
      for (const auto& [key, value] : *table) collect(value);
    } else if (const auto* array = node.as_array()) {
      for (const toml::node& element : *array) collect(element);
    } else if (const auto* text = node.as_string()) {
      note_file(text->get());
    }
  }

  void note_file(const std::string& name) {
    if (name.empty() || name.find('\0') != std::string::npos) return;
    std::error_code ignored;
    if (!fs::is_regular_file(config::resolve(path_, name), ignored)) return;
    const fs::path relative = fs::path(name).lexically_normal();
    const bool below = relative.is_relative() && *relative.begin() != "..";
    auto& list = below ? draft_.files : draft_.elsewhere;
    if (std::ranges::find(list, relative) == list.end()) list.push_back(relative);
  }

  std::string_view text_;
  const fs::path& path_;
  CellDraft& draft_;
};

}  // namespace

Result<CellDraft> read_cell_draft(std::string_view text, const fs::path& path) {
  SL_RETURN_IF_ERROR(check_toml_nesting(text, path.string()));
  CellDraft draft;
  try {
    const toml::table root = toml::parse(text, path.string());
    SL_RETURN_IF_ERROR(Reader(text, path, draft).read(root));
  } catch (const toml::parse_error& error) {
    const auto& begin = error.source().begin;
    return make_error(ErrorCode::kInvalidInput,
                      fmt::format("{}:{}:{}", path.string(), begin.line, begin.column), "{}",
                      error.description());
  } catch (const std::exception& error) {
    return make_error(ErrorCode::kInvalidInput, path.string(), "cannot parse: {}", error.what());
  }
  return draft;
}

std::string with_cell(std::string_view text, const CellDraft& draft,
                      const std::map<std::string, std::string>& hosts, std::string_view section) {
  struct Edit {
    size_t begin, end;
    std::string text;
  };
  std::vector<Edit> edits;
  const bool has_cell = draft.cell_end > draft.cell_begin;
  const size_t begin = has_cell ? draft.cell_begin : text.size();
  edits.push_back({begin, has_cell ? draft.cell_end : begin,
                   fmt::format("{}{}{}", has_cell ? "" : "\n", section, has_cell ? "\n" : "")});
  for (const CellDraft::Camera& camera : draft.cameras) {
    const auto host = hosts.find(camera.name);
    if (!camera.host.empty() || host == hosts.end()) continue;
    const size_t at = line_begin(text, camera.line + 1);
    edits.push_back({at, at, fmt::format("host = \"{}\"\n", host->second)});
  }
  std::ranges::sort(edits, {}, &Edit::begin);
  std::string out;
  size_t done = 0;
  for (const Edit& edit : edits) {
    out.append(text.substr(done, edit.begin - done)).append(edit.text);
    done = edit.end;
  }
  return out.append(text.substr(done));
}

}  // namespace sightline
