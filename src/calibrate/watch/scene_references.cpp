// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cmath>
#include <cstring>

#include "calibrate/watch/scene_reference.hpp"
#include "sightline/base/files.hpp"

namespace sightline {
namespace {

using calibrate::ScenePatch;
using calibrate::SceneReference;

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kMagic = "SLSCENE1";
constexpr size_t kMostPatches = size_t{calibrate::kSceneColumns} * calibrate::kSceneRows;
constexpr uint32_t kMostCameras = 1024, kLongestName = 256, kLargestSide = 32768;

template <typename T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  bool get(T& value) {
    if (bytes_.size() < sizeof value) return false;
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return true;
  }
  bool get(std::string& text, size_t size) {
    if (bytes_.size() < size) return false;
    text = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return true;
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
};

// Whoever writes a calibration anew, as one does who takes over the place of another camera, may
// change the last digits of a number.
void put_rounded(std::string& out, double value) {
  put(out, static_cast<int64_t>(std::llround(value * 1e7)));
}

// Of its lens and place, whatever the file looks like that they stand in.
uint64_t fingerprint(const CalibratedCamera& camera) {
  const CameraModel::Parameters& p = camera.model.parameters();
  std::string bytes = camera.name;
  put(bytes, p.lens);
  for (const int v : {p.width, p.height}) put(bytes, v);
  for (const double v : {p.fx, p.fy, p.cx, p.cy}) put_rounded(bytes, v);
  for (const double v : p.distortion) put_rounded(bytes, v);
  const Eigen::Matrix4d place = camera.world_from_camera.matrix();
  for (int i = 0; i < 16; ++i) put_rounded(bytes, place.data()[i]);
  return content_hash(bytes);
}

bool read_patches(Reader& reader, SceneReference& reference) {
  uint32_t width = 0, height = 0, count = 0;
  if (!reader.get(width) || !reader.get(height) || !reader.get(count)) return false;
  if (width > kLargestSide || height > kLargestSide || count > kMostPatches) return false;
  reference.width = static_cast<int>(width);
  reference.height = static_cast<int>(height);
  for (uint32_t i = 0; i < count; ++i) {
    ScenePatch patch;
    double x = 0, y = 0;
    if (!reader.get(x) || !reader.get(y) || !reader.get(patch.gray)) return false;
    if (!std::isfinite(x) || !std::isfinite(y) || std::abs(x) > kLargestSide ||
        std::abs(y) > kLargestSide) {
      return false;
    }
    patch.pixel = {x, y};
    reference.patches.push_back(patch);
  }
  return true;
}

}  // namespace

SceneReferencePtr SceneReferences::find(const CalibratedCamera& camera) const {
  std::lock_guard lock(mutex_);
  const auto entry = entries_.find(camera.name);
  if (entry == entries_.end() || entry->second.calibration != fingerprint(camera)) return nullptr;
  return entry->second.reference;
}

void SceneReferences::set(const CalibratedCamera& camera, SceneReferencePtr reference) {
  std::lock_guard lock(mutex_);
  entries_[camera.name] = {fingerprint(camera), std::move(reference)};
  ++version_;
}

void SceneReferences::keep_only(const std::set<std::string>& names) {
  std::lock_guard lock(mutex_);
  if (std::erase_if(entries_, [&](const auto& entry) { return !names.contains(entry.first); }) >
      0) {
    ++version_;
  }
}

std::vector<std::pair<std::string, SceneReferencePtr>> SceneReferences::others(
    const CalibratedCamera& camera) const {
  std::vector<std::pair<std::string, SceneReferencePtr>> out;
  std::lock_guard lock(mutex_);
  for (const auto& [name, entry] : entries_) {
    if (name == camera.name || !entry.reference) continue;
    if (entry.reference->width != camera.model.width() / 2) continue;
    if (entry.reference->height != camera.model.height() / 2) continue;
    out.emplace_back(name, entry.reference);
  }
  return out;
}

uint64_t SceneReferences::version() const {
  std::lock_guard lock(mutex_);
  return version_;
}

std::string SceneReferences::bytes() const {
  std::lock_guard lock(mutex_);
  std::string out(kMagic);
  put(out, static_cast<uint32_t>(entries_.size()));
  for (const auto& [name, entry] : entries_) {
    put(out, static_cast<uint32_t>(name.size()));
    out += name;
    put(out, entry.calibration);
    put(out, static_cast<uint32_t>(entry.reference->width));
    put(out, static_cast<uint32_t>(entry.reference->height));
    put(out, static_cast<uint32_t>(entry.reference->patches.size()));
    for (const ScenePatch& patch : entry.reference->patches) {
      put(out, patch.pixel.x());
      put(out, patch.pixel.y());
      put(out, patch.gray);
    }
  }
  put(out, content_hash(out));
  return out;
}

Status SceneReferences::add(std::string_view bytes, const std::string& where) {
  const auto damaged = [&] {
    return make_error(ErrorCode::kInvalidInput, where,
                      "is damaged: what the cameras saw of their room is learned anew");
  };
  uint64_t sum = 0;
  if (bytes.size() < kMagic.size() + sizeof sum || !bytes.starts_with(kMagic)) return damaged();
  const std::string_view body = bytes.substr(0, bytes.size() - sizeof sum);
  Reader(bytes.substr(body.size())).get(sum);
  if (sum != content_hash(body)) return damaged();
  Reader reader(body.substr(kMagic.size()));
  uint32_t count = 0;
  if (!reader.get(count) || count > kMostCameras) return damaged();
  std::map<std::string, Entry> entries;
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t length = 0;
    std::string name;
    Entry entry;
    SceneReference reference;
    if (!reader.get(length) || length > kLongestName || !reader.get(name, length) ||
        !reader.get(entry.calibration) || !read_patches(reader, reference)) {
      return damaged();
    }
    entry.reference = std::make_shared<const SceneReference>(std::move(reference));
    entries.emplace(std::move(name), std::move(entry));
  }
  if (!reader.at_end()) return damaged();
  std::lock_guard lock(mutex_);
  entries_.merge(entries);
  return {};
}

}  // namespace sightline
