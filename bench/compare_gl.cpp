// SPDX-License-Identifier: Apache-2.0
// Full-frame composition with OpenGL as viewers do it: the frame goes up as RGBA, is drawn as a
// background, the mesh over it with depth test and light per vertex, and everything comes back.
// The frame is RGBA already: conversion would come on top.
#include "compare.hpp"
#include "render/gpu/egl_context.hpp"
#include "render/gpu/gl_objects.hpp"

namespace sightline::compare {
namespace {

constexpr const char* kBackgroundVertex = R"(#version 310 es
out highp vec2 at;
void main() {
  at = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
  gl_Position = vec4(2.0 * at - 1.0, 0.999, 1.0);
}
)";
constexpr const char* kBackgroundFragment = R"(#version 310 es
precision highp float;
uniform sampler2D frame;
in highp vec2 at;
out vec4 color;
void main() { color = texture(frame, at); }
)";
constexpr const char* kMeshVertex = R"(#version 310 es
precision highp float;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat3 rotation;
uniform vec3 translation;
uniform vec4 focal;    // fx, fy, cx, cy
uniform vec4 lens;     // k1, k2, p1, p2
uniform vec2 size;
out float light;
void main() {
  vec3 p = rotation * position + translation;
  vec2 m = p.xy / p.z;
  float r2 = dot(m, m);
  float radial = 1.0 + r2 * (lens.x + r2 * lens.y);
  vec2 d = m * radial + vec2(2.0 * lens.z * m.x * m.y + lens.w * (r2 + 2.0 * m.x * m.x),
                             lens.z * (r2 + 2.0 * m.y * m.y) + 2.0 * lens.w * m.x * m.y);
  vec2 pixel = focal.xy * d + focal.zw + 0.5;
  gl_Position = vec4(2.0 * pixel / size - 1.0, 1.0 - 0.1 / p.z, 1.0);
  light = 0.25 + 0.75 * max(dot(rotation * normal, vec3(-0.30, -0.45, -0.84)), 0.0);
}
)";
constexpr const char* kMeshFragment = R"(#version 310 es
precision highp float;
in float light;
out vec4 color;
void main() { color = vec4(0.27 * light, 0.88 * light, 0.47 * light, 0.25); }
)";

class Composer {
 public:
  static Result<std::shared_ptr<Composer>> create(const Scene& scene) {
    SL_ASSIGN(auto display, egl::Display::open());
    SL_ASSIGN(auto context, egl::Context::create(display, nullptr));
    const egl::Current current(*context);
    SL_ASSIGN(auto background, egl::Program::create(kBackgroundVertex, kBackgroundFragment));
    SL_ASSIGN(auto mesh, egl::Program::create(kMeshVertex, kMeshFragment));
    return std::shared_ptr<Composer>(new Composer(scene, display->renderer(), std::move(context),
                                                  std::move(background), std::move(mesh)));
  }
  ~Composer() {
    const egl::Current current(*context_);
    target_.reset();
    background_.reset();
    mesh_.reset();
    for (egl::Texture* texture : {&frame_, &depth_, &color_}) *texture = egl::Texture();
  }
  const std::string& renderer() const { return renderer_; }

  void draw(size_t k) {
    const egl::Current current(*context_);
    const int width = scene_.camera.width(), height = scene_.camera.height();
    target_->bind();
    glViewport(0, 0, width, height);
    frame_.bind(0);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE,
                    pixels_.data());
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_BLEND);
    background_->use();
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glEnable(GL_DEPTH_TEST);
    glClear(GL_DEPTH_BUFFER_BIT);
    glEnable(GL_CULL_FACE);
    glFrontFace(GL_CW);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    set_uniforms(k);
    glBindVertexArray(array_);
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * scene_.mesh.faces.size()),
                   GL_UNSIGNED_INT, nullptr);
    glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, back_.data());
  }

  /// Pixels of the last image that are not the background's.
  size_t drawn_pixels() const {
    size_t count = 0;
    for (size_t i = 0; i < back_.size(); i += 4) count += back_[i + 1] != pixels_[i + 1] ? 1u : 0u;
    return count;
  }

 private:
  Composer(const Scene& scene, std::string renderer, std::unique_ptr<egl::Context> context,
           egl::Program background, egl::Program mesh)
      : scene_(scene),
        renderer_(std::move(renderer)),
        context_(std::move(context)),
        background_(std::make_unique<egl::Program>(std::move(background))),
        mesh_(std::make_unique<egl::Program>(std::move(mesh))),
        target_(std::make_unique<egl::Framebuffer>()) {
    const int width = scene.camera.width(), height = scene.camera.height();
    pixels_.resize(4 * static_cast<size_t>(width) * static_cast<size_t>(height), 90);
    back_.resize(pixels_.size());
    frame_ = egl::Texture(GL_RGBA8, width, height);
    color_ = egl::Texture(GL_RGBA8, width, height);
    depth_ = egl::Texture(GL_DEPTH_COMPONENT24, width, height);
    target_->bind();
    egl::Framebuffer::attach(GL_COLOR_ATTACHMENT0, color_);
    egl::Framebuffer::attach(GL_DEPTH_ATTACHMENT, depth_);
    background_->sampler("frame", 0);
    upload_mesh();
  }

  void upload_mesh() {
    std::vector<float> data;
    std::vector<Eigen::Vector3f> normals(scene_.mesh.vertices.size(), Eigen::Vector3f::Zero());
    for (const auto& f : scene_.mesh.faces) {
      const Eigen::Vector3f& a = scene_.mesh.vertices[f[0]];
      const Eigen::Vector3f n =
          (scene_.mesh.vertices[f[1]] - a).cross(scene_.mesh.vertices[f[2]] - a);
      for (const uint32_t v : f) normals[v] += n;
    }
    for (size_t v = 0; v < normals.size(); ++v) {
      const Eigen::Vector3f& p = scene_.mesh.vertices[v];
      const Eigen::Vector3f n = normals[v].normalized();
      data.insert(data.end(), {p.x(), p.y(), p.z(), n.x(), n.y(), n.z()});
    }
    glGenVertexArrays(1, &array_);
    glBindVertexArray(array_);
    GLuint buffers[2];
    glGenBuffers(2, buffers);
    glBindBuffer(GL_ARRAY_BUFFER, buffers[0]);
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(data.size() * sizeof(float)), data.data(),
                 GL_STATIC_DRAW);
    for (GLuint i = 0; i < 2; ++i) {
      glEnableVertexAttribArray(i);
      glVertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, 6 * sizeof(float),
                            reinterpret_cast<const void*>(i * 3 * sizeof(float)));
    }
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(12 * scene_.mesh.faces.size()),
                 scene_.mesh.faces.data(), GL_STATIC_DRAW);
  }

  void set_uniforms(size_t k) {
    const Rigid3& pose = scene_.poses[k];
    const Eigen::Matrix3f rotation = pose.rotation_matrix().cast<float>();
    const Eigen::Vector3f translation = pose.translation.cast<float>();
    const CameraModel::Parameters& p = scene_.camera.parameters();
    const auto f = [](double value) { return static_cast<float>(value); };
    mesh_->use();
    glUniformMatrix3fv(mesh_->at("rotation"), 1, GL_FALSE, rotation.data());
    glUniform3fv(mesh_->at("translation"), 1, translation.data());
    glUniform4f(mesh_->at("focal"), f(p.fx), f(p.fy), f(p.cx), f(p.cy));
    glUniform4f(mesh_->at("lens"), f(p.distortion[0]), f(p.distortion[1]), f(p.distortion[2]),
                f(p.distortion[3]));
    glUniform2f(mesh_->at("size"), f(p.width), f(p.height));
  }

  const Scene& scene_;
  std::string renderer_;
  std::unique_ptr<egl::Context> context_;
  std::unique_ptr<egl::Program> background_, mesh_;
  std::unique_ptr<egl::Framebuffer> target_;
  egl::Texture frame_, color_, depth_;
  GLuint array_ = 0;
  std::vector<uint8_t> pixels_, back_;
};

}  // namespace

Contestant gl_contestant(const Scene& scene) {
  const auto composer = Composer::create(scene);
  if (!composer) return {"full-frame OpenGL", {}, composer.error().message()};
  const auto drawer = *composer;
  drawer->draw(0);
  if (drawer->drawn_pixels() < 5000) return {"full-frame OpenGL", {}, "it draws nothing here"};
  return {"full-frame OpenGL, RGBA up and back (" + drawer->renderer() + ")",
          [drawer](size_t k) { drawer->draw(k); }, ""};
}

}  // namespace sightline::compare
