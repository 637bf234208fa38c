// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/axes/axis_source.hpp"

#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <vector>

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// Pan 12.5, tilt -3.25 degrees, zoom 1234, camera 7; the checksum worked out by hand.
std::vector<uint8_t> freed_packet() {
  return {0xD1, 7, 0x06, 0x40, 0x00, 0xFE, 0x60, 0x00, 0, 0, 0, 0, 0, 0,   0,
          0,    0, 0,    0,    0,    0x00, 0x04, 0xD2, 0, 0, 0, 0, 0, 0xEE};
}

TEST(Freed, APacketIsReadByteByByte) {
  int device = 0;
  const auto reading = parse_freed(freed_packet(), &device);
  ASSERT_TRUE(reading.has_value());
  EXPECT_NEAR(reading->pan, 12.5 * kDegree, 1e-9);
  EXPECT_NEAR(reading->tilt, -3.25 * kDegree, 1e-9);
  EXPECT_EQ(reading->zoom, 1234);
  EXPECT_EQ(device, 7);
}

TEST(Freed, AnyOtherByteIsRefused) {
  for (size_t i = 0; i < 29; ++i) {
    std::vector<uint8_t> packet = freed_packet();
    packet[i] ^= 0x10;
    EXPECT_FALSE(parse_freed(packet).has_value()) << i;
  }
  std::vector<uint8_t> packet = freed_packet();
  packet.push_back(0);
  EXPECT_FALSE(parse_freed(packet).has_value());
  packet.resize(28);
  EXPECT_FALSE(parse_freed(packet).has_value());
  EXPECT_FALSE(parse_freed({}).has_value());
}

TEST(Visca, PositionsAreSignedNumbersOfHalfBytes) {
  const std::array<uint8_t, 11> answer = {0x90, 0x50, 0, 1, 2, 3, 0xF, 0xF, 0xE, 0xD, 0xFF};
  const auto position = parse_visca_position(answer);
  ASSERT_TRUE(position.has_value());
  EXPECT_EQ(position->first, 0x0123);
  EXPECT_EQ(position->second, -19);
  for (const size_t i : {size_t{0}, size_t{1}, size_t{4}, size_t{10}}) {
    auto spoilt = answer;
    spoilt[i] = 0x77;
    EXPECT_FALSE(parse_visca_position(spoilt).has_value()) << i;
  }
  EXPECT_FALSE(parse_visca_position(std::span(answer).first(10)).has_value());
  const std::array<uint8_t, 7> zoom = {0x90, 0x50, 4, 0, 0, 1, 0xFF};
  EXPECT_EQ(parse_visca_zoom(zoom), 0x4001);
  EXPECT_FALSE(parse_visca_zoom(answer).has_value());
}

TEST(AxisSource, AddressesAreTakenApart) {
  const auto read = [](const char* text) { return parse_axis_source(text, "head"); };
  const auto port = read("freed:40000");
  ASSERT_TRUE(port.has_value());
  EXPECT_EQ(port->protocol, AxisProtocol::kFreed);
  EXPECT_EQ(port->host, "");
  EXPECT_EQ(port->port, 40000);
  EXPECT_EQ(port->device, -1);
  const auto one = read("freed:127.0.0.1:40001/7");
  ASSERT_TRUE(one.has_value());
  EXPECT_EQ(one->host, "127.0.0.1");
  EXPECT_EQ(one->port, 40001);
  EXPECT_EQ(one->device, 7);
  const auto camera = read("visca:[fe80::1]:1259");
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->host, "fe80::1");
  EXPECT_EQ(camera->port, 1259);
  EXPECT_EQ(read("visca:10.0.0.8")->port, 52381);
  const auto tracker = read("opentrackio:127.0.0.1:55555/12");
  ASSERT_TRUE(tracker.has_value());
  EXPECT_EQ(tracker->protocol, AxisProtocol::kOpenTrackIo);
  EXPECT_EQ(tracker->device, 12);
  const auto onvif = read("onvif:10.0.0.8:8080/Profile_1");
  ASSERT_TRUE(onvif.has_value());
  EXPECT_EQ(onvif->protocol, AxisProtocol::kOnvif);
  EXPECT_EQ(onvif->port, 8080);
  EXPECT_EQ(onvif->profile, "Profile_1");
  EXPECT_EQ(read("onvif:10.0.0.8")->port, 80);
  const auto line = read("visca:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0#3");
  ASSERT_TRUE(line.has_value());
  EXPECT_EQ(line->protocol, AxisProtocol::kViscaSerial);
  EXPECT_EQ(line->line, "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0");
  EXPECT_EQ(line->device, 3);
  EXPECT_EQ(read("visca:/dev/ttyUSB0")->device, 1);
  const auto control = read("v4l2:serial:A7,usb:1-2");
  ASSERT_TRUE(control.has_value());
  EXPECT_EQ(control->protocol, AxisProtocol::kV4l2);
  EXPECT_EQ(control->line, "serial:A7,usb:1-2");
  EXPECT_EQ(control->counts_per_degree, 3600);
  EXPECT_EQ(read("v4l2")->line, "");
  const auto group = read("opentrackio:239.135.1.3%eth0:55555/3");
  ASSERT_TRUE(group.has_value());
  EXPECT_EQ(group->host, "239.135.1.3");
  EXPECT_EQ(group->interface, "eth0");
  EXPECT_EQ(group->port, 55555);
  EXPECT_EQ(read("freed:[ff02::7%lo]:4000")->interface, "lo");
  EXPECT_EQ(read("freed:239.1.1.1:4000")->interface, "");
  for (const char* wrong : {"",
                            "opentrackio:127.0.0.1%lo:5555",
                            "freed:239.1.1.1%:5555",
                            "freed:239.1.1.1%a/b:5555",
                            "freed:239.1.1.1%sixteencharacters:5555",
                            "visca:239.1.1.1",
                            "onvif:[ff02::1%lo]",
                            "v4l2:",
                            "v4l2x",
                            "visca:/",
                            "visca:/dev/ttyS0#0",
                            "visca:/dev/ttyS0#8",
                            "visca:/dev/ttyS0#",
                            "freed:",
                            "freed:0",
                            "freed:70000",
                            "freed:x",
                            "freed:1/256",
                            "freed:1/",
                            "freed::4000",
                            "opentrackio:",
                            "opentrackio:5555/x",
                            "onvif:h",
                            "onvif:10.0.0.1/",
                            "onvif:10.0.0.1/a b",
                            "visca:",
                            "visca::52381",
                            "visca:1.2.3.4:0",
                            "visca:1.2.3.4:",
                            "visca:[::1",
                            "freed:127.0.0.1:",
                            "visca:head.example",
                            "visca:1.2.3"}) {
    EXPECT_FALSE(read(wrong).has_value()) << wrong;
  }
}

TEST(AxisSource, APortThatIsTakenIsNamed) {
  AxisSourceOptions options;
  options.protocol = AxisProtocol::kFreed;
  options.host = "127.0.0.1";
  options.port = 0;  // any that is free
  const auto first = open_axis_source(options, "head");
  ASSERT_TRUE(first.has_value());
  EXPECT_FALSE((*first)->next(std::chrono::milliseconds(1))->has_value());
  options.host = "203.0.113.1";  // not ours
  const auto second = open_axis_source(options, "head");
  ASSERT_FALSE(second.has_value());
  EXPECT_NE(second.error().message().find("head"), std::string::npos);
}

}  // namespace
}  // namespace sightline
