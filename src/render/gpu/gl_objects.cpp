// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/gl_objects.hpp"

#include <array>

namespace sightline::egl {
namespace {

Status compile(GLuint shader, const std::string& source, const char* what) {
  const char* text = source.c_str();
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint done = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &done);
  if (done == GL_TRUE) return {};
  std::array<char, 1024> log{};
  glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
  return make_error(ErrorCode::kUnavailable, "egl", "the driver refuses the {} shader: {}", what,
                    log.data());
}

Status link(GLuint program, GLuint vertex, GLuint fragment) {
  glAttachShader(program, vertex);
  glAttachShader(program, fragment);
  glLinkProgram(program);
  GLint done = GL_FALSE;
  glGetProgramiv(program, GL_LINK_STATUS, &done);
  if (done == GL_TRUE) return {};
  std::array<char, 1024> log{};
  glGetProgramInfoLog(program, static_cast<GLsizei>(log.size()), nullptr, log.data());
  return make_error(ErrorCode::kUnavailable, "egl", "the driver cannot link the shaders: {}",
                    log.data());
}

}  // namespace

Result<Program> Program::create(const std::string& vertex, const std::string& fragment) {
  Program program(glCreateProgram());
  const GLuint vertex_shader = glCreateShader(GL_VERTEX_SHADER);
  const GLuint fragment_shader = glCreateShader(GL_FRAGMENT_SHADER);
  Status made = compile(vertex_shader, vertex, "vertex");
  if (made.has_value()) made = compile(fragment_shader, fragment, "fragment");
  if (made.has_value()) made = link(program.name_, vertex_shader, fragment_shader);
  // Kept by the program for as long as it needs them.
  glDeleteShader(vertex_shader);
  glDeleteShader(fragment_shader);
  SL_RETURN_IF_ERROR(made);
  return program;
}

}  // namespace sightline::egl
