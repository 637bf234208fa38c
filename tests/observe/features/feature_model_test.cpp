// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/features/feature_model.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "support/matchers.hpp"
#include "support/random.hpp"
#include "support/scene_shapes.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;

FeatureModel some_model() {
  test::Random random(4);
  FeatureModel model;
  model.mesh = 0x1234;
  for (int i = 0; i < 20; ++i) {
    TrainedFeature feature;
    feature.point = (0.05 * random.normal<3>()).cast<float>();
    feature.view = random.normal<3>().normalized().cast<float>();
    feature.normal = random.normal<3>().normalized().cast<float>();
    feature.direction = random.normal<3>().normalized().cast<float>();
    feature.size = static_cast<float>(random.uniform(0.01, 0.02));
    for (uint8_t& byte : feature.descriptor) byte = static_cast<uint8_t>(random.bits());
    model.features.push_back(feature);
  }
  return model;
}

TEST(FeatureModel, ComesBackAsItWasWritten) {
  const FeatureModel model = some_model();
  const std::filesystem::path path = ::testing::TempDir() + "some.feat";
  ASSERT_THAT(write_feature_model(path, model), IsOk());
  const auto back = read_feature_model(path);
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->mesh, model.mesh);
  ASSERT_EQ(back->features.size(), model.features.size());
  for (size_t i = 0; i < model.features.size(); ++i) {
    EXPECT_EQ(back->features[i].point, model.features[i].point);
    EXPECT_EQ(back->features[i].view, model.features[i].view);
    EXPECT_EQ(back->features[i].normal, model.features[i].normal);
    EXPECT_EQ(back->features[i].direction, model.features[i].direction);
    EXPECT_EQ(back->features[i].size, model.features[i].size);
    EXPECT_EQ(back->features[i].descriptor, model.features[i].descriptor);
  }
  EXPECT_EQ(format_feature_model(*back), format_feature_model(model));
}

TEST(FeatureModel, EveryDamageIsNamed) {
  const std::string whole = format_feature_model(some_model());
  EXPECT_THAT(parse_feature_model("", "a.feat"), FailsWith("a.feat: is no feature file"));
  EXPECT_THAT(parse_feature_model("SLFEATS9" + whole.substr(8), "a.feat"),
              FailsWith("is no feature file of this version"));
  for (size_t size = 8; size < whole.size(); ++size) {
    EXPECT_THAT(parse_feature_model(whole.substr(0, size), "a.feat"), FailsWith("a.feat: "))
        << size;
  }
  for (size_t i = 8; i < whole.size(); ++i) {
    std::string altered = whole;
    altered[i] = static_cast<char>(altered[i] ^ 0x40);
    EXPECT_THAT(parse_feature_model(altered, "a.feat"), FailsWith("train the object again")) << i;
  }
  EXPECT_THAT(parse_feature_model(whole + "x", "a.feat"), FailsWith("bytes"));
  FeatureModel nowhere = some_model();
  nowhere.features[3].point.x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(parse_feature_model(format_feature_model(nowhere), "a.feat"),
              FailsWith("feature 3 is at no place"));
  FeatureModel shapeless = some_model();
  shapeless.features[5].size = 0;
  EXPECT_THAT(parse_feature_model(format_feature_model(shapeless), "a.feat"),
              FailsWith("feature 5 has no patch"));
  EXPECT_THAT(parse_feature_model("SLFEATS1" + whole.substr(8), "a.feat"),
              FailsWith("is no feature file of this version"));
  EXPECT_THAT(read_feature_model("/nowhere/a.feat"), FailsWith("/nowhere/a.feat"));
}

TEST(FeatureModel, KnowsItsMesh) {
  const TriangleMesh carton = test::make_carton();
  TriangleMesh other = carton;
  other.vertices[2].x() += 1e-4f;
  EXPECT_EQ(mesh_content(carton), mesh_content(test::make_carton()));
  EXPECT_NE(mesh_content(carton), mesh_content(other));
}

}  // namespace
}  // namespace sightline
