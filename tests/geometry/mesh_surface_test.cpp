// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_surface.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace sightline {
namespace {

namespace fs = std::filesystem;

class MeshSurfaceFiles : public ::testing::Test {
 protected:
  MeshSurfaceFiles()
      : folder_(fs::temp_directory_path() / ("surface-" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~MeshSurfaceFiles() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name) << content;
    return folder_ / name;
  }
  fs::path write_square(const std::string& texture) const {
    write("square.mtl", "newmtl print\nKd 0.5 0.25 0.125\nmap_Kd " + texture + "\n");
    return write("square.obj",
                 "mtllib square.mtl\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n"
                 "vt 0 0\nvt 1 0\nvt 1 0.5\nvt 0 0.5\nusemtl print\nf 1/1 2/2 3/3 4/4\n");
  }

  fs::path folder_;
};

TEST_F(MeshSurfaceFiles, GivesColorsAndPlacesInTheTexture) {
  MeshOptions options;
  options.meters_per_unit = 0.01;
  const MeshSurface surface = read_mesh_surface(write_square("print.png"), options).value();
  ASSERT_EQ(surface.textures.size(), 1u);
  EXPECT_EQ(surface.textures[0], folder_ / "print.png");
  ASSERT_EQ(surface.triangles.size(), 2u);
  for (const SurfaceTriangle& triangle : surface.triangles) {
    EXPECT_EQ(triangle.texture, 0);
    EXPECT_TRUE(triangle.color.isApprox(Eigen::Vector3f(0.5f, 0.25f, 0.125f)));
    for (size_t i = 0; i < 3; ++i) {
      // Texture and square have the same axes.
      EXPECT_NEAR(triangle.corners[i].x(), 0.02f * triangle.places[i].x(), 1e-6f);
      EXPECT_NEAR(triangle.corners[i].y(), 0.04f * triangle.places[i].y(), 1e-6f);
    }
  }
}

std::string base64(const std::string& bytes) {
  constexpr const char* kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t word = 0;
    for (size_t k = 0; k < 3; ++k) {
      const auto byte = i + k < bytes.size() ? static_cast<uint8_t>(bytes[i + k]) : uint8_t{0};
      word = word << 8 | byte;
    }
    for (size_t k = 0; k < 4; ++k)
      out += i + k > bytes.size() ? '=' : kLetters[word >> (18 - 6 * k) & 63];
  }
  return out;
}

/// A square of two faces with places, colors and, last, an image of ten bytes in one buffer.
std::string gltf_square(const std::string& image, const std::string& texture_extra = "") {
  std::string buffer;
  const auto add = [&](std::initializer_list<float> values) {
    for (const float value : values) {
      char bytes[sizeof value];
      std::memcpy(bytes, &value, sizeof value);
      buffer.append(bytes, sizeof bytes);
    }
  };
  add({0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0});
  add({0, 1, 1, 1, 1, 0, 0, 0});  // counted from the top
  add({1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1});
  for (const int index : {0, 1, 2, 0, 2, 3}) {
    buffer += static_cast<char>(index);
    buffer += '\0';
  }
  buffer += "0123456789";
  const std::string bytes = std::to_string(buffer.size());
  return "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
         "\"nodes\":[{\"mesh\":0}],\"buffers\":[{\"byteLength\":" +
         bytes + ",\"uri\":\"data:application/octet-stream;base64," + base64(buffer) +
         "\"}],"
         "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48},"
         "{\"buffer\":0,\"byteOffset\":48,\"byteLength\":32},"
         "{\"buffer\":0,\"byteOffset\":80,\"byteLength\":64},"
         "{\"buffer\":0,\"byteOffset\":144,\"byteLength\":12},"
         "{\"buffer\":0,\"byteOffset\":156,\"byteLength\":10}],"
         "\"accessors\":[{\"bufferView\":0,\"count\":4,\"componentType\":5126,\"type\":\"VEC3\"},"
         "{\"bufferView\":1,\"count\":4,\"componentType\":5126,\"type\":\"VEC2\"},"
         "{\"bufferView\":2,\"count\":4,\"componentType\":5126,\"type\":\"VEC4\"},"
         "{\"bufferView\":3,\"count\":6,\"componentType\":5123,\"type\":\"SCALAR\"}],"
         "\"images\":[" +
         image +
         "],\"textures\":[{\"source\":0}],"
         "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0" +
         texture_extra +
         "}}}],"
         "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1,"
         "\"COLOR_0\":2},\"indices\":3,\"material\":0}]}]}";
}

TEST_F(MeshSurfaceFiles, ReadsTexturesAndColorsOfGltf) {
  const std::array<std::pair<const char*, std::string>, 3> images = {
      std::pair{"{\"bufferView\":4,\"mimeType\":\"image/png\"}", "0123456789"},
      {"{\"uri\":\"data:image/png;base64,MDEyMzQ1Njc4OTo=\"}", "0123456789:"},
      {"{\"uri\":\"print.png\"}", ""}};
  for (const auto& [image, bytes] : images) {
    const auto surface = read_mesh_surface(write("square.gltf", gltf_square(image)));
    ASSERT_TRUE(surface) << surface.error().message();
    ASSERT_EQ(surface->textures.size(), 1u) << image;
    ASSERT_EQ(surface->embedded.size(), 1u);
    EXPECT_EQ(surface->embedded[0], bytes);
    if (bytes.empty()) {
      EXPECT_EQ(surface->textures[0], folder_ / "print.png");
    }
    ASSERT_EQ(surface->triangles.size(), 2u);
    for (const SurfaceTriangle& triangle : surface->triangles) {
      EXPECT_EQ(triangle.texture, 0);
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(triangle.corners[i].x(), 2 * triangle.places[i].x(), 1e-6f);
        EXPECT_NEAR(triangle.corners[i].y(), 2 * triangle.places[i].y(), 1e-6f);
      }
    }
    EXPECT_TRUE(surface->triangles[0].corner_colors[1].isApprox(Eigen::Vector3f(0, 1, 0)));
    EXPECT_TRUE(surface->triangles[0].corner_colors[0].isApprox(Eigen::Vector3f(1, 0, 0)));
  }
}

TEST_F(MeshSurfaceFiles, LeavesOutWhatItDoesNotUnderstandOfGltf) {
  const char* const known = "{\"uri\":\"print.png\"}";
  for (const char* extra : {",\"texCoord\":1", ",\"extensions\":{\"KHR_texture_transform\":{}}"}) {
    const auto surface = read_mesh_surface(write("square.gltf", gltf_square(known, extra)));
    ASSERT_TRUE(surface) << surface.error().message();
    EXPECT_EQ(surface->triangles.at(0).texture, -1) << extra;
  }
  for (const char* image : {"{\"bufferView\":4,\"mimeType\":\"image/ktx2\"}", "{}",
                            "{\"uri\":\"data:image/png;base64,no\"}"}) {
    const auto surface = read_mesh_surface(write("square.gltf", gltf_square(image)));
    ASSERT_TRUE(surface) << surface.error().message();
    EXPECT_EQ(surface->embedded, std::vector<std::string>(surface->textures.size())) << image;
  }
  EXPECT_FALSE(read_mesh_surface(
      write("square.gltf", gltf_square("{\"bufferView\":9,\"mimeType\":\"image/png\"}"))));
  for (const char* outside : {"{\"uri\":\"../print.png\"}", "{\"uri\":\"/etc/passwd\"}"}) {
    const auto surface = read_mesh_surface(write("square.gltf", gltf_square(outside)));
    ASSERT_TRUE(surface) << surface.error().message();
    EXPECT_TRUE(surface->textures.empty()) << outside;
  }
}

TEST_F(MeshSurfaceFiles, LooksForTexturesBesideTheMeshOnly) {
  for (const char* outside : {"../print.png", "/etc/passwd", "a/../../print.png"}) {
    const MeshSurface surface = read_mesh_surface(write_square(outside)).value();
    EXPECT_TRUE(surface.textures.empty()) << outside;
    for (const SurfaceTriangle& triangle : surface.triangles) EXPECT_EQ(triangle.texture, -1);
  }
}

TEST_F(MeshSurfaceFiles, IsEmptyForFormatsWithoutColor) {
  const fs::path off = write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_TRUE(read_mesh_surface(off).value().triangles.empty());
}

TEST_F(MeshSurfaceFiles, RefusesWhatIsNoMesh) {
  EXPECT_FALSE(read_mesh_surface(write("broken.obj", "v 1 2\nf 1 2 3\n")));
  EXPECT_FALSE(read_mesh_surface(folder_ / "absent.obj"));
}

}  // namespace
}  // namespace sightline
