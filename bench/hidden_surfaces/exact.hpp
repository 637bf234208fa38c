// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "hidden_surfaces/scene.hpp"

namespace sightline::hidden_surfaces {

/// What is seen at each pixel, by rays. With Embree its rays (single precision, robust); without,
/// every ray against every face, which takes long.
Picture exact_picture(const Scene& scene);
bool exact_has_embree();

/// Who is seen at a pixel: the face's owner, or -1.
int owner_at(const Scene& scene, const Picture& picture, int x, int y);

/// Pixels at which another owner is drawn than rays see. Where the two disagree, the ray is cast
/// again against every face in double precision: that one counts, and `exact` takes it over. Faces
/// at the same distance to a part in 1e12 are both right.
size_t wrong_pixels(const Scene& scene, const Picture& drawn, Picture& exact,
                    const std::function<void(int, int)>& mark = nullptr);

}  // namespace sightline::hidden_surfaces
