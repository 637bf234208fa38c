// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arv.h>

#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "sightline/base/result.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline::capture {

/// Aravis' XML reader shares state between threads without a lock: hold this where a camera's
/// description is read.
inline std::mutex& description_mutex() {
  static std::mutex mutex;
  return mutex;
}

struct ObjectUnref {
  void operator()(void* object) const { g_object_unref(object); }
};
/// One reference of a GObject.
template <typename T>
using ObjectRef = std::unique_ptr<T, ObjectUnref>;

struct GFree {
  void operator()(void* memory) const { g_free(memory); }
};
template <typename T>
using GArray1 = std::unique_ptr<T[], GFree>;

/// The place where GLib calls put their error.
class ErrorSlot {
 public:
  ErrorSlot() = default;
  ErrorSlot(const ErrorSlot&) = delete;
  ErrorSlot& operator=(const ErrorSlot&) = delete;
  ~ErrorSlot() { g_clear_error(&error_); }

  GError** out() { return &error_; }
  explicit operator bool() const { return error_ != nullptr; }
  std::string text() const { return error_ != nullptr ? error_->message : "no reason given"; }
  bool is(ArvDeviceError code) const {
    return error_ != nullptr && g_error_matches(error_, ARV_DEVICE_ERROR, code) != 0;
  }
  /// The camera does not answer, as opposed to: it refuses.
  bool silent() const {
    return is(ARV_DEVICE_ERROR_TIMEOUT) || is(ARV_DEVICE_ERROR_NOT_CONNECTED) ||
           is(ARV_DEVICE_ERROR_TRANSFER_ERROR);
  }

 private:
  GError* error_ = nullptr;
};

/// Runs `call(GError**)`; `what` completes "cannot ...".
template <typename Call>
Status attempt(const std::string& where, std::string_view what, Call&& call) {
  ErrorSlot slot;
  const Waiting wait("the camera");
  std::forward<Call>(call)(slot.out());
  if (!slot) return {};
  if (slot.silent()) {
    return make_error(ErrorCode::kTimeout, where, "the camera stopped answering (to {}): {}", what,
                      slot.text());
  }
  return make_error(ErrorCode::kInvalidInput, where, "cannot {}: {}", what, slot.text());
}

/// Runs `call(GError**)` and leaves an error at the fallback: for features a camera may lack.
template <typename T, typename Call>
T ask(T fallback, Call&& call) {
  ErrorSlot slot;
  const Waiting wait("the camera");
  const auto value = std::forward<Call>(call)(slot.out());
  return slot ? fallback : static_cast<T>(value);
}

inline std::string text_or_empty(const char* text) { return text != nullptr ? text : ""; }

}  // namespace sightline::capture
