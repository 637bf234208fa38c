// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "init/rig_draft.hpp"

namespace sightline::cli {

/// A text as TOML writes it, quotes included.
std::string toml_text(const std::string& text);

/// The installation file with comments: what each part is for, and what to do next. `file`: where
/// it will be; paths below its folder are written relative to it. `calibration`: the file with the
/// cameras' lenses and places.
std::string installation_text(const RigDraft& draft, const std::filesystem::path& file,
                              const std::filesystem::path& calibration);

/// The object file of a mesh. `size`: its sides in meters, in words.
std::string object_text(const std::string& name, const std::string& mesh, const std::string& unit,
                        const std::string& size);

}  // namespace sightline::cli
