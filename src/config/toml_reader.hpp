// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline::config {

/// Line and column in a file, from 1.
struct Place {
  unsigned line = 1;
  unsigned column = 1;
};

/// All that is wrong with one file.
class Problems {
 public:
  explicit Problems(std::string file) : file_(std::move(file)) {}
  void add(Place place, std::string text, ErrorCode code = ErrorCode::kInvalidInput);
  bool empty() const { return list_.empty(); }
  /// All of them in the order of the file: the first gives `where` and code, each one a line of
  /// `text`.
  Error error() const;
  std::string where(Place place) const;

 private:
  struct Problem {
    Place place;
    std::string text;
    ErrorCode code;
  };
  std::string file_;
  std::vector<Problem> list_;
};

/// A text of a file and where it stands there.
struct PlacedText {
  std::string text;
  Place place;
};

/// A handle to one table of a document. Every getter reports what is wrong with the value to the
/// document's Problems and then returns nothing, as it does for a key that is absent. Keys that
/// nobody asked for are reported by finish().
class TomlTable {
 public:
  Place place() const;
  /// Of the value; of the table if there is none.
  Place place(std::string_view key) const;
  bool has(std::string_view key) const;
  bool is_text(std::string_view key) const;
  /// All keys of this table, in the order of the alphabet.
  std::vector<std::string> keys() const;

  std::optional<bool> flag(std::string_view key);
  /// `unit` stands in the message: "a whole number of frames between 1 and 1000".
  std::optional<int64_t> integer(std::string_view key, int64_t low, int64_t high,
                                 std::string_view unit);
  std::optional<double> number(std::string_view key, double low, double high,
                               std::string_view unit);
  std::optional<PlacedText> text(std::string_view key);
  /// A whole number (true and false are 1 and 0) or a text.
  std::optional<std::variant<int64_t, std::string>> integer_or_text(std::string_view key);
  /// The same, or a finite number.
  std::optional<std::variant<int64_t, double, std::string>> number_or_text(std::string_view key);
  std::optional<std::vector<PlacedText>> texts(std::string_view key);
  /// Exactly `count` finite numbers.
  std::optional<std::vector<double>> numbers(std::string_view key, size_t count);
  /// Four rows of four numbers; `wanted` stands in the message.
  std::optional<Eigen::Matrix4d> matrix(std::string_view key,
                                        std::string_view wanted = "4 rows of 4 finite numbers");
  std::optional<TomlTable> table(std::string_view key);
  std::vector<TomlTable> tables(std::string_view key);

  /// "KEY: TEXT" at the value of the key, or at the table if it is absent.
  void problem(std::string_view key, std::string_view text,
               ErrorCode code = ErrorCode::kInvalidInput);
  /// Reports a key that must be there and is not; true if it is.
  bool require(std::string_view key, std::string_view what);
  /// The key may be there, whatever its value.
  void allow(std::string_view key) { (void)find(key); }
  /// Reports the key, if it is there, as known but not to be used.
  void refuse(std::string_view key, std::string_view why);
  /// Reports unknown keys, of this table only.
  void finish();

 private:
  friend class TomlDocument;
  struct State;
  TomlTable(State* state, const void* table, std::string label)
      : state_(state), table_(table), label_(std::move(label)) {}
  const void* find(std::string_view key);
  void mistyped(std::string_view key, const void* node, std::string_view wanted);

  State* state_;
  const void* table_;
  std::string label_;
};

/// A parsed TOML file; tables point into it.
class TomlDocument {
 public:
  /// Syntax errors are returned, with their place.
  static Result<TomlDocument> parse(std::string_view text, const std::string& file);
  ~TomlDocument();
  TomlDocument(TomlDocument&&) noexcept;

  TomlTable root();
  Problems& problems();

 private:
  explicit TomlDocument(std::unique_ptr<TomlTable::State> state);
  std::unique_ptr<TomlTable::State> state_;
};

/// The candidate that `word` was probably meant to be (Damerau-Levenshtein distance at most a third
/// of its length), or empty.
std::string_view closest(std::string_view word, const std::vector<std::string>& candidates);
/// `; did you mean "X"?`, else `; known: A, B`, or nothing without candidates.
std::string suggestion(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace sightline::config
