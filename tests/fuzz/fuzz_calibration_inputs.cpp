// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "sightline/calibrate/interchange.hpp"
#include "sightline/calibrate/place_world.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/calibrate/views.hpp"

namespace {

using namespace sightline;

/// What is accepted is written and read again.
void expect_again(const std::vector<NamedText>& files, InterchangeFormat format) {
  const auto cameras = import_cameras(files, format);
  if (!cameras) return;
  const auto written = export_cameras(*cameras, format);
  if (written && !import_cameras(*written, format)) std::abort();
}

}  // namespace

/// The readers of targets, corners, surveyed points and other programs' cameras.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto target = parse_target(text, "fuzz");
  if (target && !parse_target(format_target(*target), "again")) std::abort();
  const auto views = parse_views(text, "fuzz");
  if (views && !parse_views(format_views(*views), "again")) std::abort();
  (void)parse_surveyed_points(text, "fuzz");
  (void)import_cameras({{"camchain.yaml", text}}, InterchangeFormat::kKalibr);
  (void)import_cameras({{"left.yaml", text}}, InterchangeFormat::kRos);
  (void)import_cameras({{"static_transforms.yaml", text}}, InterchangeFormat::kRos);
  (void)import_cameras({{"cameras.txt", text}, {"images.txt", text}}, InterchangeFormat::kColmap);
  expect_again({{"left.cameramodel", text}}, InterchangeFormat::kMrcal);
  expect_again({{"camera_array.toml", text}}, InterchangeFormat::kAnipose);
  return 0;
}
