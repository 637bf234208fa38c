// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <GLES3/gl31.h>

#include <string>
#include <utility>

#include "sightline/base/result.hpp"

namespace sightline::egl {

/// A 2D texture without filtering. Made and destroyed while a context of its group is current.
class Texture {
 public:
  Texture() = default;
  Texture(GLenum internal_format, int width, int height) : width_(width), height_(height) {
    glGenTextures(1, &name_);
    glBindTexture(GL_TEXTURE_2D, name_);
    glTexStorage2D(GL_TEXTURE_2D, 1, internal_format, width, height);
    for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
      glTexParameteri(GL_TEXTURE_2D, filter, GL_NEAREST);
  }
  ~Texture() {
    if (name_ != 0) glDeleteTextures(1, &name_);
  }
  Texture(Texture&& other) noexcept { swap(other); }
  Texture& operator=(Texture&& other) noexcept {
    swap(other);
    return *this;
  }

  GLuint name() const { return name_; }
  int width() const { return width_; }
  int height() const { return height_; }
  void bind(GLuint unit) const {
    glActiveTexture(GL_TEXTURE0 + unit);
    glBindTexture(GL_TEXTURE_2D, name_);
  }

 private:
  void swap(Texture& other) {
    std::swap(name_, other.name_);
    std::swap(width_, other.width_);
    std::swap(height_, other.height_);
  }
  GLuint name_ = 0;
  int width_ = 0, height_ = 0;
};

/// A frame buffer; the same rules.
class Framebuffer {
 public:
  Framebuffer() { glGenFramebuffers(1, &name_); }
  ~Framebuffer() { glDeleteFramebuffers(1, &name_); }
  Framebuffer(const Framebuffer&) = delete;
  Framebuffer& operator=(const Framebuffer&) = delete;
  void bind() const { glBindFramebuffer(GL_FRAMEBUFFER, name_); }
  static void attach(GLenum point, const Texture& texture) {
    glFramebufferTexture2D(GL_FRAMEBUFFER, point, GL_TEXTURE_2D, texture.name(), 0);
  }

 private:
  GLuint name_ = 0;
};

/// A linked program; the same rules.
class Program {
 public:
  /// kUnavailable with the driver's text if it does not compile.
  static Result<Program> create(const std::string& vertex, const std::string& fragment);
  Program(Program&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  Program& operator=(Program&&) = delete;
  ~Program() {
    if (name_ != 0) glDeleteProgram(name_);
  }

  void use() const { glUseProgram(name_); }
  GLint at(const char* uniform) const { return glGetUniformLocation(name_, uniform); }
  /// Binds a sampler to a texture unit, once for all.
  void sampler(const char* uniform, GLint unit) const {
    use();
    glUniform1i(at(uniform), unit);
  }

 private:
  explicit Program(GLuint name) : name_(name) {}
  GLuint name_ = 0;
};

}  // namespace sightline::egl
