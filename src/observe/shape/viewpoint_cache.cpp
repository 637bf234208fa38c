// SPDX-License-Identifier: Apache-2.0
//
// The cache file of a viewpoint model: little-endian numbers without gaps.
//   magic, version, key, options, center, radius, symmetry rotations, near ones, axis of symmetry,
//   counts; per view: direction, counts, area, length, mask; all outline samples; all edge samples;
//   FNV-1a of everything before.
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <system_error>
#include <type_traits>

#include "observe/shape/view_sphere.hpp"
#include "observe/shape/viewpoint_model_builder.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/log.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline {
namespace {

constexpr uint64_t kMagic = 0x315357454956'4C53ULL;  // "SLVIEWS1"
// Grows when the file or the way the samples are made changes.
constexpr uint32_t kVersion = 6;
constexpr size_t kLargestFile = size_t{256} << 20;

template <typename T>
void put(std::string& out, const T& value) {
  static_assert(std::is_arithmetic_v<T>);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}

template <typename T, int N>
void put(std::string& out, const Eigen::Matrix<T, N, 1>& vector) {
  for (int i = 0; i < N; ++i) put(out, vector[i]);
}

void put_options(std::string& out, const ViewpointModelOptions& options) {
  for (const int value :
       {options.subdivisions, options.contour_samples, options.edge_samples, options.image_px}) {
    put(out, static_cast<int32_t>(value));
  }
  put(out, options.distance_radii);
  put(out, options.crease_angle);
  put(out, options.depth_jump);
}

// Takes numbers off the front; once they run out, all further ones are zero and ok() is false.
class Taker {
 public:
  explicit Taker(std::string_view content) : rest_(content) {}

  template <typename T>
  T number() {
    static_assert(std::is_arithmetic_v<T>);
    T value{};
    if (rest_.size() < sizeof(T)) {
      ok_ = false;
      rest_ = {};
      return value;
    }
    std::memcpy(&value, rest_.data(), sizeof(T));
    rest_.remove_prefix(sizeof(T));
    return value;
  }
  template <typename T>
  Eigen::Matrix<T, 3, 1> vector() {
    const T x = number<T>(), y = number<T>(), z = number<T>();
    return {x, y, z};
  }
  bool ok() const { return ok_; }
  size_t left() const { return rest_.size(); }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

ViewpointModelOptions take_options(Taker& in) {
  ViewpointModelOptions options;
  options.subdivisions = in.number<int32_t>();
  options.contour_samples = in.number<int32_t>();
  options.edge_samples = in.number<int32_t>();
  options.image_px = in.number<int32_t>();
  options.distance_radii = in.number<double>();
  options.crease_angle = in.number<double>();
  options.depth_jump = in.number<double>();
  return options;
}

bool within(float value, float low, float high) { return value >= low && value <= high; }

bool unit(const Eigen::Vector3f& vector) { return within(vector.squaredNorm(), 0.99f, 1.01f); }

void put_rotations(std::string& out, const std::vector<Rigid3>& rotations) {
  put(out, static_cast<uint32_t>(rotations.size()));
  for (const Rigid3& transform : rotations) {
    put(out, Eigen::Vector4d(transform.rotation.coeffs()));
    put(out, transform.translation);
  }
}

void put_axis(std::string& out, const std::optional<ShapeSymmetry::Axis>& axis) {
  put(out, Eigen::Vector3d(axis ? axis->direction : Eigen::Vector3d::Zero()));
  put(out, Eigen::Vector3d(axis ? axis->point : Eigen::Vector3d::Zero()));
}

// False if those are none.
bool take_rotations(Taker& in, double radius, std::vector<Rigid3>& rotations) {
  const size_t count = in.number<uint32_t>();
  if (count > ShapeSymmetry::kMax) return false;
  for (size_t i = 0; i < count; ++i) {
    Eigen::Quaterniond rotation;
    for (Eigen::Index k = 0; k < 4; ++k) rotation.coeffs()[k] = in.number<double>();
    const Eigen::Vector3d translation = in.vector<double>();
    if (!(std::abs(rotation.norm() - 1) < 1e-6) || !(translation.norm() < 1e6 * radius)) {
      return false;
    }
    rotations.emplace_back(rotation, translation);
  }
  return true;
}

// False if that is none.
bool take_axis(Taker& in, double radius, std::optional<ShapeSymmetry::Axis>& axis) {
  const Eigen::Vector3d direction = in.vector<double>();
  const Eigen::Vector3d point = in.vector<double>();
  if (!direction.allFinite() || !(point.norm() < 1e6 * radius)) return false;
  if (direction.isZero(0.0)) return true;
  axis = ShapeSymmetry::Axis{direction, point, false};
  return std::abs(direction.norm() - 1) < 1e-6;
}

// Samples lie on or (outlines are smoothed) next to the mesh.
bool near_center(const Eigen::Vector3f& point, const Eigen::Vector3d& center, double radius) {
  return (point.cast<double>() - center).norm() <= 1.1 * radius;
}

constexpr size_t kViewBytes = 3 * 4 + 2 * 4 + 2 * 4 + ViewpointModel::kMaskSize * 4;
constexpr size_t kContourBytes = 9 * 4, kEdgeBytes = 8 * 4;

// Where samples may be: what the header says of the mesh.
struct Extent {
  Eigen::Vector3d center;
  double radius;
  float longest;  // distance that a sample may keep free
};

bool usable(const ViewpointModelOptions& options, const Eigen::Vector3d& center, double radius) {
  return options.subdivisions >= 0 && options.subdivisions <= 4 && options.distance_radii >= 2 &&
         options.distance_radii <= 1000 && center.allFinite() && radius > 0 && radius < 1e6;
}

// 0 or 1, as it was written.
bool take_crease(Taker& in, uint8_t& crease) {
  const float value = in.number<float>();
  crease = value == 0 ? 0 : 1;
  return !std::signbit(value) && (value == 0 || value == 1);
}

// Less where its samples begin.
template <typename Record>
bool take_record(Taker& in, const Eigen::Vector3d& direction, Record& record) {
  record.direction = in.vector<float>();
  record.contours = in.number<uint32_t>();
  record.edges = in.number<uint32_t>();
  record.area = in.number<float>();
  record.contour_length = in.number<float>();
  for (uint32_t& row : record.mask) row = in.number<uint32_t>();
  return (record.direction - direction.cast<float>()).isZero(1e-5f) && record.contours <= 4096 &&
         record.edges <= 4096 && within(record.area, 0, 1e12f) &&
         within(record.contour_length, 0, 1e9f);
}

bool take_contour(Taker& in, const Extent& extent, ContourSample& sample) {
  sample.point = in.vector<float>();
  sample.normal = in.vector<float>();
  sample.foreground = in.number<float>();
  sample.background = in.number<float>();
  return take_crease(in, sample.crease) &&
         near_center(sample.point, extent.center, extent.radius) && unit(sample.normal) &&
         within(sample.foreground, 0, extent.longest) &&
         within(sample.background, 0, extent.longest);
}

bool take_inner_edge(Taker& in, const Extent& extent, InnerEdgeSample& sample) {
  sample.point = in.vector<float>();
  sample.tangent = in.vector<float>();
  sample.clearance = in.number<float>();
  return take_crease(in, sample.crease) &&
         near_center(sample.point, extent.center, extent.radius) && unit(sample.tangent) &&
         within(sample.clearance, 0, extent.longest);
}

}  // namespace

uint64_t ViewpointModel::key(const TriangleMesh& mesh, const ViewpointModelOptions& options) {
  std::string content;
  content.reserve(mesh.vertices.size() * 12 + mesh.faces.size() * 12 + 64);
  put(content, kVersion);
  put_options(content, options);
  put(content, static_cast<uint64_t>(mesh.vertices.size()));
  for (const Eigen::Vector3f& vertex : mesh.vertices) put(content, vertex);
  for (const auto& face : mesh.faces) {
    for (const uint32_t corner : face) put(content, corner);
  }
  put(content, mesh.closed ? 1 : 0);
  return content_hash(content);
}

std::string ViewpointModel::cache_name(uint64_t key) { return fmt::format("{:016x}.views", key); }

std::string ViewpointModel::serialize() const {
  return observe::ViewpointModelBuilder::write(*this);
}

Result<std::shared_ptr<const ViewpointModel>> ViewpointModel::parse(std::string_view content,
                                                                    uint64_t key,
                                                                    const std::string& where) {
  return observe::ViewpointModelBuilder::read(content, key, where);
}

std::string observe::ViewpointModelBuilder::write(const ViewpointModel& model) {
  std::string out;
  out.reserve(256 + model.records_.size() * kViewBytes + model.contours_.size() * kContourBytes +
              model.edges_.size() * kEdgeBytes);
  put(out, kMagic);
  put(out, kVersion);
  put(out, model.key_);
  put_options(out, model.options_);
  put(out, model.center_);
  put(out, model.radius_);
  put_rotations(out, model.symmetry_rotations_);
  put_rotations(out, model.near_rotations_);
  put_axis(out, model.symmetry_axis_);
  put_axis(out, model.near_axis_);
  put(out, static_cast<uint32_t>(model.records_.size()));
  for (const auto& record : model.records_) {
    put(out, record.direction);
    put(out, record.contours);
    put(out, record.edges);
    put(out, record.area);
    put(out, record.contour_length);
    for (const uint32_t row : record.mask) put(out, row);
  }
  for (const ContourSample& sample : model.contours_) {
    put(out, sample.point);
    put(out, sample.normal);
    put(out, sample.foreground);
    put(out, sample.background);
    put(out, static_cast<float>(sample.crease));
  }
  for (const InnerEdgeSample& sample : model.edges_) {
    put(out, sample.point);
    put(out, sample.tangent);
    put(out, sample.clearance);
    put(out, static_cast<float>(sample.crease));
  }
  put(out, content_hash(out));
  return out;
}

Result<std::shared_ptr<const ViewpointModel>> observe::ViewpointModelBuilder::read(
    std::string_view content, uint64_t key, const std::string& where) {
  const auto damaged = [&](const char* what) {
    return make_error(ErrorCode::kDamaged, where, "not a usable viewpoint model: {}", what);
  };
  if (content.size() < 2 * sizeof(uint64_t)) return damaged("too short");
  const std::string_view body = content.substr(0, content.size() - sizeof(uint64_t));
  Taker sum(content.substr(body.size()));
  Taker in(body);
  if (in.number<uint64_t>() != kMagic) return damaged("another kind of file");
  if (in.number<uint32_t>() != kVersion) return damaged("written by another version");
  std::shared_ptr<ViewpointModel> model(new ViewpointModel());
  model->key_ = in.number<uint64_t>();
  if (model->key_ != key) return damaged("made of another mesh or with other options");
  if (sum.number<uint64_t>() != content_hash(body)) return damaged("checksum differs");
  model->options_ = take_options(in);
  model->center_ = in.vector<double>();
  model->radius_ = in.number<double>();
  const ViewpointModelOptions& options = model->options_;
  if (!in.ok() || !usable(options, model->center_, model->radius_)) {
    return damaged("header");
  }
  if (!take_rotations(in, model->radius_, model->symmetry_rotations_) ||
      !take_rotations(in, model->radius_, model->near_rotations_) ||
      !take_axis(in, model->radius_, model->symmetry_axis_) ||
      !take_axis(in, model->radius_, model->near_axis_)) {
    return damaged("symmetry");
  }
  const observe::ViewSphere sphere = observe::make_view_sphere(options.subdivisions);
  const size_t views = in.number<uint32_t>();
  if (views != sphere.directions.size() || in.left() < views * kViewBytes) return damaged("views");
  size_t contours = 0, edges = 0;
  for (size_t i = 0; i < views; ++i) {
    ViewpointModel::Record record;
    record.first_contour = static_cast<uint32_t>(contours);
    record.first_edge = static_cast<uint32_t>(edges);
    if (!take_record(in, sphere.directions[i], record)) return damaged("a view");
    contours += record.contours;
    edges += record.edges;
    model->records_.push_back(record);
  }
  if (contours == 0 || in.left() != contours * kContourBytes + edges * kEdgeBytes)
    return damaged("size");
  const Extent extent{model->center_, model->radius_,
                      ViewpointModel::kFreeLimit * static_cast<float>(model->radius_) * 1.001f};
  model->contours_.resize(contours);
  for (ContourSample& sample : model->contours_) {
    if (!take_contour(in, extent, sample)) return damaged("an outline sample");
  }
  model->edges_.resize(edges);
  for (InnerEdgeSample& sample : model->edges_) {
    if (!take_inner_edge(in, extent, sample)) return damaged("an edge sample");
  }
  model->finish();
  return std::shared_ptr<const ViewpointModel>(std::move(model));
}

Result<std::shared_ptr<const ViewpointModel>> ViewpointModel::load_or_build(
    const TriangleMesh& mesh, const DepthRendererFactory& factory,
    const ViewpointModelOptions& options, const std::filesystem::path& folder) {
  if (folder.empty()) return build(mesh, factory, options);
  const uint64_t wanted = key(mesh, options);
  const std::filesystem::path path = folder / cache_name(wanted);
  if (const auto content = read_file(path, kLargestFile)) {
    auto model = parse(*content, wanted, path.string());
    if (model) return model;
    log::warning("{}; made anew", model.error().message());
  }
  SL_ASSIGN(auto model, build(mesh, factory, options));
  std::error_code ignored;  // the write says what is wrong
  std::filesystem::create_directories(folder, ignored);
  const Status written = write_file_atomically(path, model->serialize());
  if (!written) {
    log::warning("{}; the viewpoint model will be made again next time", written.error().message());
  }
  return model;
}

}  // namespace sightline
