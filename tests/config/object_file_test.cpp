// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/object_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace sightline {
namespace {

constexpr const char* kTag = R"(name = "carton"
mesh = "carton.obj"
unit = "mm"
[[fiducial]]
family = "tag36h11"
id = 7
size = 0.07
object_from_fiducial = [[1, 0, 0, 0.03], [0, 0, -1, -0.05], [0, 1, 0, -0.055], [0, 0, 0, 1]]
)";

constexpr const char* kBoard = R"(name = "board"
mesh = "board.obj"
unit = "m"
[board]
type = "charuco"
columns = 4
rows = 5
square = 0.054
marker = 0.0405
dictionary = "4X4_1000"
inverted = true
)";

Result<ObjectDescription> parse(const std::string& text) {
  return parse_object_file(text, "objects/x.toml", [](const std::filesystem::path& path) {
    return path.string().find("missing") == std::string::npos;
  });
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(ObjectFile, ReadsFiducials) {
  const auto object = parse(kTag);
  ASSERT_TRUE(object.has_value()) << object.error().message();
  EXPECT_EQ(object->name, "carton");
  EXPECT_EQ(object->file, "objects/x.toml");
  EXPECT_EQ(object->mesh, "objects/carton.obj");
  EXPECT_EQ(object->meters_per_unit, 0.001);
  EXPECT_EQ(object->symmetry, Symmetry::kNone);
  ASSERT_EQ(object->fiducials.size(), 1u);
  const Fiducial& tag = object->fiducials[0];
  EXPECT_EQ(tag.family, "tag36h11");
  EXPECT_EQ(tag.id, 7);
  EXPECT_EQ(tag.size, 0.07);
  // The tag's outward normal points to -y of the object.
  EXPECT_LT(
      (tag.object_from_fiducial * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(0.03, -1.05, -0.055))
          .norm(),
      1e-12);
}

TEST(ObjectFile, ReadsABoard) {
  const auto object = parse(kBoard);
  ASSERT_TRUE(object.has_value()) << object.error().message();
  ASSERT_TRUE(object->board.has_value());
  EXPECT_EQ(object->board->columns, 4);
  EXPECT_EQ(object->board->rows, 5);
  EXPECT_EQ(object->board->square, 0.054);
  EXPECT_EQ(object->board->marker, 0.0405);
  EXPECT_EQ(object->board->dictionary, "4X4_1000");
  EXPECT_TRUE(object->board->inverted);
}

TEST(ObjectFile, ReadsSymmetries) {
  const std::string base = "name = \"a\"\nmesh = \"a.obj\"\nunit = \"m\"\n";
  const auto axis = parse(base + "symmetry = \"axis\"\nsymmetry_axis = [0, 2, 0]\n");
  ASSERT_TRUE(axis.has_value()) << axis.error().message();
  EXPECT_EQ(axis->symmetry, Symmetry::kAxis);
  EXPECT_EQ(axis->symmetry_axis, Eigen::Vector3d(0, 1, 0));
  const auto turns = parse(base + "symmetry = \"discrete\"\nsymmetry_order = 4\n");
  ASSERT_TRUE(turns.has_value()) << turns.error().message();
  EXPECT_EQ(turns->symmetry_order, 4);
}

struct BadObject {
  const char* what;
  std::string text;
  const char* place;
  const char* says;
};

TEST(ObjectFile, EveryMistakeHasItsPlace) {
  const std::string tag = kTag, board = kBoard;
  const BadObject bad_objects[] = {
      {"syntax", "name = [\n", "1:10", "not valid TOML"},
      {"no name", replaced(tag, "name = \"carton\"", ""), "1:1", "needs \"name\""},
      {"name", replaced(tag, "\"carton\"", "\"a,b\""), "1:8", "no commas"},
      {"no mesh", replaced(tag, "mesh = \"carton.obj\"", ""), "1:1", "needs \"mesh\""},
      {"missing mesh", replaced(tag, "carton.obj", "missing.obj"), "2:8",
       "there is no file objects/missing.obj"},
      {"no unit", replaced(tag, "unit = \"mm\"", ""), "1:1", "needs \"unit\""},
      {"unit", replaced(tag, "\"mm\"", "\"inch\""), "3:8", "found \"inch\""},
      {"family", replaced(tag, "tag36h11", "tag36h12"), "5:10", "did you mean \"tag36h11\"?"},
      {"id", replaced(tag, "id = 7", "id = -7"), "6:6", "found -7"},
      {"size zero", replaced(tag, "0.07", "0"), "7:8", "a length in meters between"},
      {"size in mm", replaced(tag, "0.07", "70"), "7:8", "found 70"},
      {"no size", replaced(tag, "size = 0.07", ""), "4:1", "needs \"size\""},
      {"three rows", replaced(tag, ", [0, 0, 0, 1]]", "]"), "8:24", "4 rows of 4"},
      {"no rotation", replaced(tag, "[[1, 0", "[[2, 0"), "8:24", "object_from_fiducial"},
      {"mirrored", replaced(tag, "[[1, 0", "[[-1, 0"), "8:24", "object_from_fiducial"},
      {"unknown key", replaced(tag, "size =", "sise ="), "4:1", "needs \"size\""},
      {"twice", tag + std::string(kTag).substr(tag.find("[[fid")), "11:6", "stands here twice"},
      {"board type", replaced(board, "\"charuco\"", "\"chess\""), "5:8", "\"charuco\""},
      {"columns", replaced(board, "columns = 4", "columns = 1"), "6:11", "between 2 and 100"},
      {"marker", replaced(board, "0.0405", "0.054"), "9:10", "inside a square"},
      {"dictionary", replaced(board, "4X4_1000", "4X4_1001"), "10:14", "did you mean \"4X4_100"},
      {"symmetry", tag + "symetry = \"axis\"\n", "9:1", "unknown key \"symetry\""},
      {"symmetry kind", "symmetry = \"all\"\n" + tag, "1:12", "\"none\", \"axis\""},
      {"missing features", "features = \"missing.feat\"\n" + tag, "1:12",
       "there is no file objects/missing.feat (sightline train makes it)"},
      {"axis", "symmetry_axis = [0, 0, 0]\n" + tag, "1:17", "a direction"},
      {"order", "symmetry = \"discrete\"\n" + tag, "1:1", "needs \"symmetry_order\""},
  };
  for (const BadObject& bad : bad_objects) {
    const auto object = parse(bad.text);
    ASSERT_FALSE(object.has_value()) << bad.what;
    EXPECT_EQ(object.error().where, std::string("objects/x.toml:") + bad.place)
        << bad.what << "\n"
        << object.error().message();
    EXPECT_NE(object.error().text.find(bad.says), std::string::npos) << bad.what << "\n"
                                                                     << object.error().message();
  }
}

TEST(ObjectFile, MissingFile) {
  const auto object = read_object_file("/nowhere/x.toml");
  ASSERT_FALSE(object.has_value());
  EXPECT_EQ(exit_code(object.error()), 2) << object.error().message();
}

TEST(ObjectFile, ReadsTheOnesOfTheRecordings) {
  const std::filesystem::path folder = SIGHTLINE_SOURCE_DIR "/../shared/recordings";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  for (const char* file : {"bench/objects/carton.toml", "board/objects/board.toml",
                           "toy/objects/truck.toml", "bench-calibration/objects/board.toml"}) {
    const auto object = read_object_file(folder / file);
    EXPECT_TRUE(object.has_value()) << object.error().message();
  }
}

}  // namespace
}  // namespace sightline
