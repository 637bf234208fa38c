// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/features/feature_model.hpp"

#include <cmath>
#include <cstring>
#include <type_traits>

#include "sightline/base/files.hpp"

namespace sightline {
namespace {

constexpr std::string_view kMagic = "SLFEATS2";
constexpr size_t kHeader = 8 + 8 + 4, kFeature = 13 * 4 + 32, kChecksum = 8;

template <typename T>
void put(std::string& out, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}
void put(std::string& out, const Eigen::Vector3f& v) {
  for (int i = 0; i < 3; ++i) put(out, v[i]);
}

template <typename T>
T take(const char*& at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  at += sizeof(T);
  return value;
}
Eigen::Vector3f take_vector(const char*& at) {
  const auto x = take<float>(at), y = take<float>(at), z = take<float>(at);
  return {x, y, z};
}

bool unit(const Eigen::Vector3f& v) { return v.norm() > 0.99f && v.norm() < 1.01f; }

Error damaged(const std::string& where, const std::string& what) {
  return make_error(ErrorCode::kDamaged, where, "{}; train the object again (sightline train)",
                    what);
}

}  // namespace

uint64_t mesh_content(const TriangleMesh& mesh) {
  std::string content;
  content.reserve(36 * mesh.faces.size());
  for (const auto& face : mesh.faces) {
    for (const auto corner : face) put(content, mesh.vertices[static_cast<size_t>(corner)]);
  }
  return content_hash(content);
}

std::string format_feature_model(const FeatureModel& model) {
  std::string out(kMagic);
  put(out, model.mesh);
  put(out, static_cast<uint32_t>(model.features.size()));
  for (const TrainedFeature& feature : model.features) {
    put(out, feature.point);
    put(out, feature.view);
    put(out, feature.normal);
    put(out, feature.direction);
    put(out, feature.size);
    put(out, feature.descriptor);
  }
  put(out, content_hash(out));
  return out;
}

Result<FeatureModel> parse_feature_model(std::string_view bytes, const std::string& where) {
  if (bytes.substr(0, kMagic.size()) != kMagic) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "is no feature file of this version (it does not start with {}); train the "
                      "object again (sightline train)",
                      kMagic);
  }
  if (bytes.size() < kHeader + kChecksum) return damaged(where, "the feature file is cut short");
  const char* at = bytes.data() + kMagic.size();
  FeatureModel model;
  model.mesh = take<uint64_t>(at);
  const auto count = take<uint32_t>(at);
  if (count > FeatureModel::kMax || bytes.size() != kHeader + count * kFeature + kChecksum) {
    return damaged(where, fmt::format("the feature file has {} bytes, which is not what its {} "
                                      "features take",
                                      bytes.size(), count));
  }
  const char* end = bytes.data() + bytes.size() - kChecksum;
  if (take<uint64_t>(end) != content_hash(bytes.substr(0, bytes.size() - kChecksum))) {
    return damaged(where, "the feature file's checksum is wrong");
  }
  for (uint32_t i = 0; i < count; ++i) {
    TrainedFeature feature;
    feature.point = take_vector(at);
    feature.view = take_vector(at);
    feature.normal = take_vector(at);
    feature.direction = take_vector(at);
    feature.size = take<float>(at);
    feature.descriptor = take<std::array<uint8_t, 32>>(at);
    if (!feature.point.allFinite() || !unit(feature.view)) {
      return damaged(where, fmt::format("feature {} is at no place", i));
    }
    if (!unit(feature.normal) || !unit(feature.direction) || !(feature.size > 0) ||
        !std::isfinite(feature.size)) {
      return damaged(where, fmt::format("feature {} has no patch", i));
    }
    model.features.push_back(feature);
  }
  return model;
}

Result<FeatureModel> read_feature_model(const std::filesystem::path& path) {
  SL_ASSIGN(const std::string bytes, read_file(path));
  return parse_feature_model(bytes, path.string());
}

Status write_feature_model(const std::filesystem::path& path, const FeatureModel& model) {
  SL_CHECK(model.features.size() <= FeatureModel::kMax, "more features than a file holds");
  return write_file_atomically(path, format_feature_model(model));
}

}  // namespace sightline
