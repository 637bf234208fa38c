// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "sightline/base/files.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

/// A cache file without its checksum, which is put right here so that the checks behind it are
/// reached. What is accepted is written back the same and can be asked for views.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t kKeyAt = 12;  // after magic and version
  uint64_t key = 0;
  if (size < kKeyAt + sizeof key) return 0;
  std::memcpy(&key, data + kKeyAt, sizeof key);
  std::string content(reinterpret_cast<const char*>(data), size);
  const uint64_t sum = sightline::content_hash(content);
  content.append(reinterpret_cast<const char*>(&sum), sizeof sum);
  const auto model = sightline::ViewpointModel::parse(content, key, "input");
  if (!model) return 0;
  if ((*model)->serialize() != content) std::abort();
  for (size_t i = 0; i < (*model)->size(); ++i) {
    const auto view = (*model)->view(i);
    if ((*model)->nearest(view.camera_from_object) >= (*model)->size()) std::abort();
  }
  return 0;
}
