// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// What an installation file says that is to become those of several hosts. Not checked but for
/// its syntax and the parts below: the files that are made of it are.
struct CellDraft {
  struct Camera {
    std::string name;
    std::string host;    ///< empty: it does not say
    unsigned line = 0;   ///< of its [[camera]]
    std::string cell{};  ///< empty: it does not say
  };
  std::vector<Camera> cameras;
  std::string name, host, broker;        ///< of [cell]; empty: not there
  std::vector<std::string> neighbors{};  ///< of [cell]
  bool fuses = false;                    ///< [cell] is that of a host which keeps the estimates
  std::string kept;                      ///< lines of [cell] that hold for every host
  size_t cell_begin = 0, cell_end = 0;   ///< bytes of [cell]; equal: there is none
  /// Whatever text in it is the name of a file below its folder, relative to that; each once.
  std::vector<std::filesystem::path> files;
  /// Files that lie elsewhere: every host needs them there.
  std::vector<std::filesystem::path> elsewhere;
};

Result<CellDraft> read_cell_draft(std::string_view text, const std::filesystem::path& path);

/// The text with `section` ("[cell]\n...") in place of its own, and with a host for each camera
/// that says none: `hosts`, by name of the camera.
std::string with_cell(std::string_view text, const CellDraft& draft,
                      const std::map<std::string, std::string>& hosts, std::string_view section);

}  // namespace sightline
