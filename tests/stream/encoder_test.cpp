// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/encoder.hpp"

#include <gtest/gtest.h>

#include <latch>
#include <mutex>

#include "sightline/stream/sei.hpp"
#include "stream_tools.hpp"

namespace sightline {
namespace {

constexpr int kWidth = 320, kHeight = 192;
const std::vector<NamedObject> kNames = {{ObjectId(0), "box"}};

class Packets {
 public:
  VideoEncoder::OnPacket sink() {
    return [this](EncodedPacket packet) {
      std::lock_guard lock(mutex_);
      packets_.push_back(std::move(packet));
    };
  }
  size_t size() const {
    std::lock_guard lock(mutex_);
    return packets_.size();
  }
  EncodedPacket at(size_t i) const {
    std::lock_guard lock(mutex_);
    return packets_.at(i);
  }

 private:
  mutable std::mutex mutex_;
  std::vector<EncodedPacket> packets_;
};

EncoderOptions options() {
  EncoderOptions result;
  result.width = kWidth;
  result.height = kHeight;
  result.bitrate_kbps = 2000;
  return result;
}

AnnotatedImage image(int number) {
  return annotated(synthetic_image(kWidth, kHeight, number), static_cast<uint64_t>(number),
                   time_from_ns(1'000'000'000 + number * 33'000'000LL));
}

/// First byte of profile_idc and of the constraint flags in the access unit's SPS; 0 if none.
std::pair<int, int> profile_of(const std::vector<uint8_t>& unit) {
  for (size_t i = 0; i + 5 < unit.size(); ++i) {
    if (unit[i] == 0 && unit[i + 1] == 0 && unit[i + 2] == 1 && (unit[i + 3] & 0x1f) == 7) {
      return {unit[i + 4], unit[i + 5]};
    }
  }
  return {0, 0};
}

TEST(BitrateDefault, FollowsTheSize) {
  EXPECT_EQ(default_bitrate_kbps(1280, 720), 4000);
  EXPECT_EQ(default_bitrate_kbps(1920, 1080), 8000);
  EXPECT_LT(default_bitrate_kbps(640, 480), 2500);
  EXPECT_GE(default_bitrate_kbps(16, 16), 100);
}

class EveryEncoder : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (!h264_encoder_works(GetParam())) GTEST_SKIP() << GetParam() << " is not usable here";
  }
};

TEST_P(EveryEncoder, GivesOneDecodablePacketForEachImageWithoutDelay) {
  EncoderOptions wanted = options();
  wanted.prefer = {GetParam()};
  Packets packets;
  auto encoder = VideoEncoder::create(wanted, "cam", packets.sink());
  ASSERT_TRUE(encoder) << encoder.error().message();
  EXPECT_EQ((*encoder)->encoder_name(), GetParam());
  H264Decoder decoder;
  for (int n = 0; n < 30; ++n) {
    const AnnotatedImage sent = image(n);
    (*encoder)->push(sent, kNames);
    // The packet comes before the next image: no look-ahead, no frame threads.
    ASSERT_TRUE(eventually([&] { return packets.size() == static_cast<size_t>(n) + 1; })) << n;
    const EncodedPacket packet = packets.at(static_cast<size_t>(n));
    EXPECT_EQ(packet.sequence, static_cast<uint64_t>(n));
    EXPECT_EQ(packet.capture, sent.frame.capture);
    EXPECT_EQ(packet.camera, sent.frame.camera);
    EXPECT_EQ(packet.keyframe, n == 0);
    EXPECT_LT(difference(decoder.decode(*packet.bytes), *sent.image), 6.0) << n;

    const auto sei = parse_sei(*packet.bytes);
    ASSERT_TRUE(sei) << sei.error().message();
    EXPECT_EQ(sei->camera, "cam");
    EXPECT_EQ(sei->sequence, static_cast<uint64_t>(n));
    EXPECT_EQ(sei->capture, sent.frame.capture);
    ASSERT_EQ(sei->objects.size(), 1u);
    EXPECT_EQ(sei->objects[0].name, "box");
    EXPECT_EQ(sei->objects[0].world_from_object.translation.x(), 0.001 * n);
  }
  const auto [profile, constraints] = profile_of(*packets.at(0).bytes);
  EXPECT_EQ(profile, 66);                  // baseline
  EXPECT_TRUE((constraints & 0x40) != 0);  // constrained
  const EncoderCounts counts = (*encoder)->counts();
  EXPECT_EQ(counts.pushed, 30u);
  EXPECT_EQ(counts.encoded, 30u);
  EXPECT_EQ(counts.dropped, 0u);
}

TEST_P(EveryEncoder, MakesAKeyFrameOnRequest) {
  EncoderOptions wanted = options();
  wanted.prefer = {GetParam()};
  wanted.keyframe_interval = 1000;
  wanted.keyframe_request_spacing = std::chrono::hours(1);
  Packets packets;
  auto encoder = VideoEncoder::create(wanted, "cam", packets.sink());
  ASSERT_TRUE(encoder) << encoder.error().message();
  for (int n = 0; n < 20; ++n) {
    // The first request is granted; the second comes too early.
    if (n == 5 || n == 6 || n == 10) (*encoder)->request_keyframe();
    ASSERT_TRUE((*encoder)->push_and_wait(image(n), kNames, std::chrono::seconds(20)));
  }
  ASSERT_TRUE((*encoder)->finish(std::chrono::seconds(20)));
  ASSERT_EQ(packets.size(), 20u);
  for (size_t n = 0; n < 20; ++n) EXPECT_EQ(packets.at(n).keyframe, n == 0 || n == 5) << n;
  // Parameter sets come again with it, so that a viewer can start there.
  EXPECT_EQ(profile_of(*packets.at(5).bytes).first, 66);
}

INSTANTIATE_TEST_SUITE_P(Encoders, EveryEncoder,
                         testing::ValuesIn(known_h264_encoders().begin(),
                                           known_h264_encoders().end()));

TEST(VideoEncoder, ASlowConsumerCostsOldImagesNotTime) {
  std::latch release(1);
  Packets packets;
  auto sink = packets.sink();
  auto encoder = VideoEncoder::create(options(), "cam", [&](EncodedPacket packet) {
    release.wait();
    sink(std::move(packet));
  });
  ASSERT_TRUE(encoder) << encoder.error().message();
  for (int n = 0; n < 40; ++n) (*encoder)->push(image(n), kNames);  // returns although stuck
  release.count_down();
  ASSERT_TRUE((*encoder)->finish(std::chrono::seconds(20)));
  const EncoderCounts counts = (*encoder)->counts();
  EXPECT_EQ(counts.pushed, 40u);
  EXPECT_EQ(counts.encoded + counts.dropped, 40u);
  EXPECT_GT(counts.dropped, 0u);
  ASSERT_GT(packets.size(), 0u);
  EXPECT_EQ(packets.at(packets.size() - 1).sequence, 39u);  // the newest wins
}

TEST(VideoEncoder, GivesImagesBack) {
  std::weak_ptr<const Image> seen;
  Packets packets;
  {
    auto encoder = VideoEncoder::create(options(), "cam", packets.sink());
    ASSERT_TRUE(encoder) << encoder.error().message();
    for (int n = 0; n < 5; ++n) {
      const AnnotatedImage sent = image(n);
      seen = sent.image;
      (*encoder)->push(sent, kNames);
    }
  }
  EXPECT_TRUE(seen.expired());
}

TEST(VideoEncoder, CanBeDestroyedAtAnyMoment) {
  for (int images = 0; images < 6; ++images) {
    Packets packets;
    auto encoder = VideoEncoder::create(options(), "cam", packets.sink());
    ASSERT_TRUE(encoder) << encoder.error().message();
    for (int n = 0; n < images; ++n) (*encoder)->push(image(n), kNames);
  }
}

TEST(VideoEncoder, DropsImagesOfAnotherSizeAndAfterTheEnd) {
  Packets packets;
  auto encoder = VideoEncoder::create(options(), "cam", packets.sink());
  ASSERT_TRUE(encoder) << encoder.error().message();
  (*encoder)->push(annotated(synthetic_image(64, 64, 0), 0, Time{}), kNames);
  (*encoder)->push(AnnotatedImage{}, kNames);
  EXPECT_EQ((*encoder)->counts().dropped, 2u);
  ASSERT_TRUE((*encoder)->finish(std::chrono::seconds(20)));
  (*encoder)->push(image(0), kNames);
  EXPECT_EQ((*encoder)->counts().dropped, 3u);
  EXPECT_EQ(packets.size(), 0u);
  EXPECT_EQ((*encoder)->push_and_wait(image(0), kNames, std::chrono::seconds(1)).error().code,
            ErrorCode::kInvalidInput);
}

TEST(VideoEncoder, RefusesSizesThatCannotBeEncoded) {
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{321, 240}, {320, 241}, {0, 0}, {-2, 240}, {20000, 240}}) {
    EncoderOptions wanted = options();
    wanted.width = width;
    wanted.height = height;
    const auto encoder = VideoEncoder::create(wanted, "left", {});
    ASSERT_FALSE(encoder);
    EXPECT_EQ(encoder.error().code, ErrorCode::kInvalidInput);
    EXPECT_EQ(encoder.error().where, "left");
  }
}

TEST(VideoEncoder, SaysWhatToInstallWhenNoEncoderWorks) {
  EncoderOptions wanted = options();
  wanted.prefer = {"nosuchh264enc", "fakesink"};
  const auto encoder = VideoEncoder::create(wanted, "left", {});
  ASSERT_FALSE(encoder);
  EXPECT_EQ(encoder.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(encoder.error().text.find("gstreamer1.0-plugins-ugly"), std::string::npos);
  EXPECT_NE(encoder.error().text.find("nosuchh264enc"), std::string::npos);
}

}  // namespace
}  // namespace sightline
