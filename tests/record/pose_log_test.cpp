// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/pose_log.hpp"

#include <gmock/gmock.h>

#include "record/media.hpp"

namespace sightline {
namespace {

using namespace test;
using testing::HasSubstr;

PoseLogRow tracking_row() {
  PoseLogRow row;
  row.time = time_from_ns(1'033'333'333);
  row.object = "cup";
  row.state = TrackState::kTracking;
  row.world_from_object = Rigid3(Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {0.1, -1e-12, 2.0});
  row.sigma_t_mm = 0.25;
  row.sigma_r_deg = 0.1;
  row.cameras = {"left", "side"};
  return row;
}

TEST(PoseLog, RowsAreFixed) {
  EXPECT_EQ(format_pose_row(tracking_row()),
            "1033333333,cup,tracking,0.1000000,0.0000000,2.0000000,0.500000000,-0.500000000,"
            "0.500000000,-0.500000000,0.2500,0.1000,left+side");
  PoseLogRow lost = tracking_row();
  lost.state = TrackState::kLost;
  lost.cameras.clear();
  EXPECT_EQ(format_pose_row(lost), "1033333333,cup,lost,,,,,,,,,,");
  PoseLogRow half_turn = tracking_row();
  half_turn.world_from_object->rotation = Eigen::Quaterniond(-0.0, -1, 0, 0);
  EXPECT_THAT(format_pose_row(half_turn), HasSubstr(",0.000000000,1.000000000,0.000000000,0.0"));
}

TEST(PoseLog, ComesBack) {
  TempFolder temp;
  PoseLogRow searching;
  searching.object = "cup";
  auto writer = *PoseLogWriter::create(temp / "poses.csv");
  ASSERT_TRUE(writer->append(tracking_row()));
  ASSERT_TRUE(writer->append(searching));
  ASSERT_TRUE(writer->close());
  const auto rows = read_pose_log(temp / "poses.csv");
  ASSERT_TRUE(rows) << rows.error().message();
  ASSERT_EQ(rows->size(), 2u);
  EXPECT_EQ(format_pose_row((*rows)[0]), format_pose_row(tracking_row()));
  EXPECT_EQ(format_pose_row((*rows)[1]), format_pose_row(searching));
  EXPECT_THAT((*rows)[0].cameras, testing::ElementsAre("left", "side"));
  EXPECT_FALSE((*rows)[1].world_from_object.has_value());
}

TEST(PoseLog, EmptyLogHasAHeader) {
  TempFolder temp;
  ASSERT_TRUE((*PoseLogWriter::create(temp / "p.csv"))->close());
  EXPECT_EQ(read_text(temp / "p.csv"), std::string(kPoseLogHeader) + "\n");
  EXPECT_TRUE(read_pose_log(temp / "p.csv")->empty());
}

TEST(PoseLog, FromAnEstimate) {
  PoseEstimate estimate;
  estimate.time = time_from_ns(5);
  estimate.state = TrackState::kTracking;
  estimate.covariance.topLeftCorner<6, 6>().diagonal() << 1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6;
  estimate.cameras = camera_bit(CameraId(0)) | camera_bit(CameraId(2));
  const std::vector<std::string> names = {"a", "b", "c"};
  const auto row = make_pose_log_row(estimate, "cup", names);
  EXPECT_NEAR(row.sigma_t_mm, 1.0, 1e-9);
  EXPECT_NEAR(row.sigma_r_deg, 0.572958, 1e-5);
  EXPECT_THAT(row.cameras, testing::ElementsAre("a", "c"));
  estimate.state = TrackState::kSearching;
  EXPECT_FALSE(make_pose_log_row(estimate, "cup", names).world_from_object.has_value());
}

std::string log_refusal(const std::string& rows) {
  const auto parsed = parse_pose_log(std::string(kPoseLogHeader) + "\n" + rows, "p.csv");
  return parsed ? "parsed" : parsed.error().message();
}

TEST(PoseLog, Refusals) {
  const std::string pose = "0,0,0,1,0,0,0,1,1";
  EXPECT_EQ(log_refusal("1,cup,tracking," + pose + ",a\n"), "parsed");
  EXPECT_EQ(log_refusal("1,cup,tracking," + pose + ",a\n1,cup,trac"), "parsed") << "cut off";
  EXPECT_FALSE(parse_pose_log("t_ns\n", "p.csv"));
  EXPECT_THAT(log_refusal("1,cup,tracking,0,0\n"), HasSubstr("p.csv:2: 5 columns"));
  EXPECT_THAT(log_refusal("x,cup,tracking," + pose + ",a\n"), HasSubstr("t_ns is 'x'"));
  EXPECT_THAT(log_refusal("1,,tracking," + pose + ",a\n"), HasSubstr("no name"));
  EXPECT_THAT(log_refusal("1,cup,dancing," + pose + ",a\n"), HasSubstr("state is 'dancing'"));
  EXPECT_THAT(log_refusal("1,cup,lost," + pose + ",\n"), HasSubstr("state lost has no pose"));
  EXPECT_THAT(log_refusal("1,cup,tracking,,,,,,,,,,\n"), HasSubstr("tx is ''"));
  EXPECT_THAT(log_refusal("1,cup,tracking,nan,0,0,1,0,0,0,1,1,\n"), HasSubstr("tx is 'nan'"));
  EXPECT_THAT(log_refusal("1,cup,tracking,0,0,0,1,1,0,0,1,1,\n"), HasSubstr("quaternion"));
}

TEST(PoseLog, RefusesNamesThatBreakTheFile) {
  TempFolder temp;
  auto writer = *PoseLogWriter::create(temp / "p.csv");
  PoseLogRow row = tracking_row();
  row.object = "a,b";
  EXPECT_FALSE(writer->append(row));
}

std::string truth_refusal(const std::string& rows) {
  const auto parsed = parse_truth("t_ns,object,tx,ty,tz,qw,qx,qy,qz\n" + rows, "t.csv");
  return parsed ? "parsed" : parsed.error().message();
}

TEST(Truth, Refusals) {
  EXPECT_EQ(truth_refusal("1,cup,0,0,0,1,0,0,0\n1,box,0,0,0,1,0,0,0\n"), "parsed");
  EXPECT_FALSE(parse_truth("", "t.csv"));
  EXPECT_THAT(truth_refusal("1,cup,0,0,0,1,0,0\n"), HasSubstr("t.csv:2: 8 columns"));
  EXPECT_THAT(truth_refusal("1,cup,0,0,0,1,0,0"), HasSubstr("t.csv:2")) << "no crash to forgive";
  EXPECT_THAT(truth_refusal("1,cup,inf,0,0,1,0,0,0\n"), HasSubstr("tx is 'inf'"));
  EXPECT_THAT(truth_refusal("1,cup,0,0,0,0,0,0,0\n"), HasSubstr("quaternion"));
  EXPECT_THAT(truth_refusal("2,cup,0,0,0,1,0,0,0\n2,cup,0,0,0,1,0,0,0\n"),
              HasSubstr("t.csv:3: times of object cup do not grow"));
}

std::string list_refusal(const std::string& rows) {
  const auto parsed = parse_image_list("image,camera,tx,ty,tz,qw,qx,qy,qz\n" + rows, "d/l.csv");
  return parsed ? "parsed" : parsed.error().message();
}

TEST(ImageList, NamesAreRelativeToTheList) {
  const auto rows = parse_image_list(
      "image,camera,tx,ty,tz,qw,qx,qy,qz\na.png,left,1,2,3,1,0,0,0\n/b.png,right,0,0,0,0,1,0,0\n",
      "d/l.csv");
  ASSERT_TRUE(rows) << rows.error().message();
  ASSERT_EQ(rows->size(), 2u);
  EXPECT_EQ((*rows)[0].image, "d/a.png");
  EXPECT_EQ((*rows)[0].camera, "left");
  EXPECT_EQ((*rows)[0].world_from_object.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ((*rows)[1].image, "/b.png");
  EXPECT_EQ((*rows)[1].line, 3u);
}

TEST(ImageList, Refusals) {
  EXPECT_FALSE(parse_image_list("", "l.csv"));
  EXPECT_THAT(list_refusal(""), HasSubstr("d/l.csv: lists no image"));
  EXPECT_THAT(list_refusal("a.png,left,0,0,0,1,0,0\n"), HasSubstr("d/l.csv:2: 8 columns"));
  EXPECT_THAT(list_refusal(",left,0,0,0,1,0,0,0\n"), HasSubstr("d/l.csv:2: names no image"));
  EXPECT_THAT(list_refusal("a.png,,0,0,0,1,0,0,0\n"), HasSubstr("d/l.csv:2: names no camera"));
  EXPECT_THAT(list_refusal("a.png,left,0,nan,0,1,0,0,0\n"), HasSubstr("ty is 'nan'"));
}

TEST(Truth, BenchIsRead) {
  const auto rows = read_truth(bench_recording() / "truth.csv");
  ASSERT_TRUE(rows) << rows.error().message();
  EXPECT_EQ(rows->size(), 90u);
}

}  // namespace
}  // namespace sightline
