// SPDX-License-Identifier: Apache-2.0
//
// Broken mesh files: each is refused by line or element, never handed on.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>

#include "mesh_samples.hpp"
#include "sightline/base/files.hpp"
#include "sightline/geometry/mesh.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;

/// Tetrahedron of a format with the first `from` replaced.
auto with(const std::string& format, const std::string& from, const std::string& to) {
  std::string text;
  for (const auto& [name, sample] : test::tetrahedra()) {
    if (name == format) text = sample;
  }
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  return parse_mesh(text, format, "t." + format);
}

TEST(ObjCheck, NamesTheLine) {
  EXPECT_THAT(with("obj", "v 0 1 0", "v 0 nan 0"), FailsWith("t.obj:4: vertex 3 is not finite"));
  EXPECT_THAT(with("obj", "v 0 1 0", "v 0 1e60 0"), FailsWith("t.obj:4: vertex 3 is not finite"));
  EXPECT_THAT(with("obj", "v 0 1 0", "v 0 1"), FailsWith("t.obj:4: vertex 3 has 2 numbers"));
  EXPECT_THAT(with("obj", "v 0 1 0", "v 0 x 0"), FailsWith("t.obj:4: vertex 3: 'x' is not"));
  EXPECT_THAT(with("obj", "f 1 2 4", "f 1 2 99"),
              FailsWith("t.obj:7: face 2: vertex index 99 of 4"));
  EXPECT_THAT(with("obj", "f 1 2 4", "f 1 2 -5"),
              FailsWith("t.obj:7: face 2: vertex index -5 of 4 so far"));
  EXPECT_THAT(with("obj", "f 1 2 4", "f 1 2 0"), FailsWith("t.obj:7: face 2: '0' is not a vertex"));
  EXPECT_THAT(with("obj", "f 1 2 4", "f 1//1 2//1 4//1"),
              FailsWith("t.obj:7: face 2: normal index 1 of 0"));
  EXPECT_THAT(with("obj", "f 1 2 4", "f 1/2/3/4 2 4"), FailsWith("is not a corner"));
  EXPECT_THAT(with("obj", "f 1 2 4", "f 1 2"), FailsWith("t.obj:7: face 2: 2 corners"));
  EXPECT_THAT(parse_mesh("v 0 0 0\nv 1 0 0\n", "obj", "t.obj"), FailsWith("t.obj: "));
  EXPECT_THAT(parse_mesh("", "obj", "t.obj"), FailsWith("t.obj: "));
}

TEST(ObjCheck, LeavesOutWhatIsNoSurface) {
  EXPECT_THAT(
      with("obj", "f 1 2 4", "l 1 99\np 77\nlod 3\nfo 9 9 9\no a\ns 1\ng b\nf 1 2 \\\n 4 # x"),
      IsOk());
}

TEST(ObjCheck, NumbersMayBeginWithTheirPoint) {
  const auto mesh = with("obj", "v 0 1 0\nv 0 0 1", "v 0 .5 -.0\nv 0 0 +.5e0");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_FLOAT_EQ(mesh->max_corner.y(), 0.5f);
  EXPECT_FLOAT_EQ(mesh->max_corner.z(), 0.5f);
}

TEST(ObjCheck, RefusesPolygonsWithoutEnd) {
  std::string face = "f";
  for (int i = 0; i < 5000; ++i) face += " 1 2 3";
  EXPECT_THAT(with("obj", "f 1 2 4", face), FailsWith("t.obj:7: face 2: 15000 corners"));
}

/// `count` squares, each behind a line that `line(i)` gives.
template <typename Line>
std::string squares(int count, Line line) {
  std::string text = "mtllib a.mtl\nmtllib a.mtl\n";
  for (int i = 0; i < count; ++i) {
    text +=
        fmt::format("{}\nv {} 0 0\nv {} 1 0\nv {} 1 1\nf -3 -2 {}\n", line(i), i, i, i, 3 * i + 3);
  }
  return text;
}

/// Seconds and the mesh, or why it was refused.
std::pair<double, Result<TriangleMesh>> timed(const std::string& text) {
  const auto start = std::chrono::steady_clock::now();
  MeshOptions options;
  options.max_extent = 1e7;
  auto mesh = parse_mesh(text, "obj", "t.obj", options);
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          std::move(mesh)};
}

constexpr double kAtOnce = 10;  // [s]; without sanitizers it is a fraction of one

TEST(ObjCheck, MaterialsThatTakeTurnsTakeNoTime) {
  const auto [seconds, mesh] =
      timed(squares(60'000, [](int i) { return fmt::format("usemtl paint {}", i % 40); }));
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 60'000u);
  EXPECT_LT(seconds, kAtOnce);
}

TEST(ObjCheck, MaterialsWithoutEndAreRefusedAtOnce) {
  const auto [seconds, mesh] =
      timed(squares(60'000, [](int i) { return fmt::format("usemtl paint{}", i); }));
  EXPECT_THAT(mesh, FailsWith("more than 4096 materials"));
  EXPECT_LT(seconds, kAtOnce);
  const auto [some_seconds, some] =
      timed(squares(4000, [](int i) { return fmt::format("usemtl paint{}", i); }));
  ASSERT_THAT(some, IsOk());
  EXPECT_EQ(some->faces.size(), 4000u);
  EXPECT_LT(some_seconds, kAtOnce);
}

TEST(ObjCheck, GroupsWithoutEndTakeNoTime) {
  const auto [seconds, mesh] = timed(squares(300'000, [](int i) {
    return fmt::format("o part{}\ng group{}\nusemtl paint{}", i, i, i % 2);
  }));
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 300'000u);
  EXPECT_LT(seconds, 3 * kAtOnce);
}

TEST(ObjCheck, LibrariesWithoutEndAreRefused) {
  EXPECT_THAT(timed(squares(100, [](int i) { return fmt::format("mtllib {}.mtl", i); })).second,
              FailsWith("more than 64 material libraries"));
}

/// A mesh beside a library of materials, of which it uses many.
TEST(ObjCheck, LargeLibrariesTakeNoTimeOrAreRefused) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / fmt::format("obj_check.{}", ::getpid());
  std::filesystem::create_directories(folder);
  const auto library = [&](int count) {
    std::string text;
    for (int i = count; i-- > 0;) text += fmt::format("newmtl m{}\n", i);
    ASSERT_THAT(write_file_atomically(folder / "a.mtl", text), IsOk());
  };
  const std::string mesh =
      squares(60'000, [](int i) { return fmt::format("usemtl m{}", i % 4000); });
  ASSERT_THAT(write_file_atomically(folder / "a.obj", mesh), IsOk());
  MeshOptions options;
  options.max_extent = 1e7;
  library(4096);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(read_mesh(folder / "a.obj", options), IsOk());
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  library(250'000);
  EXPECT_THAT(read_mesh(folder / "a.obj", options), FailsWith("to more than 4096 materials"));
  library(500'000);
  EXPECT_THAT(read_mesh(folder / "a.obj", options), FailsWith("a.mtl is larger than"));
  std::filesystem::remove_all(folder);
}

TEST(OffCheck, NamesTheLine) {
  EXPECT_THAT(with("off", "0 1 0", "0 inf 0"), FailsWith("t.off:6: vertex 2 is not finite"));
  EXPECT_THAT(with("off", "3 0 1 3", "3 0 1 4"), FailsWith("t.off:9: face 1: vertex index 4 of 4"));
  EXPECT_THAT(with("off", "3 0 1 3", "3 0 1 -1"), FailsWith("t.off:9: face 1: vertex index -1 of"));
  EXPECT_THAT(with("off", "3 0 1 3", "4 0 1 3"), FailsWith("t.off:9: face 1: 3 indices for 4"));
  EXPECT_THAT(with("off", "4 4 6", "4 5 6"), FailsWith("file ends at face 4"));
  EXPECT_THAT(with("off", "4 4 6", "4 3 6"), FailsWith("t.off:11: text after the last of 3 faces"));
  EXPECT_THAT(with("off", "4 4 6", "4000000000 4 6"), FailsWith("but the file has"));
  EXPECT_THAT(with("off", "OFF", "COFF"), FailsWith("does not begin with OFF"));
}

/// assimp's own reader drops faces of more than nine corners without a word.
TEST(OffCheck, LargePolygonsAreRead) {
  std::string text = "OFF\n14 2 0\n";
  for (int i = 0; i < 14; ++i) {
    const float a = 6.2831853f * static_cast<float>(i) / 14;
    text += fmt::format("{} {} 0\n", std::cos(a), std::sin(a));
  }
  text += "3 0 1 2\n14 0 1 2 3 4 5 6 7 8 9 10 11 12 13\n";
  const auto mesh = parse_mesh(text, "off", "t.off");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 13u);
}

TEST(PlyCheck, NamesTheLine) {
  EXPECT_THAT(with("ply", "0 1 0\n", "0 nan 0\n"),
              FailsWith("t.ply:13: vertex 2: y is not finite"));
  EXPECT_THAT(with("ply", "3 0 1 3", "3 0 1 4"),
              FailsWith("t.ply:16: face 1: vertex index 4 of 4"));
  EXPECT_THAT(with("ply", "3 0 1 3", "3 0 1 -1"), FailsWith("t.ply:16: face 1: vertex index -1"));
  EXPECT_THAT(with("ply", "3 0 1 3", "2 0 1"), FailsWith("t.ply:16: face 1: 2 corners"));
  EXPECT_THAT(with("ply", "3 0 1 3", "3 0 1 3 7"), FailsWith("more values than properties"));
  EXPECT_THAT(with("ply", "face 4", "face 5"), FailsWith("face 4: '' is not a number"));
  EXPECT_THAT(with("ply", "face 4", "face 99999999"), FailsWith("t.ply:8: the number of elements"));
  EXPECT_THAT(with("ply", "property float z\n", ""), FailsWith("needs one property z"));
  EXPECT_THAT(with("ply", "list uchar int", "list uchar blob"), FailsWith("'blob'"));
  EXPECT_THAT(with("ply", "end_header", "end"), FailsWith("'end' is no PLY header line"));
  EXPECT_THAT(with("ply", "ascii", "binary_little_endian"), FailsWith("t.ply: "));
}

std::string binary_ply(uint32_t last_index, float z) {
  std::string out =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar uint vertex_indices\nend_header\n";
  const float vertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, z};
  out.append(reinterpret_cast<const char*>(vertices), sizeof vertices);
  const uint32_t indices[3] = {0, 1, last_index};
  out += '\3';
  out.append(reinterpret_cast<const char*>(indices), sizeof indices);
  return out;
}

TEST(PlyCheck, ReadsBinaryAndNamesTheElement) {
  const auto mesh = parse_mesh(binary_ply(2, 0), "ply", "b.ply");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 1u);
  EXPECT_THAT(parse_mesh(binary_ply(3, 0), "ply", "b.ply"),
              FailsWith("b.ply: face 0: vertex index 3 of 3"));
  EXPECT_THAT(parse_mesh(binary_ply(2, std::nanf("")), "ply", "b.ply"),
              FailsWith("b.ply: vertex 2: z is not finite"));
  const std::string whole = binary_ply(2, 0);
  EXPECT_THAT(parse_mesh(whole.substr(0, whole.size() - 2), "ply", "b.ply"),
              FailsWith("b.ply: file ends within face 0 of 1"));
}

TEST(StlCheck, NamesTheLine) {
  EXPECT_THAT(with("stl", "vertex 0 1 0", "vertex 0 nan 0"),
              FailsWith("t.stl:5: facet 0: a vertex is not finite"));
  EXPECT_THAT(with("stl", "vertex 0 1 0\n", ""),
              FailsWith("t.stl:6: facet 0: 'endloop' where 'vertex'"));
  EXPECT_THAT(with("stl", "endsolid", "end"), FailsWith("'end' where 'facet' was expected"));
  EXPECT_THAT(with("stl", "solid", "sold"), FailsWith("t.stl: neither text"));
}

TEST(StlCheck, ReadsBinaryAndRefusesACutFile) {
  std::string out(80, ' ');
  const uint32_t count = 1;
  out.append(reinterpret_cast<const char*>(&count), sizeof count);
  const float facet[12] = {0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0};
  out.append(reinterpret_cast<const char*>(facet), sizeof facet);
  out.append(2, '\0');
  const auto mesh = parse_mesh(out, "stl", "b.stl");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 1u);
  EXPECT_THAT(parse_mesh(out.substr(0, 100), "stl", "b.stl"), FailsWith("cut short?"));
  const float nan = std::nanf("");
  std::memcpy(out.data() + 84 + 16, &nan, sizeof nan);
  EXPECT_THAT(parse_mesh(out, "stl", "b.stl"), FailsWith("b.stl: vertex 0 is not finite"));
}

TEST(GltfCheck, NamesTheElement) {
  EXPECT_THAT(with("gltf", "\"POSITION\":0", "\"POSITION\":7"),
              FailsWith("t.gltf: meshes[0]: accessors index 7 of 2"));
  EXPECT_THAT(with("gltf", "\"count\":4", "\"count\":5"),
              FailsWith("accessors[0]: 5 elements do not fit"));
  EXPECT_THAT(with("gltf", "\"byteLength\":24", "\"byteLength\":99"),
              FailsWith("bufferViews[1]: bytes"));
  EXPECT_THAT(with("gltf", "\"byteLength\":72", "\"byteLength\":73"), FailsWith("base64"));
  EXPECT_THAT(with("gltf", "\"nodes\":[0]", "\"nodes\":[1]"), FailsWith("node index 1 of 1"));
  EXPECT_THAT(with("gltf", "{\"mesh\":0}", "{\"mesh\":0,\"children\":[0]}"),
              FailsWith("nodes[0] is no root"));
  EXPECT_THAT(with("gltf", "\"2.0\"", "\"1.0\""), FailsWith("not glTF version 2"));
  EXPECT_THAT(with("gltf", "\"scene\":0", "\"extensionsRequired\":[\"X_y\"]"), FailsWith("X_y"));
  EXPECT_THAT(with("gltf", "{\"mesh\":0}", "{\"mesh\":0,\"scale\":[1,2]}"), FailsWith("'scale'"));
  EXPECT_THAT(with("gltf", "\"mesh\":0", fmt::format("\"mesh\":{}", std::string(60, '['))),
              FailsWith("nested"));
  EXPECT_THAT(with("gltf", "\"mesh\":0", "\"mesh\":"), FailsWith("not a glTF document"));
  // The last index of the buffer, in base64, made 4: assimp drops such a face without a word.
  const auto corrupt = with("gltf", "AAADAAIA\"", "AAADAAQA\"");
  EXPECT_THAT(corrupt, FailsWith("3 of 4 faces"));
  EXPECT_EQ(exit_code(corrupt.error()), 2);
  const auto circle = with("gltf", "\"nodes\":[{\"mesh\":0}]",
                           "\"nodes\":[{\"mesh\":0},{\"children\":[2]},{\"children\":[1]}]");
  EXPECT_THAT(circle, FailsWith("in a circle"));
  EXPECT_EQ(exit_code(circle.error()), 2);
}

std::string little_endian(size_t value) {
  const auto word = static_cast<uint32_t>(value);
  return std::string(reinterpret_cast<const char*>(&word), sizeof word);
}

/// The tetrahedron with its buffer as the binary chunk.
std::string binary_gltf() {
  std::string text;
  for (const auto& [name, sample] : test::tetrahedra()) {
    if (name == "gltf") text = sample;
  }
  const size_t uri = text.find(",\"uri\"");
  text.erase(uri, text.rfind("\"}]") + 1 - uri);
  while (text.size() % 4 != 0) text += ' ';
  const float vertices[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const uint16_t indices[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
  std::string data(reinterpret_cast<const char*>(vertices), sizeof vertices);
  data.append(reinterpret_cast<const char*>(indices), sizeof indices);
  return "glTF" + little_endian(2) + little_endian(28 + text.size() + data.size()) +
         little_endian(text.size()) + "JSON" + text + little_endian(data.size()) +
         std::string("BIN\0", 4) + data;
}

TEST(GltfCheck, ReadsBinaryFiles) {
  const std::string glb = binary_gltf();
  const auto mesh = parse_mesh(glb, "glb", "t.glb");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 4u);
  EXPECT_TRUE(mesh->closed);
  EXPECT_THAT(parse_mesh(glb.substr(0, glb.size() - 1), "glb", "t.glb"), FailsWith("cut short"));
  for (const char last : {'\4', '\xff'}) {  // index
    std::string corrupt = glb;
    corrupt[corrupt.size() - 2] = last;
    const auto refused = parse_mesh(corrupt, "glb", "t.glb");
    ASSERT_FALSE(refused);
    EXPECT_EQ(exit_code(refused.error()), 2) << refused.error().message();
  }
}

}  // namespace
}  // namespace sightline
