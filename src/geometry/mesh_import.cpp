// SPDX-License-Identifier: Apache-2.0
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/BaseImporter.h>
#include <assimp/MemoryIOWrapper.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <set>

#include "geometry/mesh_check.hpp"
#include "geometry/mesh_readers.hpp"
#include "geometry/repair/mesh_repair.hpp"
#include "sightline/base/files.hpp"

namespace sightline::geometry {
namespace {

constexpr size_t kMaxCompanionBytes = size_t{256} << 20;
/// Of all material libraries of an OBJ together. assimp looks through all materials for each that
/// is used, so their number counts more than their bytes (see mesh_check_obj.cpp).
constexpr size_t kMaxLibraryMaterials = 4096;
constexpr size_t kMaxMaterialBytes = size_t{4} << 20;

/// All that assimp gets to see: the mesh itself, from memory, and regular files of bounded size in
/// its folder and below. A material library named "/dev/zero" or "../../x" does not exist here.
class BoundedFiles : public Assimp::IOSystem {
 public:
  BoundedFiles(std::string_view content, std::string name, std::filesystem::path directory,
               bool only_materials)
      : content_(content),
        name_(std::move(name)),
        directory_(std::move(directory)),
        limit_(only_materials ? kMaxMaterialBytes : kMaxCompanionBytes),
        left_(only_materials ? kMaxMaterialBytes : SIZE_MAX) {}

  bool Exists(const char* file) const override {
    if (name_ == file) return true;
    std::error_code ignored;
    const std::filesystem::path path = inside(file);
    return !path.empty() && std::filesystem::is_regular_file(path, ignored);
  }

  char getOsSeparator() const override { return '/'; }

  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (std::strchr(mode, 'r') == nullptr) return nullptr;
    if (name_ == file) return stream_of(content_);
    if (!Exists(file) || !refusal_.empty()) return nullptr;  // a refused one is asked for again
    const std::filesystem::path path = inside(file);
    auto content = read_file(path, std::min(limit_, left_));
    if (!content && content.error().code == ErrorCode::kInvalidInput) {
      return refuse(fmt::format("{} is larger than the {} bytes that are read with a mesh",
                                path.string(), std::min(limit_, left_)));
    }
    if (!content) return nullptr;
    left_ -= content->size();
    if (limit_ == kMaxMaterialBytes) materials_ += count_of("newmtl", *content);
    if (materials_ > kMaxLibraryMaterials) {
      return refuse(fmt::format("{} brings the material libraries to more than {} materials",
                                path.string(), kMaxLibraryMaterials));
    }
    companions_.push_back(std::make_unique<std::string>(*std::move(content)));
    return stream_of(*companions_.back());
  }

  void Close(Assimp::IOStream* stream) override { delete stream; }

  /// Why a companion was not read; empty where none was refused.
  const std::string& refusal() const { return refusal_; }

 private:
  static Assimp::IOStream* stream_of(std::string_view text) {
    return new Assimp::MemoryIOStream(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  }

  Assimp::IOStream* refuse(std::string why) {
    refusal_ = std::move(why);
    return nullptr;
  }

  static size_t count_of(std::string_view word, std::string_view text) {
    size_t count = 0;
    for (size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) {
      ++count;
    }
    return count;
  }

  std::filesystem::path inside(const char* file) const {
    const std::filesystem::path relative = std::filesystem::path(file).lexically_normal();
    if (directory_.empty() || relative.empty() || relative.is_absolute() ||
        *relative.begin() == "..") {
      return {};
    }
    return directory_ / relative;
  }

  std::string_view content_;
  std::string name_;
  std::filesystem::path directory_;
  size_t limit_;  ///< of one companion [bytes]
  size_t left_;   ///< of all that are still to come
  size_t materials_ = 0;
  std::string refusal_;
  std::vector<std::unique_ptr<std::string>> companions_;
};

/// Takes away every loader but those of the format, for assimp asks the others when it is in doubt,
/// and a mesh called .obj must not be read as something else.
void keep_loaders_of(const std::string& format, Assimp::Importer* importer) {
  std::vector<Assimp::BaseImporter*> others;
  for (size_t i = 0; i < importer->GetImporterCount(); ++i) {
    std::set<std::string> extensions;
    importer->GetImporter(i)->GetExtensionList(extensions);
    if (extensions.count(format) == 0) others.push_back(importer->GetImporter(i));
  }
  for (Assimp::BaseImporter* loader : others) {
    importer->UnregisterLoader(loader);
    delete loader;  // unregistering hands it over
  }
}

Eigen::Matrix4f to_eigen(const aiMatrix4x4& m) {
  Eigen::Matrix4f out;
  for (unsigned r = 0; r < 4; ++r) {
    for (unsigned c = 0; c < 4; ++c) out(static_cast<int>(r), static_cast<int>(c)) = m[r][c];
  }
  return out;
}

Eigen::Vector3f to_eigen(const aiVector3D& v) { return {v.x, v.y, v.z}; }

/// Gathers the meshes of a scene under their nodes' transforms.
class SceneReader {
 public:
  SceneReader(const aiScene& scene, bool use_normals, const std::string& where,
              const MeshOptions& options)
      : scene_(scene), use_normals_(use_normals), where_(where), options_(options) {}

  Result<PolygonMesh> read() {
    use_normals_ = use_normals_ && all_have_normals();
    has_colors_ = any_has_color();
    std::vector<std::pair<const aiNode*, Eigen::Matrix4f>> stack;
    if (scene_.mRootNode != nullptr)
      stack.emplace_back(scene_.mRootNode, Eigen::Matrix4f::Identity());
    while (!stack.empty()) {
      const auto [node, parent] = stack.back();
      stack.pop_back();
      const Eigen::Matrix4f root_from_node = parent * to_eigen(node->mTransformation);
      for (unsigned i = 0; i < node->mNumMeshes; ++i) {
        if (node->mMeshes[i] >= scene_.mNumMeshes) return fault("node without its mesh");
        SL_RETURN_IF_ERROR(append(*scene_.mMeshes[node->mMeshes[i]], root_from_node));
      }
      for (unsigned i = node->mNumChildren; i-- > 0;) {
        stack.emplace_back(node->mChildren[i], root_from_node);
      }
    }
    return std::move(out_);
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, where_, format, std::forward<Args>(args)...);
  }

  bool all_have_normals() const {
    for (unsigned i = 0; i < scene_.mNumMeshes; ++i) {
      if (!scene_.mMeshes[i]->HasNormals()) return false;
    }
    return true;
  }

  bool any_has_color() const {
    for (unsigned i = 0; i < scene_.mNumMeshes; ++i) {
      if (scene_.mMeshes[i]->HasVertexColors(0)) return true;
      const aiMaterial* material = material_of(*scene_.mMeshes[i]);
      aiString name;
      if (material != nullptr && material->Get(AI_MATKEY_NAME, name) == AI_SUCCESS &&
          std::strcmp(name.C_Str(), AI_DEFAULT_MATERIAL_NAME) != 0 && name.length > 0) {
        return true;
      }
    }
    return false;
  }

  const aiMaterial* material_of(const aiMesh& mesh) const {
    return mesh.mMaterialIndex < scene_.mNumMaterials ? scene_.mMaterials[mesh.mMaterialIndex]
                                                      : nullptr;
  }

  Eigen::Vector3f color_of(const aiMesh& mesh, const aiFace& face) const {
    aiColor3D color(0.6f, 0.6f, 0.6f);
    if (const aiMaterial* material = material_of(mesh))
      material->Get(AI_MATKEY_COLOR_DIFFUSE, color);
    Eigen::Vector3f rgb(color.r, color.g, color.b);
    if (!mesh.HasVertexColors(0)) return rgb;
    rgb.setZero();
    for (unsigned i = 0; i < face.mNumIndices; ++i) {
      const aiColor4D& c = mesh.mColors[0][face.mIndices[i]];
      rgb += Eigen::Vector3f(c.r, c.g, c.b) / static_cast<float>(face.mNumIndices);
    }
    return rgb;
  }

  Status append(const aiMesh& mesh, const Eigen::Matrix4f& root_from_node) {
    const size_t total = out_.corner_counts.size() + mesh.mNumFaces;
    if (total > options_.max_faces || out_.vertices.size() + mesh.mNumVertices > UINT32_MAX / 2) {
      return fault("mesh has {} faces or more, the limit is {}; simplify it", total,
                   options_.max_faces);
    }
    const auto first = static_cast<uint32_t>(out_.vertices.size());
    const Eigen::Matrix3f linear = root_from_node.topLeftCorner<3, 3>();
    const Eigen::Vector3f shift = root_from_node.topRightCorner<3, 1>();
    const float determinant = linear.determinant();
    // Up to scale, which normalizing removes; a mirroring transform turns the normal back.
    Eigen::Matrix3f for_normals;
    for_normals << linear.col(1).cross(linear.col(2)), linear.col(2).cross(linear.col(0)),
        linear.col(0).cross(linear.col(1));
    if (determinant < 0) for_normals = -for_normals;
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      out_.vertices.push_back(linear * to_eigen(mesh.mVertices[i]) + shift);
      if (use_normals_) out_.normals.push_back(for_normals * to_eigen(mesh.mNormals[i]));
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      SL_RETURN_IF_ERROR(append_face(mesh, f, first, determinant < 0));
    }
    return {};
  }

  Status append_face(const aiMesh& mesh, unsigned f, uint32_t first, bool mirrored) {
    const aiFace& face = mesh.mFaces[f];
    const unsigned n = face.mNumIndices;
    if (n < 3) return {};  // points and lines
    const size_t number = out_.corner_counts.size();
    if (n > kMaxCorners) {
      return fault("face {}: {} corners, allowed are 3 to {}", number, n, kMaxCorners);
    }
    for (unsigned i = 0; i < n; ++i) {
      const unsigned index = face.mIndices[mirrored ? n - 1 - i : i];
      if (index >= mesh.mNumVertices) {
        return fault("face {}: vertex index {} of {}", number, index, mesh.mNumVertices);
      }
      out_.corner_vertices.push_back(first + index);
      if (use_normals_) out_.corner_normals.push_back(first + index);
    }
    out_.corner_counts.push_back(n);
    if (has_colors_) out_.face_colors.push_back(color_of(mesh, face));
    return {};
  }

  const aiScene& scene_;
  bool use_normals_;
  bool has_colors_ = false;
  const std::string& where_;
  const MeshOptions& options_;
  PolygonMesh out_;
};

/// Gathers what the scene's meshes are painted with. The scene has been checked by SceneReader.
class SurfaceReader {
 public:
  SurfaceReader(const aiScene& scene, std::filesystem::path directory, float meters_per_unit)
      : scene_(scene), directory_(std::move(directory)), scale_(meters_per_unit) {}

  MeshSurface read() {
    std::vector<std::pair<const aiNode*, Eigen::Matrix4f>> stack;
    if (scene_.mRootNode != nullptr)
      stack.emplace_back(scene_.mRootNode, Eigen::Matrix4f::Identity());
    while (!stack.empty()) {
      const auto [node, parent] = stack.back();
      stack.pop_back();
      const Eigen::Matrix4f root_from_node = parent * to_eigen(node->mTransformation);
      for (unsigned i = 0; i < node->mNumMeshes; ++i) {
        append(*scene_.mMeshes[node->mMeshes[i]], root_from_node);
      }
      for (unsigned i = 0; i < node->mNumChildren; ++i) {
        stack.emplace_back(node->mChildren[i], root_from_node);
      }
    }
    return std::move(out_);
  }

 private:
  // -1: none, or not beside the mesh.
  int texture_of(const aiMaterial* material) {
    aiString name;
    if (material == nullptr || material->GetTexture(aiTextureType_DIFFUSE, 0, &name) != AI_SUCCESS)
      return -1;
    if (const aiTexture* const held = scene_.GetEmbeddedTexture(name.C_Str())) {
      // Zero rows: the bytes of an image file, so many.
      if (held->mHeight != 0 || held->pcData == nullptr) return -1;
      return index_of(directory_ / fmt::format("image {} of the mesh", name.C_Str()),
                      {reinterpret_cast<const char*>(held->pcData), held->mWidth});
    }
    const std::filesystem::path relative = std::filesystem::path(name.C_Str()).lexically_normal();
    if (directory_.empty() || relative.empty() || relative.is_absolute() ||
        *relative.begin() == ".." || name.C_Str()[0] == '*')
      return -1;
    return index_of(directory_ / relative, {});
  }

  int index_of(const std::filesystem::path& path, std::string_view bytes) {
    const auto known = std::find(out_.textures.begin(), out_.textures.end(), path);
    const auto index = static_cast<int>(known - out_.textures.begin());
    if (known == out_.textures.end()) {
      out_.textures.push_back(path);
      out_.embedded.emplace_back(bytes);
    }
    return index;
  }

  void append(const aiMesh& mesh, const Eigen::Matrix4f& root_from_node) {
    const aiMaterial* material = mesh.mMaterialIndex < scene_.mNumMaterials
                                     ? scene_.mMaterials[mesh.mMaterialIndex]
                                     : nullptr;
    aiColor3D plain(0.6f, 0.6f, 0.6f);
    if (material != nullptr) material->Get(AI_MATKEY_COLOR_DIFFUSE, plain);
    const int texture = mesh.HasTextureCoords(0) ? texture_of(material) : -1;
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      for (unsigned k = 2; k < face.mNumIndices; ++k) {
        SurfaceTriangle triangle;
        triangle.color = {plain.r, plain.g, plain.b};
        triangle.texture = texture;
        const std::array<unsigned, 3> corners = {face.mIndices[0], face.mIndices[k - 1],
                                                 face.mIndices[k]};
        for (size_t i = 0; i < 3; ++i) {
          const Eigen::Vector4f at = to_eigen(mesh.mVertices[corners[i]]).homogeneous();
          triangle.corners[i] = scale_ * (root_from_node * at).head<3>();
          if (texture >= 0) {
            const aiVector3D& place = mesh.mTextureCoords[0][corners[i]];
            triangle.places[i] = {place.x, place.y};
          }
        }
        triangle.corner_colors.fill(triangle.color);
        if (mesh.HasVertexColors(0)) {
          triangle.color.setZero();
          for (size_t i = 0; i < 3; ++i) {
            const aiColor4D& c = mesh.mColors[0][corners[i]];
            triangle.corner_colors[i] = {c.r, c.g, c.b};
            triangle.color += triangle.corner_colors[i] / 3;
          }
        }
        out_.triangles.push_back(triangle);
      }
    }
  }

  const aiScene& scene_;
  const std::filesystem::path directory_;
  const float scale_;
  MeshSurface out_;
};

Result<CheckedMesh> check(std::string_view content, const std::string& format,
                          const std::string& where) {
  if (format == "obj") return check_obj(content, where);
  if (format == "off") return check_off(content, where);
  if (format == "ply") return check_ply(content, where);
  if (format == "stl") return check_stl(content, where);
  if (format == "gltf") return check_gltf(content, where);
  return check_glb(content, where);
}

// The scene belongs to the importer.
Result<const aiScene*> read_scene(const CheckedMesh& checked, std::string_view file,
                                  const std::string& format, const std::string& where,
                                  const std::filesystem::path& directory,
                                  Assimp::Importer& importer) {
  const std::string_view content = checked.content ? std::string_view(*checked.content) : file;
  const std::string& read_as = checked.format.empty() ? format : checked.format;
  keep_loaders_of(read_as, &importer);
  const std::string name = "mesh." + read_as;
  auto* const files = new BoundedFiles(content, name, directory, read_as == "obj");
  importer.SetIOHandler(files);  // which deletes it
  const aiScene* scene = importer.ReadFile(name, aiProcess_ValidateDataStructure);
  if (!files->refusal().empty()) {
    return make_error(ErrorCode::kInvalidInput, where, "{}", files->refusal());
  }
  if (scene != nullptr) return scene;
  return make_error(ErrorCode::kInvalidInput, where, "cannot read as {}: {}", format,
                    importer.GetErrorString());
}

}  // namespace

Result<TriangleMesh> import_mesh(std::string_view file, const std::string& format,
                                 const std::string& where, const std::filesystem::path& directory,
                                 const MeshOptions& options) try {
  SL_ASSIGN(const CheckedMesh checked, check(file, format, where));
  Assimp::Importer importer;
  SL_ASSIGN(const aiScene* const scene,
            read_scene(checked, file, format, where, directory, importer));
  // STL stores what the writer thought of each facet, often zero: made anew from the geometry.
  const bool use_normals = format != "stl";
  SL_ASSIGN(const PolygonMesh polygons, SceneReader(*scene, use_normals, where, options).read());
  if (checked.faces && polygons.corner_counts.size() != *checked.faces) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "{} of {} faces were understood; the others may have "
                      "indices out of range",
                      polygons.corner_counts.size(), *checked.faces);
  }
  return triangulate_polygons(polygons, where, options);
} catch (const std::exception& e) {
  return make_error(ErrorCode::kInvalidInput, where, "cannot read as {}: {}", format, e.what());
}

Result<MeshSurface> import_surface(std::string_view file, const std::string& format,
                                   const std::string& where, const std::filesystem::path& directory,
                                   const MeshOptions& options) try {
  SL_ASSIGN(const CheckedMesh checked, check(file, format, where));
  Assimp::Importer importer;
  SL_ASSIGN(const aiScene* const scene,
            read_scene(checked, file, format, where, directory, importer));
  // Says what is wrong with indices.
  SL_RETURN_IF_ERROR([&]() -> Status {
    SL_ASSIGN([[maybe_unused]] const PolygonMesh polygons,
              SceneReader(*scene, false, where, options).read());
    return {};
  }());
  MeshSurface surface =
      SurfaceReader(*scene, directory, static_cast<float>(options.meters_per_unit)).read();
  repair_surface(&surface);
  return surface;
} catch (const std::exception& e) {
  return make_error(ErrorCode::kInvalidInput, where, "cannot read as {}: {}", format, e.what());
}

}  // namespace sightline::geometry
