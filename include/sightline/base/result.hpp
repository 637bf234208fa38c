// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "sightline/base/check.hpp"

namespace sightline {

/// What kind of thing went wrong. Programs turn it into an exit status (see exit_code()).
enum class ErrorCode {
  kInvalidInput,  ///< the user's file, option or data is wrong                 -> exit 2
  kNotFound,      ///< a named file, camera or object does not exist            -> exit 2
  kUnavailable,   ///< a device or component is not there (now, or in this build) -> exit 3
  kDamaged,       ///< data from outside is corrupt                              -> exit 2
  kIo,            ///< the operating system refused                              -> exit 1
  kTimeout,       ///< a bounded wait ended                                      -> exit 1
  kInternal,      ///< a library failed in a way we cannot name better           -> exit 1
};

/// An error for a person: `where` names the camera or file:line:column, `text` what was tried, what
/// came of it and what to do next.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string text;
  std::string where;

  /// "WHERE: TEXT", or TEXT alone.
  std::string message() const { return where.empty() ? text : where + ": " + text; }
};

/// Exit status of a program that ends on this error (CONVENTIONS.md).
int exit_code(const Error& error);

/// Builds an Error with a formatted text: `make_error(ErrorCode::kIo, path, "cannot read: {}", x)`.
template <typename... Args>
Error make_error(ErrorCode code, std::string where, fmt::format_string<Args...> format,
                 Args&&... args) {
  return Error{code, fmt::format(format, std::forward<Args>(args)...), std::move(where)};
}

/// Value or Error, with the method names of std::expected (C++23) so that it can be swapped later.
template <typename T>
class [[nodiscard]] Result {
 public:
  using value_type = T;

  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool has_value() const { return state_.index() == 0; }
  explicit operator bool() const { return has_value(); }

  T& value() & { return checked(); }
  const T& value() const& { return const_cast<Result*>(this)->checked(); }
  T&& value() && { return std::move(checked()); }
  T& operator*() & { return checked(); }
  const T& operator*() const& { return const_cast<Result*>(this)->checked(); }
  T&& operator*() && { return std::move(checked()); }
  T* operator->() { return &checked(); }
  const T* operator->() const { return &const_cast<Result*>(this)->checked(); }

  const Error& error() const& {
    SL_CHECK(!has_value(), "error() of a Result that holds a value");
    return std::get<1>(state_);
  }
  Error&& error() && {
    SL_CHECK(!has_value(), "error() of a Result that holds a value");
    return std::get<1>(std::move(state_));
  }

 private:
  T& checked() {
    SL_CHECK(has_value(), std::get<1>(state_).message());
    return std::get<0>(state_);
  }

  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  using value_type = void;

  Result() = default;
  Result(Error error) : error_(std::move(error)) {}

  bool has_value() const { return !error_.has_value(); }
  explicit operator bool() const { return has_value(); }
  void value() const { SL_CHECK(has_value(), error_->message()); }
  const Error& error() const& {
    SL_CHECK(!has_value(), "error() of a Result that holds a value");
    return *error_;
  }
  Error&& error() && {
    SL_CHECK(!has_value(), "error() of a Result that holds a value");
    return *std::move(error_);
  }

 private:
  std::optional<Error> error_;
};

using Status = Result<void>;

}  // namespace sightline

#define SL_CONCAT_INNER(a, b) a##b
#define SL_CONCAT(a, b) SL_CONCAT_INNER(a, b)

/// Returns the error of `expr` from the enclosing function, if it has one.
#define SL_RETURN_IF_ERROR(expr)                               \
  do {                                                         \
    if (auto sl_status = (expr); !sl_status.has_value()) {     \
      return ::sightline::Error(std::move(sl_status).error()); \
    }                                                          \
  } while (false)

/// Declares `lhs` from the value of `expr`, or returns its error: SL_ASSIGN(auto mesh, read(path));
#define SL_ASSIGN(lhs, expr) SL_ASSIGN_INNER(SL_CONCAT(sl_result_, __LINE__), lhs, expr)
#define SL_ASSIGN_INNER(result, lhs, expr)                                       \
  auto result = (expr);                                                          \
  if (!result.has_value()) return ::sightline::Error(std::move(result).error()); \
  lhs = *std::move(result)
