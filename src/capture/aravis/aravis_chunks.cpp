// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_chunks.hpp"

#include <cmath>

namespace sightline::capture {
namespace {

// Chooses a chunk and switches it; whether the camera took it.
bool enable(ArvCamera* camera, const char* chunk) {
  return ask(false, [&](GError** e) {
    arv_camera_set_string(camera, "ChunkSelector", chunk, e);
    if (*e != nullptr) return false;
    arv_camera_set_boolean(camera, "ChunkEnable", TRUE, e);
    return *e == nullptr;
  });
}

}  // namespace

AravisChunks AravisChunks::set_up(ArvCamera* camera, bool use) {
  AravisChunks chunks;
  const bool offered = ask(false, [&](GError** e) {
    return arv_camera_is_feature_available(camera, "ChunkModeActive", e) != 0;
  });
  if (!offered) return chunks;
  const auto switch_mode = [&](bool on) {
    return ask(false, [&](GError** e) {
      arv_camera_set_chunk_mode(camera, on ? TRUE : FALSE, e);
      return *e == nullptr;
    });
  };
  if (use && switch_mode(true)) {
    chunks.exposure_ = enable(camera, "ExposureTime");
    chunks.frame_id_ = enable(camera, "FrameID");
    if (chunks.exposure_ || chunks.frame_id_) {
      std::lock_guard lock(description_mutex());
      chunks.parser_.reset(arv_camera_create_chunk_parser(camera));
      return chunks;
    }
  }
  (void)switch_mode(false);
  return chunks;
}

AravisChunks::Values AravisChunks::read(ArvBuffer* buffer) const {
  Values values;
  if (parser_ == nullptr) return values;
  if (exposure_) {
    const double us = ask(-1.0, [&](GError** e) {
      return arv_chunk_parser_get_float_value(parser_.get(), buffer, "ChunkExposureTime", e);
    });
    if (std::isfinite(us) && us > 0) values.exposure_us = us;
  }
  if (frame_id_) {
    const int64_t id = ask(int64_t{-1}, [&](GError** e) {
      return arv_chunk_parser_get_integer_value(parser_.get(), buffer, "ChunkFrameID", e);
    });
    if (id >= 0) values.frame_id = static_cast<uint64_t>(id);
  }
  return values;
}

}  // namespace sightline::capture
