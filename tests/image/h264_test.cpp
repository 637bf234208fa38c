// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/h264.hpp"

#include <gmock/gmock.h>

namespace sightline {
namespace {

using Bytes = std::vector<uint8_t>;
using testing::ElementsAre;

std::vector<NalUnit> units_of(std::span<const uint8_t> stream) {
  std::vector<NalUnit> units;
  NalReader reader(stream);
  while (const auto unit = reader.next()) units.push_back(*unit);
  return units;
}

TEST(NalReader, FindsUnitsBehindStartCodesOfAnyLength) {
  const Bytes stream = {7, 0, 0, 0, 1, 0x67, 1, 2, 0, 0, 1, 0x68, 3, 0, 0, 0, 0, 1, 0x65, 9, 0, 0};
  const auto units = units_of(stream);
  ASSERT_EQ(units.size(), 3u);
  EXPECT_EQ(units[0].begin, 1u);
  EXPECT_EQ(units[0].type, NalType::kSequenceParameterSet);
  EXPECT_FALSE(units[0].is_slice());
  EXPECT_THAT(units[0].body, ElementsAre(0x67, 1, 2));
  EXPECT_EQ(units[1].begin, 8u);
  EXPECT_THAT(units[1].body, ElementsAre(0x68, 3));
  EXPECT_EQ(units[2].begin, 13u);
  EXPECT_EQ(units[2].type, NalType::kIdrSlice);
  EXPECT_TRUE(units[2].is_slice());
  EXPECT_THAT(units[2].body, ElementsAre(0x65, 9));
}

TEST(NalReader, SkipsUnitsWithoutAHeader) {
  EXPECT_TRUE(units_of({}).empty());
  EXPECT_TRUE(units_of(Bytes{0, 0, 1}).empty());
  EXPECT_TRUE(units_of(Bytes{1, 2, 3, 4}).empty());
  const Bytes stream = {0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0x41};
  const auto units = units_of(stream);
  ASSERT_EQ(units.size(), 1u);
  EXPECT_EQ(units[0].type, NalType::kSlice);
}

TEST(AnnexB, ParameterSetsAreThoseOfACompletePair) {
  const Bytes unit = {0, 0, 0, 1, 0x67, 1, 2, 0, 0, 1, 0x68, 3, 0, 0, 0, 1, 0x65, 9};
  EXPECT_THAT(annex_b_parameter_sets(unit),
              ElementsAre(0, 0, 0, 1, 0x67, 1, 2, 0, 0, 0, 1, 0x68, 3));
  EXPECT_TRUE(annex_b_parameter_sets(std::span(unit).first(8)).empty());
  EXPECT_TRUE(annex_b_parameter_sets({}).empty());
}

TEST(AnnexB, KnowsAnIdrSlice) {
  EXPECT_TRUE(annex_b_has_idr(Bytes{0, 0, 1, 0x09, 0x10, 0, 0, 1, 0x65, 1}));
  EXPECT_FALSE(annex_b_has_idr(Bytes{0, 0, 1, 0x67, 1, 0, 0, 1, 0x41, 1}));
  EXPECT_FALSE(annex_b_has_idr({}));
}

TEST(AnnexB, KnowsWhereADecoderCanStart) {
  EXPECT_TRUE(annex_b_can_start_decoding(Bytes{0, 0, 0, 1, 0x67, 1, 2, 3}));
  EXPECT_TRUE(annex_b_can_start_decoding(Bytes{0, 0, 1, 0x09, 0x10, 0, 0, 1, 0x65, 1}));
  EXPECT_FALSE(annex_b_can_start_decoding(Bytes{0, 0, 1, 0x41, 0, 0, 1, 0x65}));
  EXPECT_FALSE(annex_b_can_start_decoding(Bytes{0, 0, 1}));
  EXPECT_FALSE(annex_b_can_start_decoding({}));
}

TEST(EmulationPrevention, NoStartCodeRemainsAndTheBytesComeBack) {
  const Bytes raw = {0, 0, 0, 0, 0, 1, 7, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0, 0};
  Bytes escaped;
  append_escaped(raw, escaped);
  EXPECT_THAT(escaped,
              ElementsAre(0, 0, 3, 0, 0, 3, 0, 1, 7, 0, 0, 3, 2, 0, 0, 3, 3, 0, 0, 4, 0, 0, 3));
  EXPECT_EQ(unescaped(escaped), raw);
}

}  // namespace
}  // namespace sightline
