// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/result.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/pipeline/rig.hpp"

namespace sightline {

/// Loads every file that the installation names as a start does, and makes of it what a start
/// makes: meshes with their textures, scene, depth images, features, viewpoint models, marker
/// layouts, fonts, recordings. No device and no port is opened. Takes as long as a start; any
/// thread. The error names all files that are no good, each in a line, and what is wrong with them.
/// Stricter than a start in one thing: a texture that cannot be read costs a start only its colors.
Status check_files(const Installation& installation, const RigOptions& options = {});

}  // namespace sightline
