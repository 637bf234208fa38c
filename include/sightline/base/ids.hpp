// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>
#include <functional>

namespace sightline {

/// Index of a thing in its installation or recording; the tag keeps cameras and objects apart.
/// Names live in the configuration, never in the hot path.
template <typename Tag>
class StrongId {
 public:
  constexpr StrongId() = default;
  constexpr explicit StrongId(uint32_t index) : index_(index) {}
  constexpr uint32_t index() const { return index_; }
  friend constexpr auto operator<=>(StrongId, StrongId) = default;

 private:
  uint32_t index_ = 0;
};

using CameraId = StrongId<struct CameraTag>;
using ObjectId = StrongId<struct ObjectTag>;

}  // namespace sightline

template <typename Tag>
struct std::hash<sightline::StrongId<Tag>> {
  size_t operator()(sightline::StrongId<Tag> id) const noexcept { return id.index(); }
};
