// SPDX-License-Identifier: Apache-2.0
#include "capture/v4l2/v4l2_nodes.hpp"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>

#include "device_tree.hpp"
#include "scripted_v4l2.hpp"
#include "support/matchers.hpp"

namespace sightline::capture {
namespace {

using test::DeviceTree;
using test::FailsWith;
using test::IsOk;

class Nodes : public testing::Test {
 protected:
  Nodes() {
    tree_.add(0, "Webcam", "1-2", "A0");
    tree_.add(1, "Webcam", "1-2", "A0", 1);  // metadata
    tree_.add(2, "Webcam", "1-3.1", "B0");
    tree_.add(10, "Frame grabber");
  }
  Result<V4l2Node> choose(const std::string& device) {
    return choose_v4l2_node(device, find_v4l2_nodes(tree_.places()), "left");
  }
  DeviceTree tree_;
};

TEST_F(Nodes, AreListedInOrderWithTheirIdentity) {
  const auto nodes = find_v4l2_nodes(tree_.places());
  ASSERT_EQ(nodes.size(), 4u);
  EXPECT_EQ(nodes[0].serial, "A0");
  EXPECT_EQ(nodes[0].usb_port, "1-2");
  EXPECT_EQ(nodes[0].model, "Maker Webcam");
  EXPECT_EQ(nodes[0].by_id, tree_.dev("v4l/by-id/usb-Maker_Webcam_A0-video-index0"));
  EXPECT_EQ(nodes[2].by_path, tree_.dev("v4l/by-path/pci-0000:00:01.0-usb-1-3.1-video-index0"));
  EXPECT_EQ(nodes[3].path, tree_.dev("video10"));
  EXPECT_EQ(nodes[3].serial, "");
}

TEST_F(Nodes, AreFoundByEveryName) {
  for (const std::string& name :
       {std::string("serial:B0"), std::string("usb:1-3.1"), std::string("card:Webcam,serial:B0"),
        tree_.dev("video2"), tree_.dev("v4l/by-id/usb-Maker_Webcam_B0-video-index0"),
        tree_.dev("v4l/by-path/pci-0000:00:01.0-usb-1-3.1-video-index0"),
        tree_.dev("video2") + ",serial:B0"}) {
    const auto node = choose(name);
    ASSERT_THAT(node, IsOk());
    EXPECT_EQ(node->path, tree_.dev("video2")) << name;
  }
  EXPECT_THAT(choose("card:Frame grabber"), IsOk());
}

TEST_F(Nodes, AbsentCameraIsUnavailableAndTheOthersAreNamed) {
  const auto node = choose("serial:Z9");
  ASSERT_THAT(node, FailsWith("no camera 'serial:Z9' is plugged in; there is: "));
  EXPECT_EQ(node.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(node, FailsWith("serial:A0, usb:1-2"));
}

TEST_F(Nodes, TwoThatFitAreRefused) { EXPECT_THAT(choose("card:Webcam"), FailsWith("fits both")); }

TEST_F(Nodes, AnotherCameraAtThePlaceIsAMismatch) {
  const auto node = choose("usb:1-2,serial:B0");
  EXPECT_THAT(node, FailsWith("identity mismatch"));
  EXPECT_EQ(node.error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(choose("usb:1-9,serial:A0").error().code, ErrorCode::kUnavailable);
}

TEST_F(Nodes, NonsenseIsRefused) {
  for (const char* name : {"", "video0", "serial:", "usb:", "port:1", "serial:A0,"}) {
    EXPECT_THAT(choose(name), FailsWith("names no V4L2 camera")) << name;
  }
}

TEST_F(Nodes, ListTellsFormatsAndWhatCannotBeOpened) {
  auto device = std::make_shared<test::ScriptedV4l2>();
  device->modes = {{V4L2_PIX_FMT_YUYV, 640, 480, {15, 30}}, {V4L2_PIX_FMT_MJPEG, 1280, 720, {30}}};
  const auto list = list_v4l2_in(tree_.places(), device);
  ASSERT_THAT(list, IsOk());
  ASSERT_EQ(list->size(), 4u);  // the script captures at the metadata node, too
  const DeviceInfo& first = list->front();
  EXPECT_EQ(first.id, tree_.dev("v4l/by-id/usb-Maker_Webcam_A0-video-index0"));
  EXPECT_EQ(first.where, tree_.dev("video0") + ", usb:1-2");
  ASSERT_EQ(first.formats.size(), 2u);
  EXPECT_EQ(first.formats[0].pixel_format, "YUYV");
  EXPECT_EQ(first.formats[0].rates_hz, (std::vector<double>{15, 30}));

  device->open_errno = EACCES;
  const auto refused = list_v4l2_in(tree_.places(), device);
  ASSERT_THAT(refused, IsOk());
  ASSERT_EQ(refused->size(), 3u);
  EXPECT_NE(refused->front().note.find("group `video`"), std::string::npos);
}

TEST(NoNodes, AnEmptyMachineHasAnEmptyList) {
  const auto list = list_v4l2_in({"/nonexistent/sys", "/nonexistent/dev"},
                                 std::make_shared<test::ScriptedV4l2>());
  ASSERT_THAT(list, IsOk());
  EXPECT_TRUE(list->empty());
}

}  // namespace
}  // namespace sightline::capture
