// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/egl_rasterizer.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "render/gpu/egl_shaders.hpp"
#include "sightline/base/check.hpp"

namespace sightline::egl {
namespace {

/// Stands for "no ray": NaN need not survive in a shader.
constexpr float kNoRay = 1e30f;

// Texture units: of the project pass, then of the face pass.
constexpr GLint kVertexUnit = 0, kLensUnit = 1;
constexpr GLint kFaceUnit = 0, kNormalUnit = 1, kProjectedUnit = 2, kPixelUnit = 3, kRayUnit = 4;

int rounded_up(int value) { return (value + 63) / 64 * 64; }

}  // namespace

struct TileDrawer::Objects {
  Objects(Program project_program, Program face_program)
      : project(std::move(project_program)), faces(std::move(face_program)) {
    glGenVertexArrays(1, &vertex_array);
  }
  ~Objects() { glDeleteVertexArrays(1, &vertex_array); }
  Objects(const Objects&) = delete;
  Objects& operator=(const Objects&) = delete;

  Program project, faces;
  GLuint vertex_array = 0;  ///< empty: the shaders fetch everything by number
  Texture rays, lens;
  Texture projected, pixels;  ///< of the vertices: ray, 1/z and flags; place in the tile
  Framebuffer vertex_target;
  Texture result, depth;  ///< of the tile
  Framebuffer tile_target;
};

/// One frame's numbers.
struct TileDrawer::View {
  TileRect rect;
  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation;  ///< sheared to the middle ray
  Eigen::Vector2f center;       ///< the middle ray
  RayTable::RayBounds bounds;   ///< of the tile's rays, from the middle ray
  Eigen::Vector3f light;        ///< object's frame
};

Result<std::unique_ptr<TileDrawer>> TileDrawer::create(std::shared_ptr<const Display> display,
                                                       const Context& group,
                                                       std::shared_ptr<MeshStore> meshes,
                                                       std::shared_ptr<const RayTable> rays) {
  SL_ASSIGN(std::unique_ptr<Context> context, Context::create(std::move(display), &group));
  std::unique_ptr<TileDrawer> drawer(
      new TileDrawer(std::move(context), std::move(meshes), std::move(rays)));
  SL_RETURN_IF_ERROR(drawer->set_up());
  return drawer;
}

TileDrawer::TileDrawer(std::unique_ptr<Context> context, std::shared_ptr<MeshStore> meshes,
                       std::shared_ptr<const RayTable> rays)
    : context_(std::move(context)), meshes_(std::move(meshes)), rays_(std::move(rays)) {}

TileDrawer::~TileDrawer() {
  const Current current(*context_);
  gl_.reset();
}

Status TileDrawer::set_up() {
  const Current current(*context_);
  if (!current.ok())
    return make_error(ErrorCode::kUnavailable, "egl", "the context cannot be made current");
  GLint max = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max);
  if (std::max(rounded_up(rays_->even_width()), rounded_up(rays_->even_height())) > max) {
    return make_error(ErrorCode::kUnavailable, "egl", "images of {}x{} do not fit this GPU",
                      rays_->width(), rays_->height());
  }
  SL_ASSIGN(Program project,
            Program::create(full_screen_vertex_source(), project_fragment_source()));
  SL_ASSIGN(Program faces, Program::create(face_vertex_source(), face_fragment_source()));
  gl_ = std::make_unique<Objects>(std::move(project), std::move(faces));
  gl_->project.sampler("vertices", kVertexUnit);
  gl_->project.sampler("lens", kLensUnit);
  gl_->faces.sampler("faces", kFaceUnit);
  gl_->faces.sampler("normals", kNormalUnit);
  gl_->faces.sampler("vertices", kProjectedUnit);
  gl_->faces.sampler("pixels", kPixelUnit);
  gl_->faces.sampler("rays", kRayUnit);
  upload_rays();
  upload_lens();
  const GLenum error = glGetError();
  if (error != GL_NO_ERROR)
    return make_error(ErrorCode::kUnavailable, "egl", "setting up failed: GL error 0x{:04x}",
                      error);
  return {};
}

void TileDrawer::upload_rays() {
  const auto width = static_cast<size_t>(rays_->even_width());
  std::vector<float> row(2 * width);
  gl_->rays = Texture(GL_RG32F, rays_->even_width(), rays_->even_height());
  for (int y = 0; y < rays_->even_height(); ++y) {
    for (size_t x = 0; x < width; ++x) {
      const bool known = std::isfinite(rays_->x_row(y)[x]);
      row[2 * x] = known ? rays_->x_row(y)[x] : kNoRay;
      row[2 * x + 1] = known ? rays_->y_row(y)[x] : kNoRay;
    }
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, y, rays_->even_width(), 1, GL_RG, GL_FLOAT, row.data());
  }
}

void TileDrawer::upload_lens() {
  const RayTable::RadialLookup& lookup = rays_->lookup();
  const size_t cells = std::min(lookup.value.size(), lookup.step.size());
  std::vector<float> data(2 * cells);
  for (size_t i = 0; i < cells; ++i) {
    data[2 * i] = lookup.value[i];
    data[2 * i + 1] = lookup.step[i];
  }
  gl_->lens = Texture(GL_RG32F, static_cast<int>(cells), 1);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, static_cast<GLsizei>(cells), 1, GL_RG, GL_FLOAT,
                  data.data());
}

void TileDrawer::reserve(const RenderMesh& mesh, const TileRect& rect) {
  const auto rows =
      static_cast<int>(std::max<size_t>((mesh.vertex_count() + kTableWidth - 1) / kTableWidth, 1));
  if (gl_->projected.height() < rows) {
    gl_->projected = Texture(GL_RGBA32UI, kTableWidth, rows);
    gl_->pixels = Texture(GL_RG32UI, kTableWidth, rows);
    gl_->vertex_target.bind();
    Framebuffer::attach(GL_COLOR_ATTACHMENT0, gl_->projected);
    Framebuffer::attach(GL_COLOR_ATTACHMENT1, gl_->pixels);
    constexpr std::array<GLenum, 2> kBoth = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    glDrawBuffers(2, kBoth.data());
  }
  if (gl_->result.width() < rect.width || gl_->result.height() < rect.height) {
    const int width = rounded_up(std::max(rect.width, gl_->result.width()));
    const int height = rounded_up(std::max(rect.height, gl_->result.height()));
    gl_->result = Texture(GL_RG32UI, width, height);
    gl_->depth = Texture(GL_DEPTH_COMPONENT32F, width, height);
    gl_->tile_target.bind();
    Framebuffer::attach(GL_COLOR_ATTACHMENT0, gl_->result);
    Framebuffer::attach(GL_DEPTH_ATTACHMENT, gl_->depth);
    GLint format = 0;
    GLint type = 0;
    glGetIntegerv(GL_IMPLEMENTATION_COLOR_READ_FORMAT, &format);
    glGetIntegerv(GL_IMPLEMENTATION_COLOR_READ_TYPE, &type);
    // Only four words a pixel are promised; two are read where the driver offers it.
    words_per_pixel_ = format == GL_RG_INTEGER && type == GL_UNSIGNED_INT ? 2 : 4;
    pixels_.resize(static_cast<size_t>(width) * static_cast<size_t>(height) * words_per_pixel_);
  }
}

TileDrawer::View TileDrawer::view_of(const Rigid3& camera_from_object, const TileRect& rect) const {
  View view;
  view.rect = rect;
  const int middle_x = std::min(rect.x + rect.width / 2, rays_->width() - 1);
  const int middle_y = std::min(rect.y + rect.height / 2, rays_->height() - 1);
  view.center = {rays_->x_row(middle_y)[middle_x], rays_->y_row(middle_y)[middle_x]};
  if (!view.center.allFinite()) view.center.setZero();
  const Eigen::Vector2d center = view.center.cast<double>();
  const Eigen::Vector3d& t = camera_from_object.translation;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  view.rotation = rotation.cast<float>();
  view.translation =
      Eigen::Vector3d(t.x() - center.x() * t.z(), t.y() - center.y() * t.z(), t.z()).cast<float>();
  view.light = (rotation.transpose() * Eigen::Vector3d(kLightX, kLightY, kLightZ)).cast<float>();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  view.bounds = {kInf, -kInf, kInf, -kInf};
  constexpr int kBlock = RayTable::kBlock;
  for (int row = rect.y / kBlock; row <= (rect.y + rect.height - 1) / kBlock; ++row) {
    for (int column = rect.x / kBlock; column <= (rect.x + rect.width - 1) / kBlock; ++column) {
      const RayTable::RayBounds& b = rays_->block(column, row);
      if (b.empty()) continue;
      view.bounds = {std::min(view.bounds.min_x, b.min_x), std::max(view.bounds.max_x, b.max_x),
                     std::min(view.bounds.min_y, b.min_y), std::max(view.bounds.max_y, b.max_y)};
    }
  }
  return view;
}

void TileDrawer::project(const RenderMesh& mesh, const MeshTextures& textures, const View& view) {
  const Program& program = gl_->project;
  const RayTable::RadialLookup& lookup = rays_->lookup();
  const auto limit = rays_->project_limit() * rays_->project_limit() * (1 - 1e-6);
  program.use();
  glUniformMatrix3fv(program.at("rotation"), 1, GL_FALSE, view.rotation.data());
  glUniform3fv(program.at("translation"), 1, view.translation.data());
  glUniform2fv(program.at("center"), 1, view.center.data());
  glUniform4f(program.at("lens_shape"), lookup.scale,
              static_cast<float>(RayTable::RadialLookup::kCells), lookup.p1, lookup.p2);
  glUniform4f(program.at("focal"), lookup.fx, lookup.fy,
              lookup.cx - static_cast<float>(view.rect.x),
              lookup.cy - static_cast<float>(view.rect.y));
  glUniform1f(program.at("max_radius_squared"), static_cast<float>(limit));
  textures.vertices.bind(kVertexUnit);
  gl_->lens.bind(kLensUnit);
  gl_->vertex_target.bind();
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_SCISSOR_TEST);
  const size_t rows = (mesh.vertex_count() + kTableWidth - 1) / kTableWidth;
  glViewport(0, 0, kTableWidth, static_cast<GLsizei>(rows));
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void TileDrawer::draw_faces(const RenderMesh& mesh, const MeshTextures& textures, const View& view,
                            bool number_faces) {
  const Program& program = gl_->faces;
  const auto bulge =
      static_cast<float>(rays_->curvature_bound(0, std::numeric_limits<double>::max()) / 6);
  program.use();
  glUniform2f(program.at("tile_size"), static_cast<float>(view.rect.width),
              static_cast<float>(view.rect.height));
  glUniform4f(program.at("ray_bounds"), view.bounds.min_x - view.center.x(),
              view.bounds.max_x - view.center.x(), view.bounds.min_y - view.center.y(),
              view.bounds.max_y - view.center.y());
  glUniform3fv(program.at("light"), 1, view.light.data());
  glUniform1f(program.at("ambient"), static_cast<float>(kAmbient));
  // The pixel of a vertex is a float here: a little more room than on the CPU.
  glUniform2f(program.at("growth"), rays_->lookup().error_px + 0.02f, 2 * bulge);
  glUniform1i(program.at("cull"), mesh.cull_back_faces ? 1 : 0);
  glUniform1i(program.at("number_faces"), number_faces ? 1 : 0);
  glUniform2i(program.at("tile_corner"), view.rect.x, view.rect.y);
  glUniform2fv(program.at("center"), 1, view.center.data());
  textures.faces.bind(kFaceUnit);
  textures.normals.bind(kNormalUnit);
  gl_->projected.bind(kProjectedUnit);
  gl_->pixels.bind(kPixelUnit);
  gl_->rays.bind(kRayUnit);
  gl_->tile_target.bind();
  glViewport(0, 0, view.rect.width, view.rect.height);
  glEnable(GL_SCISSOR_TEST);
  glScissor(0, 0, view.rect.width, view.rect.height);
  constexpr std::array<GLuint, 4> kNothing = {0, 0, 0, 0};
  constexpr GLfloat kFarthest = 0;
  glEnable(GL_DEPTH_TEST);
  glDepthMask(GL_TRUE);
  glDepthFunc(GL_GREATER);
  glClearBufferuiv(GL_COLOR, 0, kNothing.data());
  glClearBufferfv(GL_DEPTH, 0, &kFarthest);
  glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(6 * mesh.faces.size()));
}

void TileDrawer::read_back(const TileRect& rect) {
  glPixelStorei(GL_PACK_ALIGNMENT, 4);
  glReadPixels(0, 0, rect.width, rect.height,
               words_per_pixel_ == 2 ? GL_RG_INTEGER : GL_RGBA_INTEGER, GL_UNSIGNED_INT,
               pixels_.data());
}

void TileDrawer::merge(RasterTile& tile) const {
  const uint32_t* from = pixels_.data();
  for (int y = 0; y < tile.height(); ++y) {
    float* const depth = tile.inverse_depth(y);
    uint8_t* const shade = tile.shade(y);
    uint32_t* const face = tile.has_faces() ? tile.face(y) : nullptr;
    for (int x = 0; x < tile.width(); ++x, from += words_per_pixel_) {
      const auto inverse_z = std::bit_cast<float>(from[0]);
      if (!(inverse_z > depth[x])) continue;
      depth[x] = inverse_z;
      if (face != nullptr) {
        face[x] = from[1];
      } else {
        shade[x] = static_cast<uint8_t>(from[1]);
      }
    }
  }
}

DrawFailure TileDrawer::draw(const RenderMesh& mesh, const Rigid3& camera_from_object,
                             RasterTile& tile, std::string& what) {
  const TileRect& rect = tile.rect();
  if (rect.empty() || mesh.faces.empty()) return DrawFailure::kNone;
  SL_CHECK(rect.x >= 0 && rect.y >= 0 && rect.x + rect.width <= rays_->even_width() &&
               rect.y + rect.height <= rays_->even_height(),
           "the tile lies inside the frame");
  const Current current(*context_);
  if (!current.ok()) {
    what = "the context cannot be made current";
    return current.context_lost() ? DrawFailure::kContextLost : DrawFailure::kError;
  }
  const auto textures = meshes_->get(mesh);
  if (!textures) {
    what = textures.error().text;
    return context_->lost() ? DrawFailure::kContextLost : DrawFailure::kError;
  }
  reserve(mesh, rect);
  const View view = view_of(camera_from_object, rect);
  if (view.bounds.empty()) return DrawFailure::kNone;
  glBindVertexArray(gl_->vertex_array);
  project(mesh, **textures, view);
  draw_faces(mesh, **textures, view, tile.has_faces());
  read_back(rect);
  const GLenum error = glGetError();
  if (context_->lost()) return DrawFailure::kContextLost;
  if (error != GL_NO_ERROR) {
    what = fmt::format("GL error 0x{:04x}", error);
    return DrawFailure::kError;
  }
  merge(tile);
  return DrawFailure::kNone;
}

}  // namespace sightline::egl
