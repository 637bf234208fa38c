// SPDX-License-Identifier: Apache-2.0
#include "support/scene_renderer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

#include "sightline/image/convert.hpp"
#include "support/random.hpp"
#include "support/value_noise.hpp"

namespace sightline::test {
namespace {

constexpr int kMoments = 16;  // samples of a pixel, each at its own place and time
// Rooks that do not threaten each other in every group of four; times spread in the same way.
constexpr std::array<int, kMoments> kColumn = {0, 1, 2, 3, 1, 0, 3, 2, 2, 3, 0, 1, 3, 2, 1, 0};
constexpr std::array<int, kMoments> kRow = {1, 3, 0, 2, 0, 2, 1, 3, 2, 0, 3, 1, 3, 1, 2, 0};
constexpr std::array<int, kMoments> kMoment = {1, 6, 9, 14, 3, 4, 11, 12,
                                               0, 7, 8, 15, 2, 5, 10, 13};
constexpr int kFirst = 4;
constexpr float kEdge = 0.03f;  // spread of light within a pixel that calls for all samples

const Eigen::Vector3f kKeyLight = Eigen::Vector3f(0.35f, -0.45f, 0.82f).normalized();
const Eigen::Vector3f kFillLight = Eigen::Vector3f(-0.7f, 0.5f, 0.3f).normalized();

Eigen::Vector3f printed(const Paint& paint, const Eigen::Vector3f& p) {
  const auto color = [&](float choice) {
    const int i = static_cast<int>(choice);
    return Eigen::Vector3f(0.04f + 0.7f * lattice_value(i, 0, 0, paint.seed + 50),
                           0.04f + 0.7f * lattice_value(i, 1, 0, paint.seed + 50),
                           0.04f + 0.6f * lattice_value(i, 2, 0, paint.seed + 50));
  };
  const float patch = fractal_noise(p * 45, 2, 0.5f, paint.seed);
  Eigen::Vector3f c = color(std::floor(patch * 9));
  const float blocks = value_noise(p * 260, paint.seed + 3);
  if (blocks > 0.68f) c = 0.12f * c;
  if (blocks < 0.25f) c = Eigen::Vector3f::Constant(0.75f) + 0.2f * c;
  return (0.8f + 0.4f * fractal_noise(p * 600, 2, 0.6f, paint.seed + 4)) * c;
}

/// Gaussian noise by the million: a table that is read from a random place in every row.
class NoiseTable {
 public:
  NoiseTable() {
    Random random(77);
    for (float& value : values_) value = static_cast<float>(random.normal());
  }
  const float* row(uint64_t bits, size_t count) const {
    return &values_[bits % (values_.size() - count)];
  }
  size_t size() const { return values_.size(); }

 private:
  std::array<float, (1u << 18)> values_{};
};
const NoiseTable& noise_table() {
  static const auto table = std::make_unique<NoiseTable>();
  return *table;
}

/// Gaussian blur of the box [x0, x1) x [y0, y1), reading beyond it as far as the image goes.
void blur(const std::vector<Eigen::Vector3f>& from, int width, int height, int x0, int y0, int x1,
          int y1, double sigma, std::vector<Eigen::Vector3f>& to) {
  const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
  std::vector<float> kernel;
  float total = 0;
  for (int k = -reach; k <= reach; ++k) {
    kernel.push_back(static_cast<float>(std::exp(-k * k / (2 * sigma * sigma))));
    total += kernel.back();
  }
  for (float& k : kernel) k /= total;
  const auto columns = static_cast<size_t>(x1 - x0);
  const int first = std::max(0, y0 - reach), last = std::min(height, y1 + reach);
  std::vector<Eigen::Vector3f> across(columns * static_cast<size_t>(last - first));
  for (int y = first; y < last; ++y) {
    const Eigen::Vector3f* row = &from[static_cast<size_t>(y * width)];
    for (int x = x0; x < x1; ++x) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int k = -reach; k <= reach; ++k) {
        sum += kernel[static_cast<size_t>(k + reach)] * row[std::clamp(x + k, 0, width - 1)];
      }
      across[static_cast<size_t>(y - first) * columns + static_cast<size_t>(x - x0)] = sum;
    }
  }
  for (int y = y0; y < y1; ++y) {
    Eigen::Vector3f* row = &to[static_cast<size_t>(y * width)];
    for (int x = x0; x < x1; ++x) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int k = -reach; k <= reach; ++k) {
        const auto at = static_cast<size_t>(std::clamp(y + k, first, last - 1) - first);
        sum += kernel[static_cast<size_t>(k + reach)] *
               across[at * columns + static_cast<size_t>(x - x0)];
      }
      row[x] = sum;
    }
  }
}

/// Level [0..255] of an amount of light, from a table of its square root (fine in the dark).
class Response {
 public:
  explicit Response(const Sensor& sensor) {
    for (size_t i = 0; i < levels_.size(); ++i) {
      const double root = static_cast<double>(i) / static_cast<double>(levels_.size() - 1);
      levels_[i] = static_cast<float>(255 * std::pow(root * root, 1 / sensor.gamma));
    }
  }
  float level(float light) const {
    const float root = std::sqrt(std::clamp(light, 0.0f, 1.0f));
    return levels_[static_cast<size_t>(root * static_cast<float>(levels_.size() - 1) + 0.5f)];
  }

 private:
  std::array<float, 8192> levels_{};
};

}  // namespace

struct SceneRenderer::Placed {
  const RayMesh* shape;
  const Paint* paint;
  std::array<Eigen::Matrix3f, kMoments> body_from_camera;  // rotation
  std::array<Eigen::Vector3f, kMoments> origin;            // of the camera, body frame
  std::array<Eigen::Vector3f, kMoments> key, fill;         // lights, body frame
  std::array<Rigid3, kMoments> camera_from_body;
};

struct SceneRenderer::Box {
  int x0 = 1 << 20, y0 = 1 << 20, x1 = 0, y1 = 0;
  bool empty() const { return x0 >= x1 || y0 >= y1; }
  void add(const Box& other) {
    x0 = std::min(x0, other.x0), y0 = std::min(y0, other.y0);
    x1 = std::max(x1, other.x1), y1 = std::max(y1, other.y1);
  }
  Box grown(int by, int width, int height) const {
    Box box;
    box.x0 = std::max(0, x0 - by), box.y0 = std::max(0, y0 - by);
    box.x1 = std::min(width, x1 + by), box.y1 = std::min(height, y1 + by);
    return box;
  }
};

struct SceneRenderer::Room {
  std::once_flag once;
  Light sharp, blurred;
};

SceneRenderer::~SceneRenderer() = default;
SceneRenderer::SceneRenderer(SceneRenderer&&) noexcept = default;

SceneRenderer::SceneRenderer(CalibratedCamera camera, std::shared_ptr<const Backdrop> backdrop,
                             double blur_px)
    : camera_(std::move(camera)),
      blur_px_(blur_px),
      backdrop_(std::move(backdrop)),
      room_(std::make_unique<Room>()) {
  for (int y = 0; y <= camera_.model.height(); ++y) {
    for (int x = 0; x <= camera_.model.width(); ++x) {
      const auto ray = camera_.model.unproject({x - 0.5, y - 0.5});
      rays_.push_back(ray ? Eigen::Vector3f((*ray / ray->z()).cast<float>())
                          : Eigen::Vector3f(0, 0, 1));
    }
  }
}

const SceneRenderer::Room& SceneRenderer::room() const {
  std::call_once(room_->once, [this] {
    const int width = camera_.model.width(), height = camera_.model.height();
    const Eigen::Matrix3f rotation = camera_.world_from_camera.rotation_matrix().cast<float>();
    const Eigen::Vector3f origin = camera_.world_from_camera.translation.cast<float>();
    constexpr float kPlaces[2][2] = {{-0.25f, 0.2f}, {0.25f, -0.2f}};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (const auto& place : kPlaces) {
          const Eigen::Vector3f direction =
              rotation * ray(static_cast<float>(x) + place[0], static_cast<float>(y) + place[1]);
          sum += backdrop_->light(origin, direction);
        }
        room_->sharp.push_back(0.5f * sum);
      }
    }
    room_->blurred = room_->sharp;
    if (blur_px_ > 0) {
      blur(room_->sharp, width, height, 0, 0, width, height, blur_px_, room_->blurred);
    }
  });
  return *room_;
}

// Between the pixels' corners rays are linear to far below a hundredth of a pixel.
Eigen::Vector3f SceneRenderer::ray(float x, float y) const {
  const int width = camera_.model.width(), height = camera_.model.height();
  const int column = std::clamp(static_cast<int>(x + 0.5f), 0, width - 1);
  const int row = std::clamp(static_cast<int>(y + 0.5f), 0, height - 1);
  const float u = x + 0.5f - static_cast<float>(column), v = y + 0.5f - static_cast<float>(row);
  const Eigen::Vector3f* r = &rays_[static_cast<size_t>(row * (width + 1) + column)];
  return (1 - v) * ((1 - u) * r[0] + u * r[1]) + v * ((1 - u) * r[width + 1] + u * r[width + 2]);
}

std::vector<SceneRenderer::Placed> SceneRenderer::place(const std::vector<SceneBody>& bodies,
                                                        Time capture, double shutter) const {
  std::vector<Placed> placed;
  const Rigid3 camera_from_world = camera_.world_from_camera.inverse();
  for (const SceneBody& body : bodies) {
    Placed p{};
    p.shape = body.shape.get();
    p.paint = &body.paint;
    bool there = true;
    for (size_t i = 0; i < kMoments; ++i) {
      const double share = (static_cast<double>(i) + 0.5) / kMoments - 0.5;
      const auto pose = body.world_from_body(capture + from_seconds(shutter * share));
      there = there && pose.has_value();
      if (!there) break;
      p.camera_from_body[i] = camera_from_world * *pose;
      const Rigid3 body_from_camera = p.camera_from_body[i].inverse();
      const Eigen::Matrix3f body_from_world = pose->inverse().rotation_matrix().cast<float>();
      p.body_from_camera[i] = body_from_camera.rotation_matrix().cast<float>();
      p.origin[i] = body_from_camera.translation.cast<float>();
      p.key[i] = body_from_world * kKeyLight;
      p.fill[i] = body_from_world * kFillLight;
    }
    if (there) placed.push_back(p);
  }
  return placed;
}

SceneRenderer::Box SceneRenderer::box_of(const Placed& placed) const {
  const int width = camera_.model.width(), height = camera_.model.height();
  const TriangleMesh& mesh = placed.shape->mesh();
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const size_t moment : {size_t{0}, size_t{5}, size_t{10}, size_t{kMoments - 1}}) {
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3f corner((i & 1) ? mesh.max_corner.x() : mesh.min_corner.x(),
                                   (i & 2) ? mesh.max_corner.y() : mesh.min_corner.y(),
                                   (i & 4) ? mesh.max_corner.z() : mesh.min_corner.z());
      const auto pixel =
          camera_.model.project(placed.camera_from_body[moment] * corner.cast<double>());
      if (!pixel) return {0, 0, width, height};
      low = low.min(pixel->array());
      high = high.max(pixel->array());
    }
  }
  low = low.max(-10).min(1e5) - 3;
  high = high.max(-10).min(1e5) + 4;
  Box box;
  box.x0 = std::max(0, static_cast<int>(low.x())), box.y0 = std::max(0, static_cast<int>(low.y()));
  box.x1 = std::min(width, static_cast<int>(high.x()));
  box.y1 = std::min(height, static_cast<int>(high.y()));
  return box;
}

Eigen::Vector3f SceneRenderer::sample(const std::vector<Placed>& bodies, float x, float y,
                                      int moment, const Eigen::Vector3f& behind, int& hit) const {
  const Eigen::Vector3f in_camera = ray(x, y);
  const auto m = static_cast<size_t>(moment);
  float nearest = 1e30f;
  const Placed* front = nullptr;
  RayHit at;
  for (const Placed& body : bodies) {
    const auto found =
        body.shape->cast(body.origin[m], body.body_from_camera[m] * in_camera, nearest);
    if (!found) continue;
    nearest = found->distance;
    front = &body;
    at = *found;
  }
  hit = front == nullptr ? -1 : static_cast<int>(front - bodies.data());
  if (front == nullptr) return behind;
  const Eigen::Vector3f view = -(front->body_from_camera[m] * in_camera).normalized();
  Eigen::Vector3f normal = at.normal;
  if (normal.dot(view) < 0) normal = -normal;
  const Paint& paint = *front->paint;
  Eigen::Vector3f color = paint.color;
  const auto& colors = front->shape->mesh().face_colors;
  if (paint.kind == Paint::Kind::kFaces && !colors.empty()) color = colors[at.face];
  if (paint.kind == Paint::Kind::kPrinted) color = printed(paint, at.point);
  // The body's own shadow.
  const Eigen::Vector3f lifted = at.point + 1e-4f * normal;
  float key = std::max(0.0f, normal.dot(front->key[m]));
  if (key > 0 && front->shape->blocked(lifted, front->key[m], 1e30f)) key = 0;
  const float fill = std::max(0.0f, normal.dot(front->fill[m]));
  const Eigen::Vector3f half = (front->key[m] + view).normalized();
  const float gloss = key > 0 ? paint.gloss * std::pow(std::max(0.0f, normal.dot(half)), 20.0f) : 0;
  return (0.38f + 0.75f * key + 0.25f * fill) * color + Eigen::Vector3f::Constant(gloss);
}

void SceneRenderer::expose(const std::vector<Placed>& bodies, const Box& box, const Light& backdrop,
                           Light& light) const {
  const int width = camera_.model.width();
  for (int y = box.y0; y < box.y1; ++y) {
    for (int x = box.x0; x < box.x1; ++x) {
      const auto at = static_cast<size_t>(y * width + x);
      const Eigen::Vector3f& behind = backdrop[at];
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      Eigen::Array3f low = Eigen::Array3f::Constant(1e9f), high = -low;
      int first_hit = -2, done = 0;
      bool same = true;
      for (int i = 0; i < kMoments; ++i) {
        if (i == kFirst && same && (high - low).maxCoeff() < kEdge) break;
        const auto k = static_cast<size_t>(i);
        int hit = -1;
        const Eigen::Vector3f color =
            sample(bodies, static_cast<float>(x) - 0.375f + 0.25f * static_cast<float>(kColumn[k]),
                   static_cast<float>(y) - 0.375f + 0.25f * static_cast<float>(kRow[k]), kMoment[k],
                   behind, hit);
        if (first_hit == -2) first_hit = hit;
        same = same && hit == first_hit;
        low = low.min(color.array());
        high = high.max(color.array());
        sum += color;
        ++done;
      }
      light[at] = sum / static_cast<float>(done);
    }
  }
}

FramePtr SceneRenderer::shoot(const std::vector<SceneBody>& bodies, Time capture,
                              const Sensor& sensor, uint64_t noise_seed, FrameInfo info) const {
  const int width = camera_.model.width(), height = camera_.model.height();
  const std::vector<Placed> placed = place(bodies, capture, sensor.shutter);
  Box all;
  for (const Placed& one : placed) {
    const Box box = box_of(one);
    if (!box.empty()) all.add(box);
  }
  const Room& behind = room();
  const Light* seen = &behind.blurred;
  Light light, soft;
  if (!all.empty()) {
    light = behind.sharp;
    for (const Placed& one : placed) expose(placed, box_of(one), behind.sharp, light);
    soft = behind.blurred;
    const Box spread = all.grown(static_cast<int>(std::ceil(3 * blur_px_)), width, height);
    if (blur_px_ > 0) {
      blur(light, width, height, spread.x0, spread.y0, spread.x1, spread.y1, blur_px_, soft);
    }
    seen = blur_px_ > 0 ? &soft : &light;
  }

  const Response response(sensor);
  Random random(noise_seed);
  const auto row_values = static_cast<size_t>(3 * width);
  std::vector<uint8_t> rgb(row_values * static_cast<size_t>(height));
  const auto exposure = static_cast<float>(sensor.exposure);
  const auto read = static_cast<float>(sensor.read_noise * sensor.read_noise);
  const auto shot = static_cast<float>(sensor.shot_noise * sensor.shot_noise);
  for (int y = 0; y < height; ++y) {
    const float* noise = noise_table().row(random.bits(), row_values);
    const Eigen::Vector3f* from = &(*seen)[static_cast<size_t>(y * width)];
    uint8_t* to = &rgb[static_cast<size_t>(y) * row_values];
    for (int x = 0; x < width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const float amount = exposure * from[x][channel];
        const float sigma = std::sqrt(read + shot * std::min(1.0f, amount));
        const float level = response.level(amount) + sigma * *noise++;
        *to++ = static_cast<uint8_t>(std::clamp(level + 0.5f, 0.0f, 255.0f));
      }
    }
  }
  info.width = width;
  info.height = height;
  return frame_of_rgb(rgb, info);
}

SceneRenderer::Visible SceneRenderer::visible(const std::vector<SceneBody>& bodies, size_t body,
                                              Time time) const {
  Visible count;
  std::vector<SceneBody> alone = {bodies[body]};
  const std::vector<Placed> one = place(alone, time, 0);
  if (one.empty()) return count;
  std::vector<SceneBody> others = bodies;
  others.erase(others.begin() + static_cast<ptrdiff_t>(body));
  const std::vector<Placed> rest = place(others, time, 0);
  const Box box = box_of(one.front());
  for (int y = box.y0; y < box.y1; y += 2) {
    for (int x = box.x0; x < box.x1; x += 2) {
      const Eigen::Vector3f r = ray(static_cast<float>(x), static_cast<float>(y));
      const auto hit = one[0].shape->cast(one[0].origin[0], one[0].body_from_camera[0] * r);
      if (!hit) continue;
      ++count.whole;
      const bool hidden = std::any_of(rest.begin(), rest.end(), [&](const Placed& other) {
        return other.shape->blocked(other.origin[0], other.body_from_camera[0] * r, hit->distance);
      });
      count.shown += hidden ? 0 : 1;
    }
  }
  return count;
}

FramePtr frame_of_rgb(const std::vector<uint8_t>& rgb, const FrameInfo& info) {
  auto image = std::make_shared<Image>(info.width, info.height);
  const Status done = raw_to_i420(PixelFormat::kRgb24, rgb, 0, image->mutable_view());
  SL_CHECK(done.has_value(), "image of a size that libyuv takes");
  FrameInfo complete = info;
  complete.format = PixelFormat::kI420;
  return Frame::decoded(complete, std::move(image));
}

}  // namespace sightline::test
