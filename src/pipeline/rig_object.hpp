// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/pipeline/rig.hpp"

namespace sightline::pipeline {

/// What else than its mesh an object needs in an installation.
struct ObjectNeeds {
  bool views = false;     ///< it is measured by its own look, or searched for
  bool searched = false;  ///< then its colors are needed in any case

  bool operator==(const ObjectNeeds&) const = default;
};
ObjectNeeds needs_of(const Installation& installation, const ObjectDescription& object);

/// Reads a mesh with the creases that the installation asks for.
Result<TriangleMesh> load_mesh(const std::filesystem::path& path, double meters_per_unit,
                               const Installation& installation);
RenderMeshOptions render_mesh_options(const Installation& installation);

/// Loads one object of the installation. Any number of objects at a time.
Result<RigObject> load_object(const Installation& installation, ObjectId id,
                              const RigOptions& options);

}  // namespace sightline::pipeline
