// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "fake_files.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/config/overlay_keys.hpp"

namespace sightline {
namespace {

using test::fake_files;

constexpr const char* kBase = R"(calibration = "calibration.toml"
[[camera]]
name = "left"
source = "replay:rec"
[[object]]
file = "objects/carton.toml"
)";

Result<Installation> parse(const std::string& more) {
  return parse_installation(kBase + more, "dir/cell.toml", fake_files());
}

TEST(Zones, AreReadWithTheirBoxObjectsAndRecordings) {
  const auto read = parse(R"([record]
directory = "rec"
[[zone]]
name = "door"
min = [0, 0, 0]
max = [1, 2, 3]
objects = ["carton"]
record = ["viewing", "poses"]
[[zone]]
name = "floor"
min = [-1, -1, -0.1]
max = [1, 1, 0.1]
)");
  ASSERT_TRUE(read) << read.error().message();
  ASSERT_EQ(read->zones.size(), 2u);
  const ZoneConfig& door = read->zones[0];
  EXPECT_EQ(door.name, "door");
  EXPECT_EQ(door.box.max, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(door.watches("carton"));
  EXPECT_FALSE(door.watches("crate"));
  EXPECT_EQ(door.record, (std::vector{RecordingKind::kViewing, RecordingKind::kPoses}));
  EXPECT_TRUE(read->zones[1].watches("crate"));
  InstallationChanges only_zones;
  only_zones.zones = true;
  only_zones.record = true;
  EXPECT_EQ(compare(*parse(""), *read), only_zones);
}

TEST(Zones, MistakesHaveTheirPlace) {
  const std::string box = "min = [0, 0, 0]\nmax = [1, 1, 1]\n";
  const std::pair<std::string, std::string> cases[] = {
      {"[[zone]]\n" + box, "the zone is called"},
      {"[[zone]]\nname = \"a\"\nmin = [0, 0, 0]\n", "the corner with the largest"},
      {"[[zone]]\nname = \"a\"\nmin = [0, 0, 0]\nmax = [1, 0, 1]\n", "must be above min"},
      {"[[zone]]\nname = \"a,b\"\n" + box, "no commas"},
      {"[[zone]]\nname = \"a\"\nobjects = [\"cartn\"]\n" + box, "did you mean \"carton\"?"},
      {"[[zone]]\nname = \"a\"\nrecord = [\"poses\"]\n" + box, "[record] directory has to name"},
      {"[[zone]]\nname = \"a\"\nradius = 1\n" + box, "unknown key \"radius\""},
      {"[[zone]]\nname = \"a\"\n" + box + "[[zone]]\nname = \"a\"\n" + box, "already"},
  };
  for (const auto& [text, says] : cases) {
    const auto read = parse(text);
    ASSERT_FALSE(read) << text;
    EXPECT_NE(read.error().message().find(says), std::string::npos) << read.error().message();
    EXPECT_TRUE(read.error().where.starts_with("dir/cell.toml:")) << read.error().where;
  }
}

TEST(OverlayKeys, SayWhatMakesTheSameStyle) {
  for (const std::string_view theme : theme_names()) {
    const OverlayStyle style = *theme_style(theme);
    std::string toml;
    for (const auto& [key, value] : overlay_keys(style)) {
      toml += key + " = ";
      if (const auto* flag = std::get_if<bool>(&value)) toml += *flag ? "true" : "false";
      if (const auto* number = std::get_if<double>(&value)) toml += fmt::format("{}", *number);
      if (const auto* number = std::get_if<int64_t>(&value)) toml += fmt::format("{}", *number);
      if (const auto* text = std::get_if<std::string>(&value)) toml += '"' + *text + '"';
      if (const auto* list = std::get_if<std::vector<std::string>>(&value)) {
        toml += "[";
        for (const std::string& name : *list) toml += '"' + name + "\",";
        toml += "]";
      }
      toml += "\n";
    }
    OverlayStyle made = bare_style();
    const Status done = apply_overlay_keys(toml, made);
    ASSERT_TRUE(done) << done.error().message();
    EXPECT_EQ(made, style) << theme;
  }
}

TEST(OverlayKeys, AThemeComesFirstAndAMistakeChangesNothing) {
  OverlayStyle style;
  ASSERT_TRUE(apply_overlay_keys("color = \"#010203\"\ntheme = \"minimal\"\n", style));
  EXPECT_EQ(style.color, (Rgb{1, 2, 3}));
  EXPECT_FALSE(style.circle);
  const OverlayStyle before = style;
  for (const char* bad :
       {"theme = \"minimla\"", "color = \"red\"", "font_px = 7", "font_file = \"x\"",
        "backend = \"cpu\"", "styles = \"circle\"", "x = ", "a.b = 1"}) {
    const Status done = apply_overlay_keys(bad, style);
    EXPECT_FALSE(done) << bad;
    EXPECT_EQ(style, before);
  }
}

}  // namespace
}  // namespace sightline
