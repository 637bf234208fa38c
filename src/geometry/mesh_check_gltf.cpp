// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "geometry/gltf/checker.hpp"
#include "geometry/mesh_check.hpp"

namespace sightline::geometry {
namespace {

constexpr int kMaxNesting = 32;  // of brackets in the text

int nesting_of(std::string_view text) {
  int depth = 0;
  int deepest = 0;
  bool quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\') ++i;
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    if (c == '{' || c == '[') deepest = std::max(deepest, ++depth);
    if (c == '}' || c == ']') --depth;
  }
  return deepest;
}

Result<CheckedMesh> checked_document(std::string_view text, bool has_chunk, size_t chunk_bytes,
                                     const std::string& where) {
  if (nesting_of(text) > kMaxNesting) {
    return make_error(ErrorCode::kInvalidInput, where, "JSON nested too deeply");
  }
  const geometry::Json document = geometry::Json::parse(text, nullptr, false);
  if (!document.is_object())
    return make_error(ErrorCode::kInvalidInput, where, "not a glTF document");
  SL_ASSIGN(const auto kept,
            geometry::GltfChecker(document, has_chunk, chunk_bytes, where).check());
  return CheckedMesh{kept.document.dump(), {}, kept.faces};
}

uint32_t word_at(std::string_view content, size_t at) {
  uint32_t word = 0;
  std::memcpy(&word, content.data() + at, sizeof word);
  return word;
}

void append_word(uint32_t word, std::string* out) {
  out->append(reinterpret_cast<const char*>(&word), sizeof word);
}

constexpr uint32_t kGlbMagic = 0x46546C67;
constexpr uint32_t kJsonChunk = 0x4E4F534A;
constexpr uint32_t kBinaryChunk = 0x004E4942;

}  // namespace

Result<CheckedMesh> check_gltf(std::string_view text, const std::string& where) {
  return checked_document(text, false, 0, where);
}

Result<CheckedMesh> check_glb(std::string_view content, const std::string& where) {
  const auto damaged = [&where] {
    return make_error(ErrorCode::kInvalidInput, where, "not a binary glTF 2 file, or cut short");
  };
  if (content.size() < 20 || word_at(content, 0) != kGlbMagic || word_at(content, 4) != 2 ||
      word_at(content, 8) != content.size() || word_at(content, 16) != kJsonChunk) {
    return damaged();
  }
  const size_t json_bytes = word_at(content, 12);
  if (json_bytes > content.size() - 20) return damaged();
  std::string_view rest = content.substr(20 + json_bytes);
  std::string_view binary;
  if (rest.size() >= 8 && word_at(rest, 4) == kBinaryChunk) {
    if (word_at(rest, 0) > rest.size() - 8) return damaged();
    binary = rest.substr(8, word_at(rest, 0));
  }
  SL_ASSIGN(const CheckedMesh checked, checked_document(content.substr(20, json_bytes),
                                                        !binary.empty(), binary.size(), where));
  std::string document = *checked.content;
  while (document.size() % 4 != 0) document += ' ';
  std::string padded(binary);
  while (padded.size() % 4 != 0) padded += '\0';
  std::string out;
  append_word(kGlbMagic, &out);
  append_word(2, &out);
  const size_t binary_total = padded.empty() ? 0 : 8 + padded.size();
  append_word(static_cast<uint32_t>(20 + document.size() + binary_total), &out);
  append_word(static_cast<uint32_t>(document.size()), &out);
  append_word(kJsonChunk, &out);
  out += document;
  if (!padded.empty()) {
    append_word(static_cast<uint32_t>(padded.size()), &out);
    append_word(kBinaryChunk, &out);
    out += padded;
  }
  return CheckedMesh{std::move(out), {}, checked.faces};
}

}  // namespace sightline::geometry
