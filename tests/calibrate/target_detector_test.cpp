// SPDX-License-Identifier: Apache-2.0
// Targets as they are printed, seen through a lens, found again.
#include "sightline/observe/fiducial/target_detector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../support/matchers.hpp"
#include "sightline/calibrate/target_pdf.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/fiducial/target_print.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;

CalibrationTarget charuco(CharucoLayout layout = CharucoLayout::kDarkFirst) {
  CalibrationTarget t;
  t.kind = TargetKind::kCharuco;
  t.columns = 8;
  t.rows = 6;
  t.square = 0.06;
  t.marker = 0.045;
  t.dictionary = "5X5_100";
  t.layout = layout;
  return t;
}

CalibrationTarget tag_grid() {
  CalibrationTarget t;
  t.kind = TargetKind::kTagGrid;
  t.columns = 4;
  t.rows = 3;
  t.marker = 0.08;
  t.gap = 0.024;
  t.dictionary = "tag36h11";
  return t;
}

CalibrationTarget chessboard() {
  CalibrationTarget t;
  t.kind = TargetKind::kChessboard;
  t.columns = 10;
  t.rows = 7;
  t.square = 0.04;
  return t;
}

const CameraModel kCamera = *CameraModel::create({.width = 800,
                                                  .height = 600,
                                                  .fx = 700,
                                                  .fy = 702,
                                                  .cx = 402.3,
                                                  .cy = 297.1,
                                                  .distortion = {-0.15, 0.07, 0.0005, -0.0003}},
                                                 "test");
const Rigid3 kPose(Eigen::Quaterniond(0.97, 0.16, -0.14, 0.1), {-0.2, -0.15, 0.75});

/// The print through the lens, nine rays to a pixel, dark 40 and bright 200.
FramePtr photograph(const CalibrationTarget& target, bool mirrored = false) {
  const auto dark = target_print(target);
  EXPECT_THAT(dark, IsOk());
  const double cell = 0.0005, border = 0.04;
  const Eigen::Vector2d size = target.size();
  const int columns = static_cast<int>((size.x() + 2 * border) / cell);
  const int rows = static_cast<int>((size.y() + 2 * border) / cell);
  std::vector<uint8_t> print(static_cast<size_t>(columns * rows), 200);
  for (const PrintedRect& r : *dark) {
    const auto at = [&](double meters) {
      return static_cast<int>(std::lround((meters + border) / cell));
    };
    for (int y = at(r.top); y < at(r.top + r.height); ++y) {
      std::fill_n(print.begin() + y * columns + at(r.left), at(r.left + r.width) - at(r.left), 40);
    }
  }
  auto image = std::make_shared<Image>(kCamera.width(), kCamera.height());
  const MutablePlaneView gray = image->mutable_view().y;
  const Rigid3 target_from_camera = kPose.inverse();
  for (int y = 0; y < gray.height; ++y) {
    for (int x = 0; x < gray.width; ++x) {
      int sum = 0;
      for (int k = 0; k < 9; ++k) {
        const auto ray = kCamera.unproject({x + (k % 3 - 1) / 3.0, y + (k / 3 - 1) / 3.0});
        const Eigen::Vector3d direction = target_from_camera.rotation * *ray;
        const Eigen::Vector3d& from = target_from_camera.translation;
        const Eigen::Vector3d hit = from - direction * (from.z() / direction.z());
        const int px = static_cast<int>((hit.x() + border) / cell);
        const int py = static_cast<int>((hit.y() + border) / cell);
        const bool on = hit.x() > -border && hit.y() > -border && px < columns && py < rows;
        sum += on ? print[static_cast<size_t>(py * columns + px)] : 120;
      }
      gray.row(y)[mirrored ? gray.width - 1 - x : x] = static_cast<uint8_t>(sum / 9);
    }
  }
  FrameInfo info;
  info.width = gray.width;
  info.height = gray.height;
  return Frame::decoded(info, std::move(image));
}

void expect_found(const CalibrationTarget& target, int least, double median_px) {
  auto detector = TargetDetector::create(target, {.gamma = 1});
  ASSERT_THAT(detector, IsOk());
  const auto corners = (*detector)->detect(*photograph(target));
  ASSERT_GE(static_cast<int>(corners.size()), least);
  std::vector<double> errors;
  for (const DetectedCorner& corner : corners) {
    const Eigen::Vector2d p = target.corner(corner.id);
    const auto pixel = kCamera.project(kPose * Eigen::Vector3d(p.x(), p.y(), 0));
    ASSERT_TRUE(pixel);
    errors.push_back((*pixel - corner.pixel).norm());
    EXPECT_LT(errors.back(), 0.35) << corner.id;
  }
  std::nth_element(errors.begin(), errors.begin() + static_cast<ptrdiff_t>(errors.size() / 2),
                   errors.end());
  EXPECT_LT(errors[errors.size() / 2], median_px);
}

TEST(TargetDetector, FindsWhatIsPrinted) {
  expect_found(charuco(), 35, 0.06);
  expect_found(charuco(CharucoLayout::kMarkerFirst), 35, 0.06);
  expect_found(tag_grid(), 48, 0.1);
  expect_found(chessboard(), 54, 0.06);
}

TEST(TargetDetector, SaysWhichLayoutWasPrinted) {
  for (const CharucoLayout layout : {CharucoLayout::kDarkFirst, CharucoLayout::kMarkerFirst}) {
    const FramePtr frame = photograph(charuco(layout));
    auto detector = TargetDetector::create(charuco(CharucoLayout::kAny));
    ASSERT_THAT(detector, IsOk());
    EXPECT_EQ((*detector)->layout(), CharucoLayout::kAny);
    EXPECT_FALSE((*detector)->detect(*frame).empty());
    EXPECT_EQ((*detector)->layout(), layout);
  }
}

TEST(TargetDetector, ExplainsWhatItSeesInstead) {
  const FramePtr frame = photograph(charuco());
  CalibrationTarget other = charuco();
  other.dictionary = "4X4_50";
  EXPECT_NE(explain_missing_target(other, *frame).find("of 5X5_50 (or a larger one of its kind)"),
            std::string::npos);
  EXPECT_NE(explain_missing_target(charuco(), *photograph(charuco(), true)).find("mirrored"),
            std::string::npos);
  EXPECT_NE(explain_missing_target(tag_grid(), *photograph(tag_grid(), true)).find("mirrored"),
            std::string::npos);
  CalibrationTarget smaller = charuco();
  smaller.columns = 5;
  smaller.rows = 9;
  auto detector = TargetDetector::create(smaller);
  ASSERT_THAT(detector, IsOk());
  EXPECT_TRUE((*detector)->detect(*frame).empty());
  EXPECT_NE(explain_missing_target(smaller, *frame).find("are columns and rows right?"),
            std::string::npos);
  CalibrationTarget board = chessboard();
  board.columns = 9;
  EXPECT_EQ(explain_missing_target(board, *photograph(chessboard())),
            "the image shows a chessboard of 10x7 squares");
}

TEST(TargetDetector, RefusesUnknownNames) {
  CalibrationTarget t = charuco();
  t.dictionary = "9X9_9";
  EXPECT_THAT(TargetDetector::create(t), FailsWith("dictionary '9X9_9' is not known"));
  t = tag_grid();
  t.dictionary = "tag99";
  EXPECT_THAT(TargetDetector::create(t), FailsWith("family 'tag99' is not known"));
  t.dictionary = "tag16h5";
  t.columns = 10;
  t.rows = 4;
  EXPECT_THAT(target_print(t), FailsWith("no marker 30"));
}

TEST(TargetPdf, IsAPageOfRightSize) {
  const auto paper = find_paper("a4", true);
  ASSERT_THAT(paper, IsOk());
  CalibrationTarget t = charuco();
  t.square = largest_square(t, *paper);
  t.marker = 0.7 * t.square;
  EXPECT_NEAR(t.square, 0.030, 1e-9);  // (210 - 16 - 14) mm / 6
  const auto dark = target_print(t);
  ASSERT_THAT(dark, IsOk());
  const auto pdf = target_pdf(t, *dark, *paper);
  ASSERT_THAT(pdf, IsOk());
  EXPECT_TRUE(pdf->starts_with("%PDF-1.4\n"));
  EXPECT_NE(pdf->find("/MediaBox [0 0 841.890 595.276]"), std::string::npos);
  EXPECT_NE(pdf->find(" 85.0394 85.0394 re"), std::string::npos) << "a square of 30 mm";
  const size_t table = std::stoul(pdf->substr(pdf->rfind("startxref\n") + 10));
  EXPECT_EQ(pdf->compare(table, 4, "xref"), 0);
  t.square = 0.05;
  EXPECT_THAT(target_pdf(t, *dark, *paper), FailsWith("does not fit A4"));
  EXPECT_THAT(find_paper("A9", true), FailsWith("A4, A3, letter"));
}

/// The same frame through a mean over a square of 2 * reach + 1 pixels.
FramePtr blurred(const Frame& frame, int reach) {
  auto image = std::make_shared<Image>(frame.info().width, frame.info().height);
  const PlaneView from = frame.gray();
  const MutablePlaneView to = image->mutable_view().y;
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x) {
      int sum = 0, count = 0;
      for (int v = std::max(0, y - reach); v <= std::min(to.height - 1, y + reach); ++v) {
        for (int u = std::max(0, x - reach); u <= std::min(to.width - 1, x + reach); ++u) {
          sum += from.row(v)[u];
          ++count;
        }
      }
      to.row(y)[x] = static_cast<uint8_t>(sum / count);
    }
  }
  return Frame::decoded(frame.info(), std::move(image));
}

TEST(TargetDetector, EdgesAreAsWideAsTheBlur) {
  for (const CalibrationTarget& target : {charuco(), tag_grid(), chessboard()}) {
    auto detector = TargetDetector::create(target, {.gamma = 1});
    ASSERT_THAT(detector, IsOk());
    const FramePtr sharp = photograph(target);
    const auto corners = (*detector)->detect(*sharp);
    const double width = target_edge_width(sharp->gray(), corners);
    EXPECT_GT(width, 1.5) << target.describe();
    EXPECT_LT(width, 3) << target.describe();
    const double wide = target_edge_width(blurred(*sharp, 4)->gray(), corners);
    EXPECT_GT(wide, 5) << target.describe();
    EXPECT_EQ(target_edge_width(sharp->gray(), {}), 0);
  }
}

}  // namespace
}  // namespace sightline
