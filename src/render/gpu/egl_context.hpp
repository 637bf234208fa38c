// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <EGL/egl.h>

#include <memory>
#include <string>

#include "sightline/base/result.hpp"

namespace sightline::egl {

/// An initialized EGL display. It is never closed: EGL counts no users, and another library of the
/// process may be drawing on the same one.
class Display {
 public:
  /// The first real GPU, else the surfaceless platform.
  static Result<std::shared_ptr<const Display>> open();
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

  EGLDisplay handle() const { return handle_; }
  EGLConfig config() const { return config_; }
  const std::string& renderer() const { return renderer_; }
  bool has(std::string_view extension) const;

 private:
  Display() = default;
  static Result<std::shared_ptr<const Display>> open(EGLenum platform, void* native);
  Status set_up();

  EGLDisplay handle_ = EGL_NO_DISPLAY;
  EGLConfig config_ = nullptr;
  std::string renderer_;
};

/// An OpenGL ES 3.1 context without a surface. It is current only inside a Current, so any thread
/// may use or destroy it, one at a time.
class Context {
 public:
  /// Shares textures with `group` if given.
  static Result<std::unique_ptr<Context>> create(std::shared_ptr<const Display> display,
                                                 const Context* group);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  /// Whether the GPU was reset under this context, which is current.
  bool lost() const;

 private:
  friend class Current;
  using ResetStatus = unsigned (*)();
  Context(std::shared_ptr<const Display> display, EGLContext handle)
      : display_(std::move(display)), handle_(handle) {}

  std::shared_ptr<const Display> display_;
  EGLContext handle_;
  ResetStatus reset_status_ = nullptr;  ///< where the driver can tell
};

/// Makes a context current in this thread while it lives.
class Current {
 public:
  explicit Current(const Context& context);
  ~Current();
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;

  bool ok() const { return ok_; }
  bool context_lost() const { return lost_; }

 private:
  EGLDisplay display_;
  bool ok_ = false;
  bool lost_ = false;
};

/// "EGL_BAD_ALLOC (0x3003)" and so on.
std::string error_text(EGLint error);

}  // namespace sightline::egl
