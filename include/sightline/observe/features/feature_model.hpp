// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"

namespace sightline {

/// A point on an object's surface and its descriptor, as seen from one direction.
struct TrainedFeature {
  Eigen::Vector3f point = Eigen::Vector3f::Zero();       ///< on the mesh, object frame [m]
  Eigen::Vector3f view = Eigen::Vector3f::UnitZ();       ///< unit, from the point to the camera
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();     ///< unit, of the surface, outwards
  Eigen::Vector3f direction = Eigen::Vector3f::UnitX();  ///< unit, its orientation on the surface
  float size = 0;                                        ///< of its patch across the view [m]
  std::array<uint8_t, 32> descriptor{};                  ///< ORB (Rublee et al., 2011), 256 bits
};

/// Features of an object's texture, trained from images in which its pose was known. The file
/// (docs/formats.md) is checked whole when read.
struct FeatureModel {
  uint64_t mesh = 0;  ///< mesh_content() of the mesh that the points lie on
  std::vector<TrainedFeature> features;

  static constexpr size_t kMax = 20'000;  ///< features of one object
};

/// Hash of where a mesh's faces are: a model trained on another mesh is refused.
uint64_t mesh_content(const TriangleMesh& mesh);

/// Errors name the file: not a feature file, of another version, cut short, damaged (checksum),
/// numbers that cannot be.
Result<FeatureModel> read_feature_model(const std::filesystem::path& path);
Result<FeatureModel> parse_feature_model(std::string_view bytes, const std::string& where);
/// Replaces the file so that a crash leaves the old one or the new one.
Status write_feature_model(const std::filesystem::path& path, const FeatureModel& model);
std::string format_feature_model(const FeatureModel& model);

}  // namespace sightline
