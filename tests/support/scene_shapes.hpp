// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "sightline/geometry/mesh.hpp"
#include "sightline/model/object.hpp"

namespace sightline::test {

/// Made-up objects [m], each centerd about its frame's origin. `faces` is approximate.

/// A creature of lumps (body, neck, head, tail, wings, feet), about 103 x 46 x 72 mm: an irregular
/// outline from every side, smooth, of one color.
TriangleMesh make_creature(size_t faces);
/// Cab, bed, bumper and four wheels in colors of their own, 160 x 80 x 85 mm.
TriangleMesh make_truck();
/// Turned about z, 60 mm thick and 170 mm high: looks the same at every turn.
TriangleMesh make_bottle(size_t faces);
/// An angle of two plates with unequal legs, 90 x 60 x 70 mm: flat faces and sharp edges.
TriangleMesh make_bracket();
/// A box of 110 x 70 x 45 mm: few edges, two-fold ambiguous outline.
TriangleMesh make_carton();
/// The same, every side in a color of its own.
TriangleMesh make_colored_carton();

/// Writes vertices and faces as OBJ, and their colors as materials beside it (NAME.mtl).
Status write_obj(const std::filesystem::path& path, const TriangleMesh& mesh);

/// Writes NAME.obj and NAME.toml (an object file of unit "m") into a folder that exists.
Result<std::filesystem::path> write_object(const std::filesystem::path& folder,
                                           const std::string& name, const TriangleMesh& mesh,
                                           Symmetry symmetry = Symmetry::kNone, int order = 1);

/// A column of 48 sides about z, 30 mm thick and 100 mm high, and a box in the same mesh [m]: a cup
/// with a handle.
TriangleMesh make_column_with_box(const Eigen::Vector3f& box_middle,
                                  const Eigen::Vector3f& box_size);

}  // namespace sightline::test
