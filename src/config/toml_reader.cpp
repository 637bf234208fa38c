// SPDX-License-Identifier: Apache-2.0
#include "config/toml_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "sightline/base/toml_nesting.hpp"

namespace sightline::config {
namespace {

constexpr size_t kMaxProblems = 50;
constexpr size_t kLongestQuote = 60;

Place place_of(const toml::source_region& region) {
  return {std::max(1u, static_cast<unsigned>(region.begin.line)),
          std::max(1u, static_cast<unsigned>(region.begin.column))};
}

std::string quote(std::string_view text) {
  if (text.size() <= kLongestQuote) return fmt::format("\"{}\"", text);
  size_t end = kLongestQuote;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0u) == 0x80u) --end;
  return fmt::format("\"{}...\"", text.substr(0, end));
}

// What a value is, for the second half of "expected ..., found ...".
std::string describe(const toml::node& node) {
  if (const auto* text = node.as_string()) return "the text " + quote(text->get());
  if (const auto* number = node.as_integer()) return fmt::format("{}", number->get());
  if (const auto* number = node.as_floating_point()) return fmt::format("{}", number->get());
  if (const auto* flag = node.as_boolean()) return flag->get() ? "true" : "false";
  if (node.is_array_of_tables()) return "an array of tables";
  if (node.is_array()) return "a list";
  if (node.is_table()) return "a table";
  return "a date or time";
}

std::optional<double> number_of(const toml::node& node) {
  if (const auto* integer = node.as_integer()) return static_cast<double>(integer->get());
  if (const auto* real = node.as_floating_point()) return real->get();
  return std::nullopt;
}

std::optional<std::vector<double>> finite_numbers(const toml::node& node, size_t count) {
  const toml::array* array = node.as_array();
  if (array == nullptr || array->size() != count) return std::nullopt;
  std::vector<double> numbers;
  for (const toml::node& element : *array) {
    const auto number = number_of(element);
    if (!number || !std::isfinite(*number)) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

// A NUL would cut a path or an address short without a word.
bool is_clean(const std::string& text) { return text.find('\0') == std::string::npos; }

const toml::node& as_node(const void* p) { return *static_cast<const toml::node*>(p); }

// Optimal string alignment: insertions, deletions, substitutions and swaps of neighbors.
size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

void Problems::add(Place place, std::string text, ErrorCode code) {
  list_.push_back({place, std::move(text), code});
}

std::string Problems::where(Place place) const {
  return fmt::format("{}:{}:{}", file_, place.line, place.column);
}

Error Problems::error() const {
  SL_CHECK(!list_.empty(), "no problem to report");
  std::vector<Problem> sorted = list_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Problem& a, const Problem& b) {
    return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
  });
  Error error{sorted[0].code, sorted[0].text, where(sorted[0].place)};
  for (size_t i = 1; i < std::min(sorted.size(), kMaxProblems); ++i) {
    error.text += fmt::format("\n{}: {}", where(sorted[i].place), sorted[i].text);
  }
  if (sorted.size() > kMaxProblems) {
    error.text += fmt::format("\nand {} more", sorted.size() - kMaxProblems);
  }
  return error;
}

std::string_view closest(std::string_view word, const std::vector<std::string>& candidates) {
  constexpr size_t kLongestWord = 64;
  if (word.size() > kLongestWord) return {};
  std::string_view best;
  size_t best_distance = std::max<size_t>(1, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const size_t distance = edit_distance(word, candidate);
    if (distance < best_distance) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
  if (candidates.empty()) return {};
  const std::string_view meant = closest(word, candidates);
  if (!meant.empty()) return fmt::format("; did you mean \"{}\"?", meant);
  return fmt::format("; known: {}", fmt::join(candidates, ", "));
}

struct TomlTable::State {
  explicit State(std::string file) : problems(std::move(file)) {}
  toml::table root;
  Problems problems;
  std::map<const void*, std::set<std::string, std::less<>>> asked;
};

const void* TomlTable::find(std::string_view key) {
  state_->asked[table_].emplace(key);
  return as_node(table_).as_table()->get(key);
}

bool TomlTable::has(std::string_view key) const {
  return as_node(table_).as_table()->contains(key);
}

bool TomlTable::is_text(std::string_view key) const {
  const toml::node* node = as_node(table_).as_table()->get(key);
  return node != nullptr && node->is_string();
}

std::vector<std::string> TomlTable::keys() const {
  std::vector<std::string> names;
  for (const auto& [key, node] : *as_node(table_).as_table()) names.emplace_back(key.str());
  return names;
}

Place TomlTable::place() const { return place_of(as_node(table_).source()); }

Place TomlTable::place(std::string_view key) const {
  const toml::node* node = as_node(table_).as_table()->get(key);
  return node != nullptr ? place_of(node->source()) : place();
}

void TomlTable::problem(std::string_view key, std::string_view text, ErrorCode code) {
  state_->problems.add(place(key), fmt::format("{}: {}", key, text), code);
}

void TomlTable::mistyped(std::string_view key, const void* node, std::string_view wanted) {
  state_->problems.add(
      place_of(as_node(node).source()),
      fmt::format("{}: expected {}, found {}", key, wanted, describe(as_node(node))));
}

bool TomlTable::require(std::string_view key, std::string_view what) {
  if (find(key) != nullptr) return true;
  state_->problems.add(place(), fmt::format("{} needs \"{}\": {}", label_, key, what));
  return false;
}

void TomlTable::refuse(std::string_view key, std::string_view why) {
  if (find(key) == nullptr) return;
  problem(key, why);
}

std::optional<bool> TomlTable::flag(std::string_view key) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  if (const auto* value = as_node(node).as_boolean()) return value->get();
  mistyped(key, node, "true or false");
  return std::nullopt;
}

std::optional<int64_t> TomlTable::integer(std::string_view key, int64_t low, int64_t high,
                                          std::string_view unit) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* value = as_node(node).as_integer();
  if (value != nullptr && value->get() >= low && value->get() <= high) return value->get();
  mistyped(key, node, fmt::format("{} between {} and {}", unit, low, high));
  return std::nullopt;
}

std::optional<double> TomlTable::number(std::string_view key, double low, double high,
                                        std::string_view unit) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto value = number_of(as_node(node));
  if (value && *value >= low && *value <= high) return value;  // false for NaN
  mistyped(key, node, fmt::format("{} between {} and {}", unit, low, high));
  return std::nullopt;
}

std::optional<PlacedText> TomlTable::text(std::string_view key) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* value = as_node(node).as_string();
  if (value != nullptr && is_clean(value->get())) {
    return PlacedText{value->get(), place_of(as_node(node).source())};
  }
  mistyped(key, node, "a text in quotes");
  return std::nullopt;
}

std::optional<std::variant<int64_t, std::string>> TomlTable::integer_or_text(std::string_view key) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  using Value = std::variant<int64_t, std::string>;
  if (const auto* number = as_node(node).as_integer()) return Value(number->get());
  if (const auto* flag = as_node(node).as_boolean()) return Value(int64_t{flag->get() ? 1 : 0});
  const auto* text = as_node(node).as_string();
  if (text != nullptr && is_clean(text->get())) return Value(text->get());
  mistyped(key, node, "a whole number, true, false or a text");
  return std::nullopt;
}

std::optional<std::variant<int64_t, double, std::string>> TomlTable::number_or_text(
    std::string_view key) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  using Value = std::variant<int64_t, double, std::string>;
  if (const auto* number = as_node(node).as_floating_point()) {
    if (std::isfinite(number->get())) return Value(number->get());
    mistyped(key, node, "a finite number");
    return std::nullopt;
  }
  auto value = integer_or_text(key);
  if (!value) return std::nullopt;
  return std::visit([](auto&& v) { return Value(std::move(v)); }, *std::move(value));
}

std::optional<std::vector<PlacedText>> TomlTable::texts(std::string_view key) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  const toml::array* array = as_node(node).as_array();
  if (array == nullptr) {
    mistyped(key, node, "a list of texts");
    return std::nullopt;
  }
  std::vector<PlacedText> texts;
  for (const toml::node& element : *array) {
    const auto* value = element.as_string();
    if (value != nullptr && is_clean(value->get())) {
      texts.push_back({value->get(), place_of(element.source())});
    } else {
      mistyped(key, &element, "a list of texts");
      return std::nullopt;
    }
  }
  return texts;
}

std::optional<std::vector<double>> TomlTable::numbers(std::string_view key, size_t count) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  auto numbers = finite_numbers(as_node(node), count);
  if (!numbers) mistyped(key, node, fmt::format("a list of {} finite numbers", count));
  return numbers;
}

std::optional<Eigen::Matrix4d> TomlTable::matrix(std::string_view key, std::string_view wanted) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  const toml::array* rows = as_node(node).as_array();
  Eigen::Matrix4d matrix;
  bool good = rows != nullptr && rows->size() == 4;
  for (size_t i = 0; good && i < 4; ++i) {
    const auto row = finite_numbers(*rows->get(i), 4);
    good = row.has_value();
    if (good) matrix.row(static_cast<int>(i)) = Eigen::Map<const Eigen::RowVector4d>(row->data());
  }
  if (good) return matrix;
  mistyped(key, node, wanted);
  return std::nullopt;
}

std::optional<TomlTable> TomlTable::table(std::string_view key) {
  const void* node = find(key);
  if (node == nullptr) return std::nullopt;
  if (const toml::table* table = as_node(node).as_table()) {
    return TomlTable(state_, static_cast<const toml::node*>(table), fmt::format("[{}]", key));
  }
  mistyped(key, node, fmt::format("one table [{}]", key));
  return std::nullopt;
}

std::vector<TomlTable> TomlTable::tables(std::string_view key) {
  const void* node = find(key);
  std::vector<TomlTable> tables;
  if (node == nullptr) return tables;
  const toml::array* array = as_node(node).as_array();
  if (array == nullptr) {
    mistyped(key, node, fmt::format("tables [[{0}]], in double brackets", key));
    return tables;
  }
  for (const toml::node& element : *array) {
    if (const toml::table* table = element.as_table()) {
      tables.push_back(
          TomlTable(state_, static_cast<const toml::node*>(table), fmt::format("[[{}]]", key)));
    } else {
      mistyped(key, &element, fmt::format("tables [[{0}]]", key));
    }
  }
  return tables;
}

void TomlTable::finish() {
  const auto& asked = state_->asked[table_];
  const std::vector<std::string> known(asked.begin(), asked.end());
  for (const auto& [key, node] : *as_node(table_).as_table()) {
    if (asked.find(key.str()) != asked.end()) continue;
    state_->problems.add(place_of(key.source()),
                         fmt::format("unknown key {} in {}{}", quote(key.str()), label_,
                                     suggestion(key.str(), known)));
  }
}

TomlDocument::TomlDocument(std::unique_ptr<TomlTable::State> state) : state_(std::move(state)) {}
TomlDocument::~TomlDocument() = default;
TomlDocument::TomlDocument(TomlDocument&&) noexcept = default;

Result<TomlDocument> TomlDocument::parse(std::string_view text, const std::string& file) {
  SL_RETURN_IF_ERROR(check_toml_nesting(text, file));
  auto state = std::make_unique<TomlTable::State>(file);
  try {
    state->root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    state->problems.add(place_of(error.source()),
                        fmt::format("not valid TOML: {}", error.description()));
    return state->problems.error();
  } catch (const std::exception& error) {
    return make_error(ErrorCode::kInternal, file, "cannot parse: {}", error.what());
  }
  return TomlDocument(std::move(state));
}

TomlTable TomlDocument::root() {
  return TomlTable(state_.get(), static_cast<const toml::node*>(&state_->root), "the file");
}

Problems& TomlDocument::problems() { return state_->problems; }

}  // namespace sightline::config
