// SPDX-License-Identifier: Apache-2.0
#include "pipeline/rendered_features.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"
#include "sightline/image/image.hpp"
#include "sightline/observe/features/feature_trainer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"

namespace sightline::pipeline {
namespace {

// An ORB feature is found again under some 25 degrees of tilt and at half to twice the size.
constexpr int kDirections = 100;            // some 20 degrees apart
constexpr double kDiameters[] = {80, 160};  // of the object in the image [px]
constexpr int kImageSize = 400;             // [px]
constexpr double kFocal = 600;              // [px]
constexpr int kPerImage = 150;              // the strongest, so that every side has its share
constexpr size_t kFewest = 100;             // features with which an object can be found
constexpr uint8_t kBackground = 128;        // a surface's features are not at its border
constexpr std::string_view kVersion = "rendered features 5";  // with every change of what is made

// Evenly over the sphere: a spiral whose turns are as far apart as its points (Saff and Kuijlaars,
// Distributing many points on a sphere, 1997, with the golden angle).
Eigen::Vector3d direction(int index) {
  const double z = 1 - (2.0 * index + 1) / kDirections;
  const double angle = index * std::numbers::pi * (3 - std::sqrt(5.0));
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

// Of a camera that looks at `center` from `distance`.
Rigid3 looking_at(const Eigen::Vector3d& center, const Eigen::Vector3d& from, double distance) {
  Eigen::Matrix3d axes;
  axes.col(2) = -from;
  axes.col(0) = from.unitOrthogonal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return Rigid3(Eigen::Quaterniond(axes), center + distance * from);
}

// Images of the object in its own colors, alone.
class TexturedViews {
 public:
  static Result<std::unique_ptr<TexturedViews>> create(std::shared_ptr<const RenderMesh> mesh) {
    CameraModel::Parameters lens;
    lens.width = lens.height = kImageSize;
    lens.fx = lens.fy = kFocal;
    lens.cx = lens.cy = (kImageSize - 1) / 2.0;
    SL_ASSIGN(const CameraModel model, CameraModel::create(lens, "features of a mesh"));
    OverlayObject object;
    object.id = ObjectId(0);
    object.mesh = mesh;
    object.style = bare_style();
    object.style.fill = true;
    object.style.fill_kind = FillKind::kTextured;
    object.style.fill_opacity = 1;
    RenderOptions options;
    options.backend = RasterChoice::kCpu;  // the same features on every machine
    const CalibratedCamera camera{"view", model, Rigid3(), 0.5};
    SL_ASSIGN(auto renderer, CameraRenderer::create(camera, CameraId(0), {std::move(object)},
                                                    RayTable::build(model), nullptr, options));
    return std::unique_ptr<TexturedViews>(
        new TexturedViews(camera, std::move(renderer), mesh_depth_renderer_factory(mesh)(model)));
  }

  // The camera stands at the origin.
  void train(const Rigid3& camera_from_object, FeatureTrainer& trainer) {
    PoseEstimate pose;
    pose.object = ObjectId(0);
    pose.time = pose.last_measured = Time(std::chrono::seconds(1));
    pose.state = TrackState::kTracking;
    pose.world_from_object = camera_from_object;
    const PoseTrackPtr track =
        std::make_shared<const PoseTrack>(ObjectId(0), std::vector{pose}, MotionNoise{});
    auto image = std::make_shared<Image>(kImageSize, kImageSize);
    const MutableI420View view = image->mutable_view();
    for (const MutablePlaneView& plane : {view.y, view.u, view.v}) {
      for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, kBackground);
    }
    renderer_->draw(view, pose.time, std::span(&track, 1), poses_);
    FrameInfo info;
    info.capture = pose.time;
    info.width = info.height = kImageSize;
    trainer.train(*Frame::decoded(info, std::move(image)), camera_, camera_from_object, *depth_);
  }

 private:
  TexturedViews(CalibratedCamera camera, std::unique_ptr<CameraRenderer> renderer,
                std::unique_ptr<DepthRenderer> depth)
      : camera_(std::move(camera)), renderer_(std::move(renderer)), depth_(std::move(depth)) {}

  const CalibratedCamera camera_;
  const std::unique_ptr<CameraRenderer> renderer_;
  const std::unique_ptr<DepthRenderer> depth_;
  std::vector<PoseAt> poses_;
};

Result<FeatureModel> train(const TexturedObject& object, std::stop_token stop) {
  SL_ASSIGN(const auto views, TexturedViews::create(object.painted));
  TrainOptions options;
  options.per_image = kPerImage;
  options.max = FeatureModel::kMax;
  FeatureTrainer trainer(mesh_content(object.triangles), options);
  for (const double diameter : kDiameters) {
    const double distance = 2 * object.views.radius() * kFocal / diameter;
    for (int i = 0; i < kDirections; ++i) {
      if (stop.stop_requested()) {
        return make_error(ErrorCode::kUnavailable, "features of a mesh",
                          "were being made when the program was told to stop");
      }
      views->train(looking_at(object.views.center(), direction(i), distance).inverse(), trainer);
    }
  }
  return trainer.model();
}

// Of all that the features depend on.
uint64_t content_of(const TexturedObject& object) {
  std::string content(kVersion);
  const auto put = [&](const void* data, size_t size) {
    content.append(static_cast<const char*>(data), size);
  };
  const uint64_t mesh = mesh_content(object.triangles);
  put(&mesh, sizeof mesh);
  for (const SurfaceTriangle& triangle : object.surface.triangles) {
    put(triangle.places.data(), sizeof triangle.places);
    put(triangle.corner_colors.data(), sizeof triangle.corner_colors);
    put(&triangle.texture, sizeof triangle.texture);
  }
  for (const auto& image : object.images) {
    if (!image) continue;
    const PlaneView luma = image->view().y;
    for (int y = 0; y < luma.height; ++y) put(luma.row(y), static_cast<size_t>(luma.width));
  }
  return content_hash(content);
}

void keep(const std::filesystem::path& path, const FeatureModel& model) {
  std::error_code ignored;  // the write says what is wrong
  std::filesystem::create_directories(path.parent_path(), ignored);
  const Status written = write_feature_model(path, model);
  if (written) return;
  log::warning("{}; the features will be made again next time", written.error().message());
}

}  // namespace

std::vector<std::shared_ptr<const SurfaceTexture>> surface_textures(const SurfaceImages& images) {
  std::vector<std::shared_ptr<const SurfaceTexture>> out;
  for (const auto& image : images) {
    out.push_back(image ? std::make_shared<const SurfaceTexture>(image->view()) : nullptr);
  }
  return out;
}

Result<std::shared_ptr<const FeatureModel>> rendered_features(const TexturedObject& object,
                                                              const std::filesystem::path& cache,
                                                              std::stop_token stop) {
  std::shared_ptr<const FeatureModel> out;
  const std::filesystem::path path =
      cache.empty() ? cache : cache / fmt::format("features-{:016x}", content_of(object));
  Result<FeatureModel> model = make_error(ErrorCode::kNotFound, path.string(), "is not there");
  std::error_code none;
  if (!path.empty() && std::filesystem::exists(path, none)) {
    model = read_feature_model(path);
    if (!model) log::warning("{}; made anew", model.error().message());
  }
  if (!model) {
    model = train(object, stop);
    if (!model) return model.error();
    if (!path.empty()) keep(path, *model);
  }
  if (model->features.size() < kFewest) return out;
  out = std::make_shared<const FeatureModel>(*std::move(model));
  return out;
}

}  // namespace sightline::pipeline
