// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/cell_draft.hpp"

#include <gmock/gmock.h>

namespace sightline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kSection = "[cell]\nrole = \"cameras\"\n";

CellDraft draft_of(const std::string& text) {
  auto draft = read_cell_draft(text, "rig.toml");
  EXPECT_TRUE(draft) << draft.error().message();
  return draft ? *draft : CellDraft{};
}

TEST(CellDraft, ReadsWhoHasWhat) {
  const CellDraft draft = draft_of(
      "[[camera]]\nname = \"left\"\nhost = \"a\"\n[[camera]]\nname = \"right\"\n"
      "[cell]\nname = \"hall\"\nhost = \"f\"\nbroker = \"10.0.0.1\"\nclock_limit = 0.02\n");
  ASSERT_EQ(draft.cameras.size(), 2U);
  EXPECT_EQ(draft.cameras[0].host, "a");
  EXPECT_EQ(draft.cameras[1].host, "");
  EXPECT_EQ(draft.cameras[1].line, 4U);
  EXPECT_EQ(draft.broker, "10.0.0.1");
  EXPECT_TRUE(draft.fuses);  // as a daemon takes it
  EXPECT_EQ(draft.kept, "clock_limit = 0.02\n");
}

TEST(CellDraft, ReplacesItsSectionAndNothingElse) {
  const std::string before = "name = \"x\"\n\n# about the cell\n",
                    after = "# about the page\n[http]\nport = 0\n";
  const std::string text = before + "[cell]  # old\nrole = \"both\"\n# of it\nport = 3\n\n" + after;
  const CellDraft draft = draft_of(text);
  EXPECT_EQ(with_cell(text, draft, {}, kSection), before + kSection + "\n\n" + after);
}

TEST(CellDraft, TheSectionMayBeLastOrMissing) {
  const std::string last = "name = \"x\"\n[cell]\nrole = \"both\"\n";
  EXPECT_EQ(with_cell(last, draft_of(last), {}, kSection),
            std::string("name = \"x\"\n") + kSection + "\n");
  const std::string none = "name = \"x\"\n";
  EXPECT_EQ(with_cell(none, draft_of(none), {}, kSection), none + "\n" + kSection);
}

TEST(CellDraft, CamerasWithoutAHostAreGivenOne) {
  const std::string text =
      "[[camera]]  # one\nname = \"left\"\n[[camera]]\nname = \"right\"\nhost = \"b\"\n";
  const std::string written =
      with_cell(text, draft_of(text), {{"left", "a"}, {"right", "c"}}, kSection);
  EXPECT_THAT(written, HasSubstr("[[camera]]  # one\nhost = \"a\"\nname = \"left\"\n[[camera]]\n"
                                 "name = \"right\"\nhost = \"b\"\n"));
}

TEST(CellDraft, ASectionThatCannotBeReplacedIsRefused) {
  for (const char* text :
       {"cell = { role = \"both\" }\n", "cell.role = \"both\"\n", "cell = 3\n",
        "camera = [{ name = \"left\" }]\n", "[[camera]]\nsource = \"x\"\n", "["}) {
    const auto draft = read_cell_draft(text, "rig.toml");
    ASSERT_FALSE(draft) << text;
    EXPECT_EQ(draft.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(draft.error().where, HasSubstr("rig.toml:"));
  }
}

}  // namespace
}  // namespace sightline
