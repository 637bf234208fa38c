// SPDX-License-Identifier: Apache-2.0
// Which cameras are paired. What is found in their images is tests/observe's.
#include "sightline/pipeline/object_points.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Time kStart{10s};

// On a circle of 1 m about the object, looking at it.
CalibratedCamera camera_at(double azimuth_deg) {
  CameraModel::Parameters lens;
  lens.width = 64, lens.height = 48;
  lens.fx = lens.fy = 60;
  lens.cx = 31.5, lens.cy = 23.5;
  const double azimuth = azimuth_deg * 3.14159265358979 / 180;
  const Eigen::Vector3d place(std::cos(azimuth), std::sin(azimuth), 0);
  Eigen::Matrix3d axes;  // of the camera, in the world: right, down, forward
  axes << Eigen::Vector3d::UnitZ().cross(place), -Eigen::Vector3d::UnitZ(), -place;
  return {"camera", CameraModel::create(lens, "test").value(),
          Rigid3{Eigen::Quaterniond(axes), place}};
}

TriangleMesh tetrahedron() {
  TriangleMesh mesh;
  mesh.vertices = {
      {0, 0, 0.1f}, {0.1f, 0, -0.05f}, {-0.05f, 0.08f, -0.05f}, {-0.05f, -0.08f, -0.05f}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  return mesh;
}

/// Three cameras 15 degrees from one another; the one in the middle is the neighbor of both others.
class ObjectPointsPairs : public testing::Test {
 protected:
  void make(CameraRole middle) {
    for (const double azimuth : {0.0, 15.0, 30.0}) {
      CameraConfig& config =
          installation_.cameras.emplace_back(CameraConfig{.name = "camera",
                                                          .recording = {},
                                                          .recorded_as = {},
                                                          .calibration = camera_at(azimuth),
                                                          .overlay = {},
                                                          .place = {}});
      if (azimuth == 15.0) config.role = middle;
      rig_.cameras.push_back(std::make_shared<const CameraGeometry>(config.calibration, nullptr,
                                                                    std::vector<float>()));
    }
    RigObject& object = rig_.objects.emplace_back();
    object.named = {ObjectId(0), "object"};
    object.triangles = std::make_shared<const TriangleMesh>(tetrahedron());
    object.mesh = std::make_shared<const RenderMesh>(make_render_mesh(*object.triangles));
    points_ = std::make_unique<ObjectPoints>(installation_, rig_);
  }

  void show(uint32_t camera, Time capture) {
    FrameInfo info;
    info.camera = CameraId(camera);
    info.capture = info.arrival = capture;
    info.width = 64, info.height = 48;
    points_->add_frame(CameraId(camera),
                       Frame::decoded(info, std::make_shared<const Image>(64, 48)));
  }

  /// The pairs that were looked at, of an object at rest.
  std::vector<CameraSet> pairs() {
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = kStart;
    estimate.state = TrackState::kTracking;
    estimate.covariance.diagonal().head<6>().setConstant(1e-7);
    std::vector<PoseEstimate> history{estimate};
    for (int i = 0; i < 3; ++i) {
      estimate.time = estimate.last_measured = estimate.time + 100ms;
      history.push_back(estimate);
    }
    const std::vector<PoseTrackPtr> tracks{
        std::make_shared<PoseTrack>(ObjectId(0), history, MotionNoise{})};
    std::vector<ObjectPoints::Found> found;
    points_->find(tracks, found);
    std::vector<CameraSet> out;
    for (const ObjectPoints::Found& each : found) out.push_back(each.cameras);
    return out;
  }

 private:
  Installation installation_;
  Rig rig_;
  std::unique_ptr<ObjectPoints> points_;
};

TEST_F(ObjectPointsPairs, NeighborsArePaired) {
  make(CameraRole::kObserveAndStream);
  for (uint32_t camera = 0; camera < 3; ++camera) show(camera, kStart);
  EXPECT_EQ(pairs(), (std::vector<CameraSet>{3, 6}));
}

TEST_F(ObjectPointsPairs, ACameraThatOnlyStreamsTakesNobodysPlace) {
  make(CameraRole::kStream);
  for (uint32_t camera = 0; camera < 3; ++camera) show(camera, kStart);
  EXPECT_EQ(pairs(), std::vector<CameraSet>{5});
}

TEST_F(ObjectPointsPairs, ACameraThatIsNotThereTakesNobodysPlace) {
  make(CameraRole::kObserveAndStream);
  for (const uint32_t camera : {0u, 2u}) show(camera, kStart);
  EXPECT_EQ(pairs(), std::vector<CameraSet>{5});
}

TEST_F(ObjectPointsPairs, ACameraThatHasGoneGivesItsPlaceUp) {
  make(CameraRole::kObserveAndStream);
  for (uint32_t camera = 0; camera < 3; ++camera) show(camera, kStart);
  EXPECT_EQ(pairs().size(), 2u);
  for (const uint32_t camera : {0u, 2u}) show(camera, kStart + 300ms);
  EXPECT_EQ(pairs(), std::vector<CameraSet>{5});
}

}  // namespace
}  // namespace sightline
