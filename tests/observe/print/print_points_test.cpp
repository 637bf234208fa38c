// SPDX-License-Identifier: Apache-2.0
// A print in the image: from how far it is reached, and which of several starts counts.
#include "observe/track/print/print_points.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "observe/track/print/texture_measurement.hpp"
#include "observe/track/track_constants.hpp"
#include "support/lens_camera.hpp"
#include "support/value_noise.hpp"

namespace sightline::observe {
namespace {

constexpr double kWidth = 0.20, kHeight = 0.15;  // [m] of a card in the plane z = 0

/// A printed card as a camera sees it, ray by ray; its print has no structure that repeats.
class CardRenderer final : public PrintRenderer {
 public:
  explicit CardRenderer(const CameraModel& camera) : camera_(camera) {}

  PrintTile render(const Rigid3& camera_from_object) override {
    const int width = camera_.width(), height = camera_.height();
    inverse_depth_.assign(static_cast<size_t>(width) * static_cast<size_t>(height), 0);
    luma_.assign(inverse_depth_.size(), 90);  // what is beside the card
    const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
    const Rigid3 object_from_camera = camera_from_object.inverse();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto ray = camera_.unproject(Eigen::Vector2d(x, y));
        if (!ray) continue;
        const double range =
            rotation.col(2).dot(camera_from_object.translation) / rotation.col(2).dot(*ray);
        const Eigen::Vector3d place = object_from_camera * Eigen::Vector3d(range * *ray);
        if (range <= 0 || std::abs(place.x()) > kWidth / 2 || std::abs(place.y()) > kHeight / 2) {
          continue;
        }
        const auto i = static_cast<size_t>(y * width + x);
        inverse_depth_[i] = static_cast<float>(1 / (range * ray->z()));
        const Eigen::Vector3f bump = 250 * place.cast<float>();
        luma_[i] = static_cast<uint8_t>(20 + 210 * test::fractal_noise(bump, 2, 0.5f, 7));
      }
    }
    PrintTile tile;
    tile.depth = {0, 0, width, height, width, inverse_depth_.data()};
    tile.luma = luma_.data();
    tile.luma_stride = width;
    return tile;
  }
  PlaneView image() const {
    return {luma_.data(), camera_.width(), camera_.height(), camera_.width()};
  }

 private:
  const CameraModel& camera_;
  std::vector<float> inverse_depth_;
  std::vector<uint8_t> luma_;
};

class PrintedCard : public testing::Test {
 protected:
  PrintedCard()
      : camera_(std::make_shared<const CalibratedCamera>(test::lens_camera()), TrackerOptions{},
                {}),
        seen_(camera_.camera->model) {
    seen_.render(truth_);
  }
  /// Turned about the line of sight [rad], and sideways [m].
  Rigid3 off_by(double angle, double sideways) const {
    return truth_ * Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())),
                           {sideways, 0, 0});
  }
  struct Measured {
    int used = 0;
    double angle = 0, distance = 0;  ///< from the truth
    std::string_view kind = {};
  };
  Measured measure(std::span<const Rigid3> starts, int rounds,
                   size_t enough = tuning::kTexturedPoints) {
    const auto factory = [](const CameraModel& model) {
      return std::make_unique<CardRenderer>(model);
    };
    PrintPoints print(camera_.camera->model, factory);
    Matrix6 covariance = Matrix6::Identity() * 0.02;  // it is not known where it is
    const PosePrior prior(starts.front(), covariance, 0, 0);
    TextureMeasurement measurement(camera_, {camera_.options.print_error, rounds, enough});
    Measured out;
    const PoseTermPtr term = measurement.measure(seen_.image(), prior, starts, {}, false,
                                                 print.around(starts.front()), out.used);
    if (!term) return {};
    out.kind = term->kind();
    out.angle = rotation_angle(measurement.pose(), truth_);
    out.distance = translation_distance(measurement.pose(), truth_);
    return out;
  }

  TrackerCamera camera_;
  const Rigid3 truth_{Eigen::Quaterniond(Eigen::AngleAxisd(2.8, Eigen::Vector3d::UnitX())),
                      {0.01, -0.01, 0.5}};
  CardRenderer seen_;
};

TEST_F(PrintedCard, IsMeasuredFromBeside) {
  const Rigid3 start = off_by(0.01, 0.001);
  const Measured measured = measure({&start, 1}, tuning::kPrintRounds);
  EXPECT_GE(measured.used, 24);
  EXPECT_LT(measured.angle, 2e-3);
  EXPECT_LT(measured.distance, 5e-4);
}

// At its corners it is 12 pixels off, and its middle is not: what is found there leads to the rest.
TEST_F(PrintedCard, PointsThatAreFoundLeadToTheOthers) {
  const Rigid3 start = off_by(0.08, 0);
  const Measured once = measure({&start, 1}, 1);
  const Measured measured = measure({&start, 1}, tuning::kPrintRounds);
  EXPECT_GE(measured.used, 24);
  EXPECT_LT(once.used, measured.used / 2) << "or it need not be led";
  EXPECT_LT(measured.angle, 2e-3);
  EXPECT_LT(measured.distance, 5e-4);
}

// An outline that ends at something else is 20 pixels off; where it was expected it is.
TEST_F(PrintedCard, TheStartFromWhichMostAreFoundCounts) {
  const std::array starts{off_by(0, 0.016), off_by(0.01, 0.001)};
  const Measured first = measure({starts.data(), 1}, tuning::kPrintRounds);
  const Measured measured = measure(starts, tuning::kPrintRounds);
  EXPECT_LT(first.used, tuning::kTexturedPoints) << "or it need not be told";
  EXPECT_GE(measured.used, 24);
  EXPECT_LT(measured.angle, 2e-3);
  EXPECT_LT(measured.distance, 5e-4);
  const std::array turned_around{starts[1], starts[0]};
  EXPECT_EQ(measure(turned_around, tuning::kPrintRounds).used, measured.used);
}

TEST_F(PrintedCard, FewPointsAreSaidToBeFew) {
  const Rigid3 start = off_by(0.01, 0.001);
  EXPECT_EQ(measure({&start, 1}, tuning::kPrintRounds).kind, "texture");
  const Measured few = measure({&start, 1}, tuning::kPrintRounds, TexturePoints::kPerFrame + 1);
  EXPECT_EQ(few.kind, "sparse_texture");
}

TEST_F(PrintedCard, IsNotFoundWhereItIsNot) {
  const std::array starts{off_by(0.5, 0.05), off_by(3.1, 0.0)};
  EXPECT_LT(measure(starts, tuning::kPrintRounds).used, tuning::kTexturedPoints);
}

}  // namespace
}  // namespace sightline::observe
