// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace sightline::egl {

/// Tables in textures are this wide: item i sits at (i % kTableWidth, i / kTableWidth).
inline constexpr int kTableWidth = 2048;

/// The shaders of the rasterizer, complete sources.
std::string full_screen_vertex_source();  ///< one triangle over the whole target
std::string project_fragment_source();    ///< vertex table to projected vertices
std::string face_vertex_source();         ///< face to the box of pixels that it may touch
std::string face_fragment_source();       ///< pixel: is my ray inside the face, and how far

}  // namespace sightline::egl
