// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/sei.hpp"

#include <gtest/gtest.h>

#include <random>

namespace sightline {
namespace {

using Bytes = std::vector<uint8_t>;

SeiMessage example() {
  SeiMessage message;
  message.camera = "front-left";
  message.epoch = 3;
  message.sequence = 0x0123456789abcdefULL;
  message.capture = time_from_ns(987'654'321'012);
  message.capture_utc_ns = 1'700'000'000'123'456'789;
  message.capture_error = std::chrono::microseconds(250);
  SeiObject seen;
  seen.id = ObjectId(2);
  seen.name = "gripper";
  seen.state = TrackState::kDegraded;
  seen.source = PoseSource::kInterpolated;
  seen.world_from_object = Rigid3(Eigen::Quaterniond(0.3, -0.4, 0.5, 0.6), {0.1, -2.5, 1e-9});
  seen.sigma_translation = 0.0012f;
  seen.sigma_rotation = 0.02f;
  SeiObject lost;
  lost.id = ObjectId(7);
  lost.name = "Kiste-ä";
  lost.state = TrackState::kLost;
  message.objects = {seen, lost};
  return message;
}

void expect_equal(const SeiMessage& a, const SeiMessage& b) {
  EXPECT_EQ(a.camera, b.camera);
  EXPECT_EQ(a.epoch, b.epoch);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.capture, b.capture);
  EXPECT_EQ(a.capture_utc_ns, b.capture_utc_ns);
  EXPECT_EQ(a.capture_error, b.capture_error);
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (size_t i = 0; i < a.objects.size(); ++i) {
    const SeiObject &x = a.objects[i], &y = b.objects[i];
    EXPECT_EQ(x.id, y.id);
    EXPECT_EQ(x.name, y.name);
    EXPECT_EQ(x.state, y.state);
    EXPECT_EQ(x.source, y.source);
    EXPECT_EQ(x.sigma_translation, y.sigma_translation);
    EXPECT_EQ(x.sigma_rotation, y.sigma_rotation);
    EXPECT_EQ(x.world_from_object.rotation.coeffs(), y.world_from_object.rotation.coeffs());
    EXPECT_EQ(x.world_from_object.translation, y.world_from_object.translation);
  }
}

/// No 00 00 followed by 00 .. 02 behind the start code, and no zero at the end.
void expect_no_start_code_inside(const Bytes& nal) {
  for (size_t i = 4; i + 2 < nal.size(); ++i) {
    EXPECT_FALSE(nal[i] == 0 && nal[i + 1] == 0 && nal[i + 2] <= 2) << "at " << i;
  }
  EXPECT_NE(nal.back(), 0);
}

/// Delimiter, SPS, PPS, IDR slice; as encoders write them.
Bytes access_unit() {
  return {0, 0, 0, 1,    0x09, 0x10,                          // delimiter
          0, 0, 0, 1,    0x67, 0x42, 0xc0, 0x1f, 0x8c, 0x68,  // SPS
          0, 0, 0, 1,    0x68, 0xce, 0x3c, 0x80,              // PPS
          0, 0, 1, 0x65, 0x88, 0x84, 0x00, 0x33, 0xff};
}

TEST(Sei, RoundTripIsExact) {
  const SeiMessage message = example();
  const Bytes nal = make_sei_nal(message);
  expect_no_start_code_inside(nal);
  const auto parsed = parse_sei(insert_sei(access_unit(), nal));
  ASSERT_TRUE(parsed) << parsed.error().message();
  expect_equal(message, *parsed);
}

TEST(Sei, AllZeroValuesSurviveEmulationPrevention) {
  SeiMessage message;
  message.camera = std::string(40, '\0');
  SeiObject object;
  object.source = PoseSource::kEstimated;
  object.name = std::string(30, '\1');
  message.objects.assign(20, object);
  const Bytes nal = make_sei_nal(message);
  expect_no_start_code_inside(nal);
  const auto parsed = parse_sei(nal);
  ASSERT_TRUE(parsed) << parsed.error().message();
  expect_equal(message, *parsed);
}

TEST(Sei, RandomMessagesRoundTrip) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> byte(0, 3);  // many zeros and near-zeros
  for (int round = 0; round < 200; ++round) {
    SeiMessage message = example();
    for (char& c : message.camera) c = static_cast<char>(byte(random));
    message.sequence = static_cast<uint64_t>(byte(random)) << (8 * byte(random));
    message.objects.resize(static_cast<size_t>(byte(random)));
    for (SeiObject& object : message.objects)
      object.name.assign(17, static_cast<char>(byte(random)));
    const Bytes nal = make_sei_nal(message);
    expect_no_start_code_inside(nal);
    const auto parsed = parse_sei(nal);
    ASSERT_TRUE(parsed) << parsed.error().message();
    expect_equal(message, *parsed);
  }
}

TEST(Sei, IsPutBehindParameterSetsAndBeforeTheSlice) {
  const Bytes unit = access_unit();
  const Bytes nal = make_sei_nal(example());
  const Bytes joined = insert_sei(unit, nal);
  const ptrdiff_t slice = 24;
  Bytes expected(unit.begin(), unit.begin() + slice);
  expected.insert(expected.end(), nal.begin(), nal.end());
  expected.insert(expected.end(), unit.begin() + slice, unit.end());
  EXPECT_EQ(joined, expected);
}

TEST(Sei, AnAccessUnitWithoutSliceGetsItAtTheEnd) {
  const Bytes nal = make_sei_nal(example());
  EXPECT_EQ(insert_sei({}, nal), nal);
}

TEST(Sei, OthersMessagesAreSkipped) {
  Bytes unit = {0, 0, 1, 0x06, 5, 20};  // user data with another UUID
  unit.insert(unit.end(), 20, 0x41);
  unit.push_back(0x80);
  EXPECT_EQ(parse_sei(unit).error().code, ErrorCode::kNotFound);
  const Bytes nal = make_sei_nal(example());
  unit.insert(unit.end(), nal.begin(), nal.end());
  const auto parsed = parse_sei(unit);
  ASSERT_TRUE(parsed) << parsed.error().message();
  expect_equal(example(), *parsed);
}

TEST(Sei, OursIsFoundBehindAnotherMessageOfTheSameUnit) {
  const Bytes ours = make_sei_nal(example());
  Bytes unit = {0, 0, 0, 1, 0x06, 1, 2, 0x41, 0x42};  // picture timing, two bytes
  unit.insert(unit.end(), ours.begin() + 5, ours.end());
  EXPECT_TRUE(parse_sei(unit));
}

TEST(Sei, AbsentInAPlainAccessUnit) {
  EXPECT_EQ(parse_sei(access_unit()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(parse_sei({}).error().code, ErrorCode::kNotFound);
}

TEST(Sei, EveryTruncationIsAnError) {
  const Bytes nal = make_sei_nal(example());
  // Without its last byte only the stop bit is missing: the message itself is whole.
  for (size_t length = 0; length + 1 < nal.size(); ++length) {
    EXPECT_FALSE(parse_sei(std::span(nal).first(length))) << length;
  }
}

TEST(Sei, NewerFieldsBehindKnownOnesAreSkipped) {
  // A later sender appends to the header: length grows by 2, two bytes follow the camera name.
  SeiMessage message = example();
  message.objects.clear();
  message.camera = "c";
  Bytes nal = make_sei_nal(message);
  ASSERT_EQ(nal.back(), 0x80);
  nal.pop_back();
  nal.insert(nal.end(), {0x55, 0x66, 0x80});
  nal[6] = static_cast<uint8_t>(nal[6] + 2);    // SEI payload size
  nal[24] = static_cast<uint8_t>(nal[24] + 2);  // header record length
  const auto parsed = parse_sei(nal);
  ASSERT_TRUE(parsed) << parsed.error().message();
  expect_equal(message, *parsed);
}

TEST(Sei, APoseThatIsNoRigidTransformIsRefused) {
  for (const double bad : {std::nan(""), 2.0}) {
    SeiMessage message = example();
    message.objects[0].world_from_object.rotation.w() = bad;
    EXPECT_EQ(parse_sei(make_sei_nal(message)).error().code, ErrorCode::kDamaged);
  }
  SeiMessage message = example();
  message.objects[0].world_from_object.translation.y() = std::numeric_limits<double>::infinity();
  EXPECT_EQ(parse_sei(make_sei_nal(message)).error().code, ErrorCode::kDamaged);
}

TEST(Sei, LongNamesAreCutAtACharacter) {
  SeiMessage message = example();
  message.camera.assign(254, 'x');
  message.camera += "ä";  // 256 bytes; 255 would split the last character
  const auto parsed = parse_sei(make_sei_nal(message));
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->camera, std::string(254, 'x'));
}

TEST(Sei, IsBuiltFromAnImage) {
  AnnotatedImage image;
  image.frame.epoch = 2;
  image.frame.sequence = 99;
  image.frame.capture = MonotonicClock::now();
  PoseAt pose;
  pose.source = PoseSource::kPredicted;
  pose.estimate.object = ObjectId(4);
  pose.estimate.state = TrackState::kCoasting;
  pose.estimate.covariance.diagonal().setConstant(4e-6);
  image.poses = {pose, PoseAt{}};
  const std::vector<NamedObject> names = {{ObjectId(4), "cup"}};
  const SeiMessage message = sei_message_of(image, "top", names);
  EXPECT_EQ(message.camera, "top");
  EXPECT_EQ(message.sequence, 99u);
  ASSERT_EQ(message.objects.size(), 2u);
  EXPECT_EQ(message.objects[0].name, "cup");
  EXPECT_NEAR(message.objects[0].sigma_translation, 2e-3, 1e-6);
  EXPECT_EQ(message.objects[1].name, "");
  EXPECT_EQ(message.objects[1].source, PoseSource::kNone);
  EXPECT_NEAR(static_cast<double>(message.capture_utc_ns - utc_ns_of(image.frame.capture)), 0, 1e9);
}

}  // namespace
}  // namespace sightline
