// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/egl_context.hpp"

#include <EGL/eglext.h>
#include <GLES3/gl31.h>

#include <array>
#include <vector>

#include "render/gpu/egl_device.hpp"

namespace sightline::egl {
namespace {

/// GPUs as the driver lists them, without its software rasterizer.
std::vector<void*> real_devices(const char* client_extensions) {
  if (!has_extension(client_extensions, "EGL_EXT_platform_device") ||
      !(has_extension(client_extensions, "EGL_EXT_device_base") ||
        has_extension(client_extensions, "EGL_EXT_device_enumeration")))
    return {};
  const auto query =
      reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  const auto text = reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(
      eglGetProcAddress("eglQueryDeviceStringEXT"));
  if (query == nullptr || text == nullptr) return {};
  std::array<EGLDeviceEXT, 16> devices{};
  EGLint count = 0;
  if (query(static_cast<EGLint>(devices.size()), devices.data(), &count) != EGL_TRUE) return {};
  std::vector<void*> real;
  for (EGLint i = 0; i < count; ++i) {
    EGLDeviceEXT device = devices[static_cast<size_t>(i)];
    if (!has_extension(text(device, EGL_EXTENSIONS), "EGL_MESA_device_software"))
      real.push_back(device);
  }
  return real;
}

Error egl_error(const char* what) {
  return make_error(ErrorCode::kUnavailable, "egl", "{} failed: {}", what,
                    error_text(eglGetError()));
}

std::string gl_text(GLenum name) {
  const auto* text = reinterpret_cast<const char*>(glGetString(name));
  return text == nullptr ? "" : text;
}

}  // namespace

std::string error_text(EGLint error) {
  const auto name = [error] {
    switch (error) {
      case EGL_SUCCESS:
        return "EGL_SUCCESS";
      case EGL_NOT_INITIALIZED:
        return "EGL_NOT_INITIALIZED";
      case EGL_BAD_ACCESS:
        return "EGL_BAD_ACCESS";
      case EGL_BAD_ALLOC:
        return "EGL_BAD_ALLOC";
      case EGL_BAD_ATTRIBUTE:
        return "EGL_BAD_ATTRIBUTE";
      case EGL_BAD_CONFIG:
        return "EGL_BAD_CONFIG";
      case EGL_BAD_CONTEXT:
        return "EGL_BAD_CONTEXT";
      case EGL_BAD_DISPLAY:
        return "EGL_BAD_DISPLAY";
      case EGL_BAD_MATCH:
        return "EGL_BAD_MATCH";
      case EGL_BAD_PARAMETER:
        return "EGL_BAD_PARAMETER";
      case EGL_CONTEXT_LOST:
        return "EGL_CONTEXT_LOST";
      default:
        return "an error";
    }
  }();
  return fmt::format("{} (0x{:04x})", name, error);
}

Result<std::shared_ptr<const Display>> Display::open() {
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (client == nullptr) return egl_error("asking EGL for its platforms");
  for (void* device : real_devices(client)) {
    auto display = open(EGL_PLATFORM_DEVICE_EXT, device);
    if (display && !is_software_renderer((*display)->renderer())) return display;
  }
  if (!has_extension(client, "EGL_MESA_platform_surfaceless")) {
    return make_error(ErrorCode::kUnavailable, "egl",
                      "no GPU answers, and EGL has no surfaceless platform for software GL");
  }
  return open(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY);
}

Result<std::shared_ptr<const Display>> Display::open(EGLenum platform, void* native) {
  std::shared_ptr<Display> display(new Display);
  display->handle_ = eglGetPlatformDisplay(platform, native, nullptr);
  if (display->handle_ == EGL_NO_DISPLAY) return egl_error("eglGetPlatformDisplay");
  if (eglInitialize(display->handle_, nullptr, nullptr) != EGL_TRUE)
    return egl_error("eglInitialize");
  SL_RETURN_IF_ERROR(display->set_up());
  return std::shared_ptr<const Display>(std::move(display));
}

bool Display::has(std::string_view extension) const {
  return has_extension(eglQueryString(handle_, EGL_EXTENSIONS), extension);
}

Status Display::set_up() {
  if (!has("EGL_KHR_surfaceless_context")) {
    return make_error(ErrorCode::kUnavailable, "egl",
                      "the driver lacks EGL_KHR_surfaceless_context");
  }
  const std::array<EGLint, 5> wanted = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE,
                                        0, EGL_NONE};
  EGLint count = 0;
  if (eglChooseConfig(handle_, wanted.data(), &config_, 1, &count) != EGL_TRUE || count < 1)
    return egl_error("choosing a configuration for OpenGL ES 3");
  // The probe is gone before the display is.
  const std::shared_ptr<const Display> self(std::shared_ptr<void>(), this);
  SL_ASSIGN(const std::unique_ptr<Context> probe, Context::create(self, nullptr));
  const Current current(*probe);
  if (!current.ok()) return egl_error("making a context current");
  renderer_ = gl_text(GL_RENDERER);
  return {};
}

Result<std::unique_ptr<Context>> Context::create(std::shared_ptr<const Display> display,
                                                 const Context* group) {
  eglBindAPI(EGL_OPENGL_ES_API);
  std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 1};
  const bool robust = display->has("EGL_EXT_create_context_robustness");
  if (robust) {
    attributes.insert(attributes.end(), {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_EXT,
                                         EGL_LOSE_CONTEXT_ON_RESET_EXT});
  }
  attributes.push_back(EGL_NONE);
  const EGLContext handle =
      eglCreateContext(display->handle(), display->config(),
                       group == nullptr ? EGL_NO_CONTEXT : group->handle_, attributes.data());
  if (handle == EGL_NO_CONTEXT) return egl_error("creating an OpenGL ES 3.1 context");
  std::unique_ptr<Context> context(new Context(std::move(display), handle));
  const Current current(*context);
  if (!current.ok()) return egl_error("making a context current");
  const char* extensions = reinterpret_cast<const char*>(glGetString(GL_EXTENSIONS));
  if (robust && has_extension(extensions, "GL_EXT_robustness")) {
    context->reset_status_ =
        reinterpret_cast<ResetStatus>(eglGetProcAddress("glGetGraphicsResetStatusEXT"));
  }
  return context;
}

Context::~Context() { eglDestroyContext(display_->handle(), handle_); }

bool Context::lost() const { return reset_status_ != nullptr && reset_status_() != GL_NO_ERROR; }

Current::Current(const Context& context) : display_(context.display_->handle()) {
  // Another library may have left another API bound in this thread.
  eglBindAPI(EGL_OPENGL_ES_API);
  ok_ = eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context.handle_) == EGL_TRUE;
  lost_ = !ok_ && eglGetError() == EGL_CONTEXT_LOST;
}

Current::~Current() {
  if (ok_) eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

}  // namespace sightline::egl
