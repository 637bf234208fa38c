// SPDX-License-Identifier: Apache-2.0
#include "record/object_parts.hpp"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "sightline/base/toml_nesting.hpp"

namespace sightline::record {
namespace {

using nlohmann::json;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::vector<PartReference> of_object_file(std::string_view content) {
  std::vector<PartReference> parts;
  if (!check_toml_nesting(content, "")) return parts;
  try {
    const toml::table root = toml::parse(content);
    for (const char* key : {"mesh", "features"}) {
      if (const auto name = root[key].value_exact<std::string>()) parts.push_back({*name});
    }
  } catch (const std::exception&) {
    parts.clear();
  }
  return parts;
}

bool names_texture(const std::string& keyword) {
  static constexpr std::array<std::string_view, 5> kOthers = {"bump", "disp", "decal", "norm",
                                                              "refl"};
  const std::string word = lower(keyword);
  return word.starts_with("map_") ||
         std::find(kOthers.begin(), kOthers.end(), word) != kOthers.end();
}

/// `rest` and what is left of it after its first words: options of a texture come before its name.
PartReference readings(std::string_view rest) {
  constexpr size_t kMostReadings = 32;
  PartReference out;
  while (out.size() < kMostReadings) {
    const size_t begin = rest.find_first_not_of(" \t");
    if (begin == std::string_view::npos) break;
    rest.remove_prefix(begin);
    out.emplace_back(rest.substr(0, rest.find_last_not_of(" \t\r") + 1));
    const size_t end = rest.find_first_of(" \t");
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end);
  }
  return out;
}

constexpr size_t kMostParts = 10'000;

/// References of the lines whose first word `names` says name a file.
template <typename Names>
std::vector<PartReference> of_lines(std::string_view content, Names names) {
  std::vector<PartReference> parts;
  for (size_t at = 0; at < content.size() && parts.size() < kMostParts;) {
    const size_t end = std::min(content.find('\n', at), content.size());
    std::string_view line = content.substr(at, end - at);
    at = end + 1;
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    const size_t space = line.find_first_of(" \t");
    if (space == std::string_view::npos ||
        !names(std::string(line.substr(0, std::min<size_t>(space, 16)))))
      continue;
    PartReference part = readings(line.substr(space));
    if (!part.empty()) parts.push_back(std::move(part));
  }
  return parts;
}

/// "%20" and the like, as addresses have them.
std::string decoded(const std::string& uri) {
  std::string out;
  for (size_t i = 0; i < uri.size(); ++i) {
    unsigned code = 0;
    const char* const digits = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(digits, digits + 2, code, 16).ptr == digits + 2) {
      out += static_cast<char>(code);
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

std::vector<PartReference> of_gltf(std::string_view text) {
  std::vector<PartReference> parts;
  const json document = json::parse(text, nullptr, false);
  if (!document.is_object()) return parts;
  for (const char* list : {"buffers", "images"}) {
    for (const json& item : document.value(list, json::array())) {
      if (!item.is_object() || !item.contains("uri") || !item["uri"].is_string()) continue;
      const auto uri = item["uri"].get<std::string>();
      if (uri.starts_with("data:")) continue;
      parts.push_back({uri});
      if (const std::string plain = decoded(uri); plain != uri) parts.back().push_back(plain);
    }
  }
  return parts;
}

std::vector<PartReference> of_glb(std::string_view content) {
  constexpr size_t kHead = 20;  // of the file and of its first chunk
  uint32_t bytes = 0;
  if (content.size() < kHead || !content.starts_with("glTF")) return {};
  std::memcpy(&bytes, content.data() + 12, sizeof bytes);
  if (bytes > content.size() - kHead) return {};
  return of_gltf(content.substr(kHead, bytes));
}

}  // namespace

std::vector<PartReference> parts_named_by(const std::filesystem::path& file,
                                          std::string_view content) {
  const std::string kind = lower(file.extension().string());
  if (kind == ".toml") return of_object_file(content);
  if (kind == ".obj") {
    return of_lines(content, [](const std::string& word) { return word == "mtllib"; });
  }
  if (kind == ".mtl") return of_lines(content, names_texture);
  if (kind == ".gltf") return of_gltf(content);
  if (kind == ".glb") return of_glb(content);
  return {};
}

}  // namespace sightline::record
