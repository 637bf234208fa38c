// SPDX-License-Identifier: Apache-2.0
// The usual way: convert the frame to BGR, project every vertex, draw every edge or face, convert
// back. No hidden surfaces; the painter's order is by face center.
#include <algorithm>
#include <array>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "compare.hpp"

namespace sightline::compare {
namespace {

class Drawer {
 public:
  explicit Drawer(const Scene& scene) : scene_(scene) {
    const CameraModel::Parameters& p = scene.camera.parameters();
    matrix_ = (cv::Mat_<double>(3, 3) << p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1);
    distortion_ = cv::Mat(1, 5, CV_64F);
    for (int i = 0; i < 5; ++i) distortion_.at<double>(i) = p.distortion[static_cast<size_t>(i)];
    for (const Eigen::Vector3f& v : scene.mesh.vertices) points_.emplace_back(v.x(), v.y(), v.z());
    std::set<std::array<uint32_t, 2>> edges;
    for (const auto& f : scene.mesh.faces) {
      for (size_t k = 0; k < 3; ++k)
        edges.insert({std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])});
    }
    edges_.assign(edges.begin(), edges.end());
    planar_.create(p.height * 3 / 2, p.width, CV_8UC1);
  }

  void wireframe(size_t k, int line_type) {
    begin(k);
    for (const auto& [a, b] : edges_)
      cv::line(bgr_, pixels_[a], pixels_[b], {120, 225, 70}, 1, line_type);
    end();
  }

  void painter(size_t k) {
    begin(k);
    const Rigid3& pose = scene_.poses[k];
    const auto& faces = scene_.mesh.faces;
    depth_.resize(faces.size());
    order_.resize(faces.size());
    std::iota(order_.begin(), order_.end(), 0u);
    const Eigen::Matrix3d rotation = pose.rotation_matrix();
    for (size_t f = 0; f < faces.size(); ++f) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (const uint32_t v : faces[f]) sum += scene_.mesh.vertices[v];
      depth_[f] = rotation.row(2).dot(sum.cast<double>());
    }
    std::ranges::sort(order_, [&](uint32_t a, uint32_t b) { return depth_[a] > depth_[b]; });
    for (const uint32_t f : order_) {
      std::array<cv::Point, 3> corners;
      for (size_t i = 0; i < 3; ++i) corners[i] = pixels_[faces[f][i]];
      cv::fillConvexPoly(bgr_, corners.data(), 3, {60, 60.0 + f % 128, 60});
    }
    end();
  }

 private:
  void begin(size_t k) {
    copy_in();
    cv::cvtColor(planar_, bgr_, cv::COLOR_YUV2BGR_I420);
    const Rigid3& pose = scene_.poses[k];
    const Eigen::AngleAxisd turn(pose.rotation);
    const Eigen::Vector3d r = turn.angle() * turn.axis();
    cv::projectPoints(points_, cv::Vec3d(r.x(), r.y(), r.z()),
                      cv::Vec3d(pose.translation.x(), pose.translation.y(), pose.translation.z()),
                      matrix_, distortion_, pixels_);
  }
  void end() {
    cv::cvtColor(bgr_, planar_, cv::COLOR_BGR2YUV_I420);
    copy_out();
  }
  /// OpenCV wants the three planes in one piece: only rows of luma are copied, chroma follows.
  void copy_in() {
    const I420View from = scene_.frame->view();
    uint8_t* to = planar_.data;
    for (const PlaneView* plane : {&from.y, &from.u, &from.v}) {
      for (int y = 0; y < plane->height; ++y, to += plane->width)
        std::copy_n(plane->row(y), plane->width, to);
    }
  }
  void copy_out() {
    const MutableI420View to = scene_.frame->mutable_view();
    const uint8_t* from = planar_.data;
    for (const MutablePlaneView* plane : {&to.y, &to.u, &to.v}) {
      for (int y = 0; y < plane->height; ++y, from += plane->width)
        std::copy_n(from, plane->width, plane->row(y));
    }
  }

  const Scene& scene_;
  cv::Mat matrix_, distortion_, planar_, bgr_;
  std::vector<cv::Point3f> points_;
  std::vector<cv::Point2f> pixels_;
  std::vector<std::array<uint32_t, 2>> edges_;
  std::vector<double> depth_;
  std::vector<uint32_t> order_;
};

}  // namespace

std::vector<Contestant> opencv_contestants(const Scene& scene) {
  cv::setNumThreads(1);
  const auto drawer = std::make_shared<Drawer>(scene);
  return {{"OpenCV: projectPoints, all edges as lines",
           [drawer](size_t k) { drawer->wireframe(k, cv::LINE_8); }, ""},
          {"OpenCV: the same, anti-aliased",
           [drawer](size_t k) { drawer->wireframe(k, cv::LINE_AA); }, ""},
          {"OpenCV: projectPoints, painter's polygons", [drawer](size_t k) { drawer->painter(k); },
           ""}};
}

}  // namespace sightline::compare
