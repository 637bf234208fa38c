// SPDX-License-Identifier: Apache-2.0
//
// Object files of strangers: a recording takes in what they name and what lies beside them, nothing
// else.
#include <gmock/gmock.h>

#include <set>

#include "record/media.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/writer.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

const std::string kSecret = "root:$6$secret";
const std::string kMesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

class ObjectCopy : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(lib());
    write_text(temp_ / "secret", kSecret);
  }
  fs::path lib() const { return temp_ / "lib"; }
  std::string secret() const { return (temp_ / "secret").string(); }
  fs::path out() const { return temp_ / "rec"; }

  /// Records with these objects; the recording is opened again.
  Recording record(const std::vector<fs::path>& objects,
                   const std::optional<fs::path>& scene = std::nullopt) {
    RecordingWriterOptions options;
    options.cameras = {{"cam", PixelFormat::kI420, kWidth, kHeight}};
    options.objects = objects;
    options.scene = scene;
    auto writer = RecordingWriter::create(out(), options);
    EXPECT_TRUE(writer) << writer.error().message();
    EXPECT_TRUE((*writer)->append(*frame_at(0, 0, 1000)));
    EXPECT_TRUE((*writer)->close());
    auto recording = open_recording(out(), RecordingMode::kStrict);
    EXPECT_TRUE(recording) << recording.error().message();
    return *std::move(recording);
  }

  Recording record_object(const std::string& text) {
    write_text(lib() / "cup.toml", text);
    return record({lib() / "cup.toml"});
  }

  /// Files under objects/ and scene/, relative to the recording.
  std::set<std::string> copied() const {
    std::set<std::string> names;
    for (const char* folder : {"objects", "scene"}) {
      if (!fs::exists(out() / folder)) continue;
      for (const auto& entry : fs::recursive_directory_iterator(out() / folder)) {
        if (entry.is_regular_file()) names.insert(fs::relative(entry.path(), out()).string());
      }
    }
    return names;
  }

  bool secret_was_taken() const {
    for (const auto& entry : fs::recursive_directory_iterator(out())) {
      if (entry.is_regular_file() && read_text(entry.path()).find(kSecret) != std::string::npos) {
        return true;
      }
    }
    return false;
  }

  TempFolder temp_;
};

TEST_F(ObjectCopy, CommentsAndNamesCopyNothing) {
  write_text(lib() / "notes.txt", "mine");
  write_text(lib() / "cup.obj", kMesh + "# " + secret() + "\n");
  record_object("# see " + secret() + " and notes.txt\nname = \"notes.txt\"\nmesh = \"cup.obj\"\n");
  EXPECT_THAT(copied(), ElementsAre("objects/cup.obj", "objects/cup.toml"));
  EXPECT_FALSE(secret_was_taken());
}

TEST_F(ObjectCopy, WhatLiesOutsideIsLeftOutAndSaid) {
  const auto recording = record_object("mesh = \"../secret\"\nfeatures = \"" + secret() + "\"\n");
  EXPECT_THAT(copied(), ElementsAre("objects/cup.toml"));
  EXPECT_FALSE(secret_was_taken());
  EXPECT_THAT(read_text(out() / "recording.toml"), HasSubstr("left_out = ["));
  EXPECT_THAT(recording.warnings, Contains(HasSubstr("../secret")));
  EXPECT_THAT(recording.warnings, Contains(HasSubstr(secret())));
}

TEST_F(ObjectCopy, LinksThatLeadOutAreOutside) {
  fs::create_symlink(secret(), lib() / "cup.obj");
  fs::create_directory_symlink(temp_.path(), lib() / "up");
  const auto recording = record_object("mesh = \"cup.obj\"\nfeatures = \"up/secret\"\n");
  EXPECT_THAT(copied(), ElementsAre("objects/cup.toml"));
  EXPECT_FALSE(secret_was_taken());
  EXPECT_THAT(recording.warnings, Contains(HasSubstr("cup.obj")));
  EXPECT_THAT(recording.warnings, Contains(HasSubstr("up/secret")));
}

TEST_F(ObjectCopy, LinksWithinTheFolderAreFollowed) {
  write_text(lib() / "real.obj", kMesh);
  fs::create_symlink("real.obj", lib() / "cup.obj");
  const auto recording = record_object("mesh = \"cup.obj\"\n");
  EXPECT_THAT(copied(), ElementsAre("objects/cup.obj", "objects/cup.toml"));
  EXPECT_EQ(read_text(out() / "objects" / "cup.obj"), kMesh);
  EXPECT_TRUE(recording.warnings.empty());
}

TEST_F(ObjectCopy, MaterialsAndTexturesOfTheMeshGoAlong) {
  fs::create_directories(lib() / "meshes" / "skins");
  write_text(lib() / "meshes" / "cup.OBJ", "mtllib the cup.mtl\nmtllib ../../secret\n" + kMesh);
  write_text(lib() / "meshes" / "the cup.mtl",
             "newmtl a\nmap_Kd -s 1 1 1 skins/a b.png\nmap_Ks " + secret() + "\n# plain.png\n");
  write_text(lib() / "meshes" / "skins" / "a b.png", "png");
  write_text(lib() / "meshes" / "plain.png", "png");
  write_text(lib() / "cup.feat", "features");
  const auto recording = record_object("mesh = \"meshes/cup.OBJ\"\nfeatures = \"cup.feat\"\n");
  EXPECT_THAT(copied(),
              ElementsAre("objects/cup.feat", "objects/cup.toml", "objects/meshes/cup.OBJ",
                          "objects/meshes/skins/a b.png", "objects/meshes/the cup.mtl"));
  EXPECT_FALSE(secret_was_taken());
  EXPECT_THAT(recording.warnings, Contains(HasSubstr("../../secret")));
}

TEST_F(ObjectCopy, BuffersAndImagesOfGltf) {
  write_text(lib() / "a.bin", "bin");
  write_text(lib() / "b c.png", "png");
  write_text(lib() / "not.png", "png");
  write_text(lib() / "cup.gltf",
             R"({"asset": {"version": "2.0", "copyright": "not.png"},
                 "buffers": [{"uri": "a.bin"}, {"uri": ")" +
                 secret() + R"("}],
                 "images": [{"uri": "b%20c.png"}, {"uri": "data:image/png;base64,AAAA"}]})");
  const auto recording = record({}, lib() / "cup.gltf");
  EXPECT_THAT(copied(), ElementsAre("scene/a.bin", "scene/b c.png", "scene/cup.gltf"));
  EXPECT_FALSE(secret_was_taken());
  EXPECT_THAT(recording.warnings, Contains(HasSubstr(secret())));
}

TEST_F(ObjectCopy, DamagedFilesAreCopiedAloneAndHarmNothing) {
  write_text(lib() / "cup.glb",
             std::string("glTF\2\0\0\0\xff\xff\xff\xff\xff\xff\xff\xffJSON{", 21));
  EXPECT_TRUE(record_object("mesh = \"cup.glb\"\n").warnings.empty());
  EXPECT_THAT(copied(), ElementsAre("objects/cup.glb", "objects/cup.toml"));
  fs::remove_all(out());
  write_text(lib() / "cup.gltf", std::string(100'000, '['));
  record_object("mesh = \"cup.gltf\"\n");
  EXPECT_THAT(copied(), ElementsAre("objects/cup.gltf", "objects/cup.toml"));
}

TEST_F(ObjectCopy, ObjectsOfSeveralFoldersKeepTheirOwnMeshes) {
  fs::create_directories(temp_ / "other");
  write_text(lib() / "cup.toml", "mesh = \"mesh.obj\"\n");
  write_text(lib() / "mesh.obj", kMesh);
  write_text(temp_.path() / "other" / "box.toml", "mesh = \"mesh.obj\"\n");
  write_text(temp_.path() / "other" / "mesh.obj", kMesh + "# of the box\n");
  const auto recording = record({lib() / "cup.toml", temp_.path() / "other" / "box.toml"});
  ASSERT_EQ(recording.objects.size(), 2u);
  EXPECT_EQ(read_text(recording.objects[0].parent_path() / "mesh.obj"), kMesh);
  EXPECT_EQ(read_text(recording.objects[1].parent_path() / "mesh.obj"), kMesh + "# of the box\n");
}

TEST_F(ObjectCopy, ANameFromTheRootThatLeadsBackIsMadeRelative) {
  write_text(lib() / "cup.obj", kMesh);
  const auto recording = record_object("mesh = \"" + (lib() / "cup.obj").string() + "\"\n");
  EXPECT_THAT(copied(), ElementsAre("objects/cup.obj", "objects/cup.toml"));
  EXPECT_EQ(read_text(out() / "objects" / "cup.toml"), "mesh = \"cup.obj\"\n");
  EXPECT_TRUE(recording.warnings.empty());
}

}  // namespace
}  // namespace sightline
