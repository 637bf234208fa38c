// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "sightline/base/files.hpp"
#include "sightline/observe/features/feature_model.hpp"

/// A feature file without its checksum, which is put right here so that the checks behind it are
/// reached. What is accepted is written back the same.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string content(reinterpret_cast<const char*>(data), size);
  const uint64_t sum = sightline::content_hash(content);
  content.append(reinterpret_cast<const char*>(&sum), sizeof sum);
  const auto model = sightline::parse_feature_model(content, "input");
  if (!model) return 0;
  if (sightline::format_feature_model(*model) != content) std::abort();
  return 0;
}
