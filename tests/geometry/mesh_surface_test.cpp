// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_surface.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

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

TEST_F(MeshSurfaceFiles, GivesColoursAndPlacesInTheTexture) {
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

TEST_F(MeshSurfaceFiles, LooksForTexturesBesideTheMeshOnly) {
  for (const char* outside : {"../print.png", "/etc/passwd", "a/../../print.png"}) {
    const MeshSurface surface = read_mesh_surface(write_square(outside)).value();
    EXPECT_TRUE(surface.textures.empty()) << outside;
    for (const SurfaceTriangle& triangle : surface.triangles) EXPECT_EQ(triangle.texture, -1);
  }
}

TEST_F(MeshSurfaceFiles, IsEmptyForFormatsWithoutColour) {
  const fs::path off = write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_TRUE(read_mesh_surface(off).value().triangles.empty());
}

TEST_F(MeshSurfaceFiles, RefusesWhatIsNoMesh) {
  EXPECT_FALSE(read_mesh_surface(write("broken.obj", "v 1 2\nf 1 2 3\n")));
  EXPECT_FALSE(read_mesh_surface(folder_ / "absent.obj"));
}

}  // namespace
}  // namespace sightline
