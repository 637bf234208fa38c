// SPDX-License-Identifier: Apache-2.0
#include "capture/axes/onvif_messages.hpp"

#include <gtest/gtest.h>

#include <string>

namespace sightline::capture {
namespace {

const std::string kDegrees =
    "http://www.onvif.org/ver10/tptz/PanTiltSpaces/SphericalPositionSpaceDegrees";

std::string status(const std::string& x, const std::string& y, const std::string& space = "",
                   const std::string& move = "IDLE") {
  return "<e:Envelope xmlns:e='x'><e:Body><p:GetStatusResponse><p:PTZStatus><Position>"
         "<tt:PanTilt x='" +
         x + "' y='" + y + "' space='" + space +
         "'/><tt:Zoom x='0.25'/></Position><MoveStatus><tt:PanTilt>" + move +
         "</tt:PanTilt></MoveStatus></p:PTZStatus></p:GetStatusResponse></e:Body></e:Envelope>";
}

TEST(Onvif, AStatusIsReadWhateverItsPrefixes) {
  const auto one = parse_onvif_status(status("-0.5", "0.125"));
  ASSERT_TRUE(one.has_value());
  EXPECT_EQ(one->pan, -0.5);
  EXPECT_EQ(one->tilt, 0.125);
  EXPECT_EQ(one->zoom, 0.25);
  EXPECT_FALSE(one->degrees);
  EXPECT_FALSE(one->moving);
  const auto other = parse_onvif_status(status("-170.5", "20", kDegrees, "MOVING"));
  ASSERT_TRUE(other.has_value());
  EXPECT_EQ(other->pan, -170.5);
  EXPECT_TRUE(other->degrees);
  EXPECT_TRUE(other->moving);
}

TEST(Onvif, WhatIsNoStatusIsRefused) {
  for (const std::string& text :
       {std::string(), std::string("<"), status("", "0"), status("x", "0"), status("NaN", "0"),
        status("1.5", "0"), status("1 ", "0"), status("361", "0", kDegrees),
        std::string("<a><PanTilt x='0' y='0'/></a>"), status("0", "0").substr(0, 90)}) {
    EXPECT_FALSE(parse_onvif_status(text).has_value()) << text;
  }
  std::string deep;
  for (int i = 0; i < 50000; ++i) deep += "<a>";
  EXPECT_FALSE(parse_onvif_status(deep).has_value());
}

TEST(Onvif, ServicesAreFoundByPath) {
  const std::string text =
      "<a><Capabilities><Media><XAddr>http://10.0.0.1/onvif/media</XAddr></Media>"
      "<PTZ><XAddr>http://10.0.0.1:8000/onvif/ptz?x=1</XAddr></PTZ><Events><XAddr>nothing</XAddr>"
      "</Events></Capabilities></a>";
  EXPECT_EQ(parse_onvif_path(text, "Media"), "/onvif/media");
  EXPECT_EQ(parse_onvif_path(text, "PTZ"), "/onvif/ptz?x=1");
  EXPECT_EQ(parse_onvif_path(text, "Events"), "");
  EXPECT_EQ(parse_onvif_path(text, "Imaging"), "");
}

TEST(Onvif, TheProfileHasAHead) {
  const std::string text =
      "<a><GetProfilesResponse><Profiles token='one'/><Profiles token='two'><PTZConfiguration/>"
      "</Profiles><Profiles token='three'><PTZConfiguration/></Profiles></GetProfilesResponse></a>";
  EXPECT_EQ(parse_onvif_profile(text, ""), "two");
  EXPECT_EQ(parse_onvif_profile(text, "three"), "three");
  EXPECT_EQ(parse_onvif_profile(text, "one"), "");
  EXPECT_EQ(parse_onvif_profile(text, "four"), "");
}

TEST(Onvif, ANodeSaysHowItsHeadIsTurned) {
  const std::string profiles =
      "<a><GetProfilesResponse><Profiles token='one'><PTZConfiguration token='p'><NodeToken>n1"
      "</NodeToken></PTZConfiguration></Profiles><Profiles "
      "token='two'><PTZConfiguration/></Profiles>"
      "</GetProfilesResponse></a>";
  EXPECT_EQ(parse_onvif_node(profiles, "one"), "n1");
  EXPECT_EQ(parse_onvif_node(profiles, "two"), "");
  EXPECT_EQ(parse_onvif_node(profiles, "three"), "");
  const std::string nodes =
      "<a><GetNodesResponse><PTZNode token='n0'><SupportedPTZSpaces><AbsolutePanTiltPositionSpace>"
      "<URI>x</URI></AbsolutePanTiltPositionSpace></SupportedPTZSpaces></PTZNode><PTZNode "
      "token='n1'>"
      "<SupportedPTZSpaces><RelativePanTiltTranslationSpace/><ContinuousPanTiltVelocitySpace/>"
      "<ContinuousZoomVelocitySpace/></SupportedPTZSpaces></PTZNode></GetNodesResponse></a>";
  const auto own = parse_onvif_moves(nodes, "n1");
  ASSERT_TRUE(own.has_value());
  EXPECT_FALSE(own->absolute);
  EXPECT_TRUE(own->continuous && own->relative);
  const auto first = parse_onvif_moves(nodes, "");
  ASSERT_TRUE(first.has_value());
  EXPECT_TRUE(first->absolute);
  EXPECT_FALSE(first->continuous || first->relative);
  EXPECT_FALSE(parse_onvif_moves("<a><GetNodesResponse/></a>", "").has_value());
  EXPECT_FALSE(parse_onvif_moves("", "").has_value());
}

TEST(Onvif, MovesAreWrittenAsOrdered) {
  const std::string move = format_onvif_continuous("p", {0.5, -1});
  EXPECT_NE(move.find("<Velocity><t:PanTilt x=\"0.5000\" y=\"-1.0000\"/></Velocity>"),
            std::string::npos);
  EXPECT_NE(move.find("<Timeout>PT1S</Timeout>"), std::string::npos);
  const std::string way = format_onvif_relative("p", {0.01, -0.02}, false, {1, 0.5});
  EXPECT_NE(way.find("<Translation><t:PanTilt x=\"0.010000\" y=\"-0.020000\" space=\"http"),
            std::string::npos);
  EXPECT_NE(format_onvif_stop("p").find("<PanTilt>true</PanTilt>"), std::string::npos);
}

TEST(Onvif, AFaultSaysWhy) {
  EXPECT_EQ(parse_onvif_fault("<a><Fault><Reason><Text>not now</Text></Reason></Fault></a>"),
            "not now");
  EXPECT_EQ(parse_onvif_fault("<a><Fault/></a>"), "it does not say why");
  EXPECT_EQ(parse_onvif_fault(status("0", "0")), "");
}

TEST(Onvif, WhatIsSentIsEscaped) {
  const std::string text = format_onvif_move("a<b&'\"", {0.5, -0.25}, false, {1, 0.01});
  EXPECT_NE(text.find("<ProfileToken>a&#60;b&#38;&#39;&#34;</ProfileToken>"), std::string::npos);
  EXPECT_NE(text.find("<t:PanTilt x=\"0.500000\" y=\"-0.250000\""), std::string::npos);
  EXPECT_NE(text.find("<t:PanTilt x=\"1.0000\" y=\"0.0100\"/>"), std::string::npos);
}

}  // namespace
}  // namespace sightline::capture
