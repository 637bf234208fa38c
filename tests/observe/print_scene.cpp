// SPDX-License-Identifier: Apache-2.0
#include "print_scene.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/core/version.hpp>
#include <optional>
#include <random>
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7)
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

namespace sightline::test {
namespace {

constexpr double kBlack = 0.04, kWhite = 0.75, kBackground = 0.25;  // light

struct FamilyFunctions {
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};
const std::map<std::string, FamilyFunctions>& families() {
  static const std::map<std::string, FamilyFunctions> all = {
      {"tag36h11", {tag36h11_create, tag36h11_destroy}},
      {"tag25h9", {tag25h9_create, tag25h9_destroy}},
      {"tag16h5", {tag16h5_create, tag16h5_destroy}},
      {"tag36h10", {tag36h10_create, tag36h10_destroy}},
      {"tagCircle21h7", {tagCircle21h7_create, tagCircle21h7_destroy}},
      {"tagCircle49h12", {tagCircle49h12_create, tagCircle49h12_destroy}},
      {"tagStandard41h12", {tagStandard41h12_create, tagStandard41h12_destroy}},
      {"tagStandard52h13", {tagStandard52h13_create, tagStandard52h13_destroy}},
      {"tagCustom48h12", {tagCustom48h12_create, tagCustom48h12_destroy}},
  };
  return all;
}

const std::map<std::string, int>& dictionaries() {
  static const std::map<std::string, int> all = {
      {"4X4_50", cv::aruco::DICT_4X4_50},     {"4X4_1000", cv::aruco::DICT_4X4_1000},
      {"5X5_100", cv::aruco::DICT_5X5_100},   {"6X6_250", cv::aruco::DICT_6X6_250},
      {"7X7_1000", cv::aruco::DICT_7X7_1000}, {"ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL}};
  return all;
}

/// Bits of a marker with its one-module black border; 1 is white.
cv::Mat marker_cells(const std::string& dictionary, int id) {
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 7)
  const cv::aruco::Dictionary d = cv::aruco::getPredefinedDictionary(dictionaries().at(dictionary));
#else
  const cv::aruco::Dictionary d =
      *cv::aruco::getPredefinedDictionary(dictionaries().at(dictionary));
#endif
  const cv::Mat bits =
      cv::aruco::Dictionary::getBitsFromByteList(d.bytesList.row(id), d.markerSize);
  cv::Mat cells = cv::Mat::zeros(d.markerSize + 2, d.markerSize + 2, CV_8UC1);
  bits.copyTo(cells(cv::Rect(1, 1, d.markerSize, d.markerSize)));
  return cells;
}

/// Gaussian blur of one row or column of `count` values that are `step` apart.
void blur_line(float* line, int count, ptrdiff_t step, const std::vector<float>& kernel,
               std::vector<float>& copy) {
  const int reach = static_cast<int>(kernel.size() / 2);
  copy.resize(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) copy[static_cast<size_t>(i)] = line[i * step];
  for (int i = 0; i < count; ++i) {
    float sum = 0;
    for (int k = -reach; k <= reach; ++k) {
      const int at = std::clamp(i + k, 0, count - 1);
      sum += kernel[static_cast<size_t>(k + reach)] * copy[static_cast<size_t>(at)];
    }
    line[i * step] = sum;
  }
}

void blur(std::vector<float>& light, int width, int height, double sigma) {
  std::vector<float> kernel;
  float total = 0;
  for (int k = -3; k <= 3; ++k) {
    kernel.push_back(static_cast<float>(std::exp(-k * k / (2 * sigma * sigma))));
    total += kernel.back();
  }
  for (float& k : kernel) k /= total;
  std::vector<float> copy;
  for (int y = 0; y < height; ++y)
    blur_line(&light[static_cast<size_t>(y * width)], width, 1, kernel, copy);
  for (int x = 0; x < width; ++x)
    blur_line(&light[static_cast<size_t>(x)], height, width, kernel, copy);
}

/// Half a turn about x: from y up, z out to y down, z into the print.
Rigid3 flipped_at(double x, double y) { return Rigid3(Eigen::Quaterniond(0, 1, 0, 0), {x, y, 0}); }

}  // namespace

Print blank_print(int columns, int rows, double cell) {
  return {columns, rows, cell, std::vector<uint8_t>(static_cast<size_t>(columns * rows), 1)};
}

MarkerPrint apriltag_print(const std::string& family, int id, double size) {
  const FamilyFunctions& functions = families().at(family);
  apriltag_family_t* f = functions.create();
  image_u8_t* image = apriltag_to_image(f, id);
  constexpr int kMargin = 2;
  const int total = image->width;
  MarkerPrint out{blank_print(total + 2 * kMargin, total + 2 * kMargin, size / f->width_at_border),
                  {}};
  // OpenCV has the classic families, half a turn from the library's images.
  const bool half_turn = !f->reversed_border;
  for (int y = 0; y < total; ++y) {
    for (int x = 0; x < total; ++x) {
      const int u = half_turn ? total - 1 - x : x;
      const int v = half_turn ? total - 1 - y : y;
      out.print.set(x + kMargin, y + kMargin, image->buf[v * image->stride + u] > 127);
    }
  }
  std::free(image->buf);  // the library does not export its own destroy function
  std::free(image);
  functions.destroy(f);
  const double middle = out.print.columns * out.print.cell / 2;
  out.plane_from_fiducial = flipped_at(middle, middle);
  return out;
}

MarkerPrint aruco_print(const std::string& dictionary, int id, double size) {
  const cv::Mat cells = marker_cells(dictionary, id);
  constexpr int kMargin = 2;
  MarkerPrint out{
      blank_print(cells.cols + 2 * kMargin, cells.rows + 2 * kMargin, size / cells.cols), {}};
  for (int y = 0; y < cells.rows; ++y) {
    for (int x = 0; x < cells.cols; ++x) {
      out.print.set(x + kMargin, y + kMargin, cells.at<uint8_t>(y, x) != 0);
    }
  }
  const double middle = out.print.columns * out.print.cell / 2;
  out.plane_from_fiducial = flipped_at(middle, middle);
  return out;
}

BoardPrint charuco_print(const CharucoBoard& board, bool marker_first) {
  const int modules = marker_cells(board.dictionary, 0).cols;
  // Cells fine enough for square and marker to be whole numbers of them.
  const double cell = board.marker / (modules * 4);
  const int per_square = static_cast<int>(std::lround(board.square / cell));
  const int inset = (per_square - modules * 4) / 2;
  const int margin = per_square;
  BoardPrint out{blank_print(board.columns * per_square + 2 * margin,
                             board.rows * per_square + 2 * margin, cell),
                 Rigid3(Eigen::Quaterniond::Identity(), {margin * cell, margin * cell, 0})};
  int next = 0;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const bool has_marker = ((row + column) % 2 == 0) == marker_first;
      const cv::Mat cells = has_marker ? marker_cells(board.dictionary, next++) : cv::Mat();
      for (int y = 0; y < per_square; ++y) {
        for (int x = 0; x < per_square; ++x) {
          bool white = has_marker;
          const int mx = x - inset;
          const int my = y - inset;
          if (has_marker && mx >= 0 && my >= 0 && mx < modules * 4 && my < modules * 4) {
            white = cells.at<uint8_t>(my / 4, mx / 4) != 0;
          }
          out.print.set(margin + column * per_square + x, margin + row * per_square + y, white);
        }
      }
    }
  }
  if (board.inverted) {
    for (uint8_t& w : out.print.white) w = w == 0 ? 1 : 0;
  }
  return out;
}

void PrintScene::add(const Print& print, const Rigid3& world_from_plane) {
  prints_.push_back({print, world_from_plane});
}

void PrintScene::expose(const Placed& placed, int n, std::vector<float>& light) const {
  const CameraModel& camera = camera_.model;
  const Rigid3 camera_from_plane = camera_.world_from_camera.inverse() * placed.world_from_plane;
  const Print& print = placed.print;
  const double w = print.columns * print.cell;
  const double h = print.rows * print.cell;
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int i = 0; i <= 32; ++i) {
    const double s = i / 32.0;
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(w * s, 0, 0), Eigen::Vector3d(w * s, h, 0),
                                     Eigen::Vector3d(0, h * s, 0), Eigen::Vector3d(w, h * s, 0)}) {
      const auto pixel = camera.project(camera_from_plane * p);
      if (!pixel) continue;
      low = low.min(pixel->array());
      high = high.max(pixel->array());
    }
  }
  const int left = std::max(0, static_cast<int>(low.x()) - 2);
  const int right = std::min(camera.width(), static_cast<int>(high.x()) + 3);
  const int top = std::max(0, static_cast<int>(low.y()) - 2);
  const int bottom = std::min(camera.height(), static_cast<int>(high.y()) + 3);

  // Rays through the pixels' corners; between them they are linear to far below a pixel's
  // hundredth.
  const int columns = std::max(0, right - left) + 1;
  std::vector<Eigen::Vector3d> rays;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x < left + columns; ++x) {
      const auto ray = camera.unproject({x - 0.5, y - 0.5});
      rays.push_back(ray ? Eigen::Vector3d(*ray / ray->z())
                         : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
  }
  const Rigid3 plane_from_camera = camera_from_plane.inverse();
  const Eigen::Matrix3d rotation = plane_from_camera.rotation_matrix();
  const auto white_at = [&](const Eigen::Vector3d& ray) -> std::optional<bool> {
    const Eigen::Vector3d direction = rotation * ray;
    const double s = -plane_from_camera.translation.z() / direction.z();
    const Eigen::Vector3d p = plane_from_camera.translation + s * direction;
    if (!(s > 0)) return std::nullopt;
    const double column = std::floor(p.x() / print.cell);
    const double row = std::floor(p.y() / print.cell);
    if (!(column >= 0 && row >= 0 && column < print.columns && row < print.rows)) {
      return std::nullopt;
    }
    return print.at(static_cast<int>(column), static_cast<int>(row));
  };
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      float& pixel = light[static_cast<size_t>(y * camera.width() + x)];
      const Eigen::Vector3d* r = &rays[static_cast<size_t>((y - top) * columns + x - left)];
      double sum = 0;
      for (int k = 0; k < n * n; ++k) {
        const double u = (k % n + 0.5) / n;
        const double v = (k / n + 0.5) / n;
        const Eigen::Vector3d ray =
            (1 - v) * ((1 - u) * r[0] + u * r[1]) + v * ((1 - u) * r[columns] + u * r[columns + 1]);
        const auto white = white_at(ray);
        sum += !white ? static_cast<double>(pixel) : *white ? kWhite : kBlack;
      }
      pixel = static_cast<float>(sum / (n * n));
    }
  }
}

FramePtr PrintScene::shoot(Time capture, const Exposure& exposure) const {
  const int width = camera_.model.width();
  const int height = camera_.model.height();
  std::vector<float> light(static_cast<size_t>(width * height), static_cast<float>(kBackground));
  for (const Placed& placed : prints_) expose(placed, exposure.samples, light);
  if (exposure.blur_px > 0) blur(light, width, height, exposure.blur_px);
  std::mt19937 random(exposure.seed);
  std::normal_distribution<double> noise(0, std::max(1e-9, exposure.noise));
  std::vector<uint8_t> gray(light.size());
  for (size_t i = 0; i < light.size(); ++i) {
    const double level = 16 + 219 * std::pow(static_cast<double>(light[i]), 1 / exposure.gamma);
    gray[i] = static_cast<uint8_t>(std::clamp(std::lround(level + noise(random)), 0L, 255L));
  }
  return frame_of(gray, width, height, capture);
}

FramePtr frame_of(const std::vector<uint8_t>& gray, int width, int height, Time capture) {
  auto image = std::make_shared<::sightline::Image>(width, height);
  const MutableI420View view = image->mutable_view();
  for (int y = 0; y < height; ++y) {
    std::copy_n(gray.begin() + static_cast<ptrdiff_t>(y) * width, width, view.y.row(y));
  }
  FrameInfo info;
  info.width = width;
  info.height = height;
  info.capture = capture;
  return Frame::decoded(info, std::move(image));
}

CalibratedCamera test_camera(LensModel lens) {
  CameraModel::Parameters p;
  p.lens = lens;
  p.width = 640;
  p.height = 480;
  p.fx = 612.4;
  p.fy = 609.7;
  p.cx = 322.8;
  p.cy = 236.1;
  if (lens == LensModel::kFisheye) {
    p.fx = p.fy = 420;
    p.distortion = {0.02, -0.01, 0.004, -0.001};
  } else {
    p.distortion = {-0.29, 0.09, 0.0008, -0.0006, -0.011};
  }
  return {"test", *CameraModel::create(p, "test camera"), Rigid3(), 0.0};
}

}  // namespace sightline::test
